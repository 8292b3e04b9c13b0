//! Places within a step, at which tests change a world.

use avian::collider_tree::{ColliderTreeOptimization, ColliderTreeSystems};
use avian::collision::broad_phase::BroadPhaseSystems;
use avian::collision::narrow_phase::CollisionEventSystems;
use avian::prelude::*;
use bevy::ecs::schedule::ScheduleConfigs;
use bevy::ecs::system::ScheduleSystem;
use bevy::prelude::*;

/// A place in a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Place {
    First,
    BeforePairs,
    AfterPairs,
    NarrowPhase,
    Solver,
    Sleeping,
    /// In an observer of `CollisionStart`.
    Observer,
    Finalize,
    /// Before avian clears its list of moved proxies.
    AfterFinalize,
    /// After that.
    BeforeLast,
    Last,
}

/// The action at each place of a step.
#[derive(Resource, Clone, Copy)]
struct AtPlaces(fn(&mut World, Place));

impl Place {
    pub(crate) const ALL: [Self; 11] = [
        Self::First,
        Self::BeforePairs,
        Self::AfterPairs,
        Self::NarrowPhase,
        Self::Solver,
        Self::Sleeping,
        Self::Observer,
        Self::Finalize,
        Self::AfterFinalize,
        Self::BeforeLast,
        Self::Last,
    ];

    /// Returns a system at this place; none for an observer.
    fn system(self) -> Option<ScheduleConfigs<ScheduleSystem>> {
        let system = (move |world: &mut World| self.run(world)).ambiguous_with_all();
        Some(match self {
            Self::First => system.in_set(PhysicsStepSystems::First),
            Self::BeforePairs => system
                .in_set(PhysicsStepSystems::BroadPhase)
                .after(ColliderTreeSystems::UpdateAabbs)
                .before(BroadPhaseSystems::CollectCollisions),
            Self::AfterPairs => {
                system.in_set(BroadPhaseSystems::Last).before(ColliderTreeSystems::BeginOptimize)
            }
            Self::NarrowPhase => system.in_set(NarrowPhaseSystems::Last),
            Self::Solver => system.after(PhysicsStepSystems::Solver).before(PhysicsStepSystems::Sleeping),
            Self::Sleeping => system.after(PhysicsStepSystems::Sleeping).before(PhysicsStepSystems::Finalize),
            Self::Observer => return None,
            Self::Finalize => system.in_set(PhysicsStepSystems::Finalize).after(CollisionEventSystems),
            Self::AfterFinalize | Self::BeforeLast => {
                system.after(PhysicsStepSystems::Finalize).before(PhysicsStepSystems::Last)
            }
            Self::Last => system.in_set(PhysicsStepSystems::Last),
        })
    }

    fn run(self, world: &mut World) {
        if let Some(&AtPlaces(run)) = world.get_resource() {
            run(world, self);
        }
    }
}

/// Adds the place that comes before a system of avian's only if it is added before avian's plug-ins.
pub(crate) fn add_first_place(app: &mut App) {
    app.add_systems(PhysicsSchedule, Place::AfterFinalize.system().expect("a system"));
}

/// Makes an app call a function at all places of each step. It names each place; that of observers as often as there are events.
pub(crate) fn add_places(app: &mut App, run: fn(&mut World, Place)) {
    // Avian loses what changes in a tree while a task optimises a copy of it, and panics later.
    app.world_mut().resource_mut::<ColliderTreeOptimization>().use_compute_task = false;
    app.insert_resource(AtPlaces(run));
    let places = Place::ALL.into_iter().filter(|&place| place != Place::AfterFinalize);
    for system in places.filter_map(Place::system) {
        app.add_systems(PhysicsSchedule, system);
    }
    app.add_observer(|_: On<CollisionStart>, mut commands: Commands| {
        commands.queue(|world: &mut World| Place::Observer.run(world));
    });
}
