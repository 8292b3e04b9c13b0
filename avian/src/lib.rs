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
//! With collision hooks, name them twice: `disable::<BvhBroadPhasePlugin<MyHooks>>()` and
//! `add(PbigBroadPhasePlugin::<MyHooks>::default())`.
//!
//! The pairs are those of avian's own broad phase, in each step. [`shadow::ShadowPlugin`] compares both in a running app. Contacts
//! are created in an order that depends on the scene alone, not on the number of threads. Spatial queries and swept CCD read
//! avian's trees, as before.
//!
//! Do not clear avian's `ContactGraph` by hand: pbig reports each pair once, when it begins.

mod ask;
mod boxes;
mod collect;
mod lost;
pub mod shadow;
mod waiting;

pub use boxes::ColliderBoxes;
pub use pbig_core::{Error, Report};

use avian::collision::broad_phase::BroadPhaseSystems;
use avian::prelude::*;
use bevy::ecs::system::SystemParamItem;
use bevy::prelude::*;
use std::marker::PhantomData;

/// Finds pairs of colliders with pbig. Add it in place of `BvhBroadPhasePlugin`, with the same hooks.
pub struct PbigBroadPhasePlugin<H: CollisionHooks = ()>(PhantomData<H>);

impl PbigBroadPhasePlugin {
    /// Makes the plugin without collision hooks.
    pub fn new() -> Self {
        Self::default()
    }
}

impl<H: CollisionHooks> Default for PbigBroadPhasePlugin<H> {
    fn default() -> Self {
        Self(PhantomData)
    }
}

impl<H: CollisionHooks + 'static> Plugin for PbigBroadPhasePlugin<H>
where
    for<'w, 's> SystemParamItem<'w, 's, H>: CollisionHooks,
{
    fn build(&self, app: &mut App) {
        follow_colliders(app);
        app.add_systems(
            PhysicsSchedule,
            collect::add_contacts::<H>
                .in_set(BroadPhaseSystems::CollectCollisions)
                // Avian's schedule panics at an ambiguity; `finish` warns of the one that can be.
                .ambiguous_with_all(),
        );
    }

    fn finish(&self, app: &mut App) {
        if app.is_plugin_added::<BvhBroadPhasePlugin<H>>() {
            warn!(
                "avian's own broad phase runs beside pbig: `.disable::<BvhBroadPhasePlugin>()` saves its time"
            );
        }
    }
}

/// Adds the boxes, and the observers that tell which colliders have lost their contacts.
fn follow_colliders(app: &mut App) {
    app.init_resource::<ColliderBoxes>().init_resource::<lost::Lost>();
    lost::add_observers(app);
}
