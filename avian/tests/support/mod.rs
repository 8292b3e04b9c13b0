//! Random worlds: bodies and colliders that come, move, change and go.

#![allow(dead_code, reason = "each test uses its part")]

use avian::prelude::*;
use avian_pbig::PbigBroadPhasePlugin;
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use std::time::Duration;

/// Hooks that forbid every pair whose entities' sum is divisible by a number, which changes with time.
#[derive(SystemParam)]
pub(crate) struct Veto<'w> {
    divisor: Res<'w, Divisor>,
}

/// The number of [`Veto`].
#[derive(Resource, Default)]
pub(crate) struct Divisor(pub(crate) u32);

impl CollisionHooks for Veto<'_> {
    fn filter_pairs(&self, one: Entity, other: Entity, _: &mut Commands) -> bool {
        self.divisor.0 == 0 || !(one.index_u32() + other.index_u32()).is_multiple_of(self.divisor.0)
    }
}

/// Makes an app that steps the physics once in each update.
pub(crate) fn app(plugins: impl PluginGroup) -> App {
    let mut app = App::new();
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

/// The entities of a random world.
pub(crate) struct RandomWorld {
    rng: StdRng,
    bodies: Vec<Entity>,
    joints: Vec<(Entity, [Entity; 2])>,
    width: f32,
    spawned: u32,
}

impl RandomWorld {
    /// Spawns bodies of all kinds.
    pub(crate) fn new(app: &mut App, seed: u64, bodies: usize) -> Self {
        let width = (bodies as f32).powf(1.0 / DIMENSIONS) * 1.5;
        let mut world =
            Self { rng: StdRng::seed_from_u64(seed), bodies: vec![], joints: vec![], width, spawned: 0 };
        (0..bodies).for_each(|_| world.spawn(app.world_mut()));
        (0..bodies / 10).for_each(|_| world.join(app.world_mut()));
        world
    }

    /// Makes some random changes.
    pub(crate) fn change(&mut self, app: &mut App, changes: usize) {
        for _ in 0..changes {
            self.change_one(app.world_mut());
        }
        app.world_mut().resource_mut::<Divisor>().0 = self.rng.random_range(0..6);
    }

    fn change_one(&mut self, world: &mut World) {
        let i = self.rng.random_range(0..self.bodies.len());
        let body = self.bodies[i];
        match self.rng.random_range(0..16) {
            0 => {
                world.entity_mut(self.bodies.swap_remove(i)).despawn();
                self.spawn(world);
            }
            1 => toggle(world, body, RigidBodyDisabled),
            2 => toggle(world, body, ColliderDisabled),
            3 => toggle(world, body, Sensor),
            4 => self.set_layers(world, body),
            5 => self.set_body(world, body),
            6 | 7 => self.change_joint(world),
            8 => self.change_collider(world, body),
            9 => toggle(world, body, ActiveCollisionHooks::FILTER_PAIRS),
            10 => self.swap_collider(world, body),
            _ => {
                let place = self.place();
                world.entity_mut(body).insert(place);
            }
        }
    }

    fn place(&mut self) -> Transform {
        let mut one = || self.rng.random_range(0.0..self.width);
        Transform::from_xyz(one(), one(), one())
    }

    fn spawn(&mut self, world: &mut World) {
        let place = self.place();
        let mut entity =
            world.spawn((collider(self.rng.random_range(0.2..1.2)), place, Number(self.spawned)));
        self.spawned += 1;
        let body = self.rng.random_range(0..8);
        if body < 7 {
            entity.insert((kind(body), GravityScale(0.0)));
        }
        if self.rng.random_bool(0.1) {
            entity.insert(Sensor);
        }
        if self.rng.random_bool(0.3) {
            entity.insert(ActiveCollisionHooks::FILTER_PAIRS);
        }
        if body < 7 && self.rng.random_bool(0.2) {
            entity.with_child((collider(0.5), Transform::from_xyz(0.7, 0.0, 0.0)));
        }
        self.bodies.push(entity.id());
    }

    fn set_layers(&mut self, world: &mut World, body: Entity) {
        let bits = self.rng.random_range(0..8u32);
        let mask = if self.rng.random_bool(0.5) { u32::MAX } else { self.rng.random_range(0..8) };
        world.entity_mut(body).insert(CollisionLayers::new(LayerMask(bits), LayerMask(mask)));
    }

    fn set_body(&mut self, world: &mut World, body: Entity) {
        match self.rng.random_range(0..9) {
            8 => world.entity_mut(body).remove::<RigidBody>(),
            body_kind => world.entity_mut(body).insert(kind(body_kind.min(6))),
        };
    }

    /// Two bodies that stay dynamic, and a joint between them. (Avian panics if the bodies of a joint become static.)
    fn join(&mut self, world: &mut World) {
        let ends = [self.place(), self.place()]
            .map(|place| world.spawn((RigidBody::Dynamic, GravityScale(0.0), collider(1.0), place)).id());
        let joint = spawn_joint(world, ends, true);
        self.joints.push((joint, ends));
    }

    fn change_joint(&mut self, world: &mut World) {
        let i = self.rng.random_range(0..self.joints.len());
        let (joint, ends) = self.joints[i];
        let place = self.place();
        world.entity_mut(ends[0]).insert(place);
        world.entity_mut(ends[1]).insert(place.with_translation(place.translation + Vec3::X * 0.5));
        match self.rng.random_range(0..3) {
            0 => {
                world.despawn(joint);
                self.joints[i].0 = spawn_joint(world, ends, self.rng.random_bool(0.5));
            }
            1 => toggle(world, joint, JointDisabled),
            _ => {}
        }
    }

    fn change_collider(&mut self, world: &mut World, body: Entity) {
        let size = self.rng.random_range(0.2..1.5);
        world.entity_mut(body).insert(collider(size));
    }

    /// Removes the collider, or inserts one again.
    fn swap_collider(&mut self, world: &mut World, body: Entity) {
        if world.get::<Collider>(body).is_some() {
            world.entity_mut(body).remove::<Collider>();
        } else {
            world.entity_mut(body).insert(collider(0.7));
        }
    }
}

fn spawn_joint(world: &mut World, [one, other]: [Entity; 2], has_no_collisions: bool) -> Entity {
    let mut joint = world.spawn(DistanceJoint::new(one, other).with_limits(0.0, 1000.0));
    if has_no_collisions {
        joint.insert(JointCollisionDisabled);
    }
    joint.id()
}

fn toggle<C: Component + Clone>(world: &mut World, entity: Entity, component: C) {
    let mut entity = world.entity_mut(entity);
    if entity.contains::<C>() {
        entity.remove::<C>();
    } else {
        entity.insert(component);
    }
}

fn kind(number: u32) -> RigidBody {
    match number {
        0 | 1 => RigidBody::Static,
        2 => RigidBody::Kinematic,
        _ => RigidBody::Dynamic,
    }
}

/// Makes a ball, the collider that two and three dimensions share.
pub(crate) fn collider(diameter: f32) -> Collider {
    avian::parry::shape::SharedShape::ball(diameter / 2.0).into()
}
