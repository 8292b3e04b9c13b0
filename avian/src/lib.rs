//! pbig for avian 0.8: finds the pairs of colliders in place of avian's own broad phase. No patch is needed.
//!
//! ```
//! use avian::prelude::*; // avian2d or avian3d
//! use avian_pbig::PbigBroadPhasePlugin;
//! use bevy::prelude::*;
//!
//! let mut app = App::new();
//! app.add_plugins((
//!     MinimalPlugins,
//!     bevy::transform::TransformPlugin,
//!     PhysicsPlugins::default()
//!         .build()
//!         .disable::<BvhBroadPhasePlugin>()
//!         .add(PbigBroadPhasePlugin::new()), // the changed lines
//! ));
//! app.finish();
//! app.cleanup();
//! app.update();
//! ```
//!
//! With collision hooks, name them here, too: `disable::<BvhBroadPhasePlugin<MyHooks>>()` and
//! `add(PbigBroadPhasePlugin::<MyHooks>::default())`.
//!
//! The pairs are those of avian's own broad phase, in each step. [`PbigBroadPhasePlugin::as_shadow`] compares both in a running
//! app. Contacts are created in an order that depends on the scene alone, not on the number of threads. Spatial queries and swept
//! CCD read avian's trees, as before.
//!
//! Do not clear avian's `ContactGraph` by hand: pbig reports each pair once, when it begins.

mod boxes;
mod lost;
mod shadow;
mod step;

pub use avian;
pub use boxes::ColliderBoxes;
pub use pbig_core;
pub use shadow::Shadow;

use avian::collision::broad_phase::BroadPhaseSystems;
use avian::collision::narrow_phase::CollisionEventSystems;
use avian::prelude::*;
use bevy::ecs::system::SystemParamItem;
use bevy::prelude::*;
use std::marker::PhantomData;

/// Finds pairs of colliders with pbig. Add it in place of `BvhBroadPhasePlugin`, with the same hooks.
pub struct PbigBroadPhasePlugin<H: CollisionHooks = ()> {
    is_shadow: bool,
    hooks: PhantomData<H>,
}

impl PbigBroadPhasePlugin {
    /// Makes the plugin without collision hooks.
    pub fn new() -> Self {
        Self::default()
    }
}

impl<H: CollisionHooks> Default for PbigBroadPhasePlugin<H> {
    fn default() -> Self {
        Self { is_shadow: false, hooks: PhantomData }
    }
}

impl<H: CollisionHooks> PbigBroadPhasePlugin<H> {
    /// Makes the plugin compare its pairs with those of avian's own broad phase, which stays in charge. [`Shadow`] has the result.
    /// Add it beside `BvhBroadPhasePlugin`, and with the same hooks. They are asked again about pairs that they forbid. Without avian's
    /// own broad phase all pairs are spurious, and a warning says so.
    ///
    /// ```
    /// use avian::prelude::*; // avian2d or avian3d
    /// use avian_pbig::{PbigBroadPhasePlugin, Shadow};
    /// use bevy::prelude::*;
    ///
    /// let mut app = App::new();
    /// app.add_plugins((MinimalPlugins, bevy::transform::TransformPlugin));
    /// app.add_plugins(PhysicsPlugins::default().build().add(PbigBroadPhasePlugin::new().as_shadow()));
    /// app.finish();
    /// app.cleanup();
    /// app.update();
    /// let shadow = app.world().resource::<Shadow>();
    /// assert!(shadow.missing.is_empty() && shadow.spurious.is_empty(), "{shadow:?}");
    /// ```
    pub fn as_shadow(self) -> Self {
        Self { is_shadow: true, ..self }
    }
}

impl<H: CollisionHooks + 'static> Plugin for PbigBroadPhasePlugin<H>
where
    for<'w, 's> SystemParamItem<'w, 's, H>: CollisionHooks,
{
    fn build(&self, app: &mut App) {
        let late = lost::follow_late.in_set(PhysicsStepSystems::Finalize).after(CollisionEventSystems);
        app.init_resource::<ColliderBoxes>().add_systems(PhysicsSchedule, late.ambiguous_with_all());
        if self.is_shadow {
            let system = shadow::compare::<H>
                .in_set(PhysicsStepSystems::BroadPhase)
                .after(BroadPhaseSystems::CollectCollisions)
                .before(BroadPhaseSystems::Last);
            app.init_resource::<Shadow>().add_systems(PhysicsSchedule, system);
        } else {
            // Avian's schedule panics at an ambiguity; `finish` warns of the one that can be.
            let system =
                step::add_contacts::<H>.in_set(BroadPhaseSystems::CollectCollisions).ambiguous_with_all();
            app.add_systems(PhysicsSchedule, system);
        }
    }

    fn finish(&self, app: &mut App) {
        if !app.world().contains_resource::<ContactGraph>() {
            warn!("avian's `PhysicsPlugins` are missing: pbig finds pairs for them");
        }
        lost::add_observers(app.world_mut());
        match (self.is_shadow, app.is_plugin_added::<BvhBroadPhasePlugin<H>>()) {
            (false, true) => warn!(
                "avian's own broad phase runs beside pbig: `.disable::<BvhBroadPhasePlugin>()`, or `<BvhBroadPhasePlugin<MyHooks>>`, \
                 saves its time"
            ),
            (true, false) => warn!(
                "avian's own broad phase is missing: leave out `.as_shadow()`; or it has other hooks: add \
                 `PbigBroadPhasePlugin::<MyHooks>::default().as_shadow()`"
            ),
            _ => {}
        }
    }
}
