//! Apps that step once in each update, and what random worlds and lanes share.

#![allow(dead_code, reason = "each test uses its part")]

use avian::prelude::*;
use avian_pbig::PbigBroadPhasePlugin;
use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use std::time::Duration;

pub(crate) mod places;
pub(crate) mod random;
pub(crate) mod record;
pub(crate) mod ways;

/// Hooks that forbid every pair whose sum of [`Number`]s is divisible by a number, which changes with time.
#[derive(SystemParam)]
pub(crate) struct Veto<'w, 's> {
    divisor: Res<'w, Divisor>,
    numbers: Query<'w, 's, &'static Number, Allow<Disabled>>,
}

/// The number of [`Veto`].
#[derive(Resource, Default)]
pub(crate) struct Divisor(pub(crate) u32);

impl CollisionHooks for Veto<'_, '_> {
    fn filter_pairs(&self, one: Entity, other: Entity, _: &mut Commands) -> bool {
        let numbers = self.numbers.get_many([one, other]);
        self.divisor.0 == 0
            || numbers.is_ok_and(|[one, other]| !(one.0 + other.0).is_multiple_of(self.divisor.0))
    }
}

/// Makes an app that steps the physics once in each update.
pub(crate) fn app(plugins: impl PluginGroup) -> App {
    let mut app = App::new();
    places::add_first_place(&mut app);
    app.add_plugins((MinimalPlugins, bevy::transform::TransformPlugin)).add_plugins(plugins.build());
    app.init_resource::<Divisor>();
    app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_secs_f64(1.0 / 64.0)));
    app.finish();
    app.cleanup();
    // The first update has no time to step.
    app.update();
    app
}

/// Avian's plugins with [`Veto`], stepped once in each update.
pub(crate) fn plugins() -> bevy::app::PluginGroupBuilder {
    PhysicsPlugins::default().with_collision_hooks::<Veto>().build()
}

/// Makes an app with pbig in place of avian's broad phase, and [`Veto`].
pub(crate) fn app_with_pbig() -> App {
    app(plugins().disable::<BvhBroadPhasePlugin<Veto>>().add(PbigBroadPhasePlugin::<Veto>::default()))
}

/// Two or three, by the crate that is tested.
pub(crate) const DIMENSIONS: f32 = size_of::<Position>() as f32 / size_of::<f32>() as f32;

/// The number of a body in the order in which bodies are spawned: the same in two apps, whose entities differ.
#[derive(Component, Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) struct Number(pub(crate) u32);

/// Makes a ball, the collider that two and three dimensions share.
pub(crate) fn collider(diameter: f32) -> Collider {
    avian::parry::shape::SharedShape::ball(diameter / 2.0).into()
}
