//! Random worlds: bodies and colliders that come, move, change and go, between steps and within them.

use super::places::{Place, add_places};
use super::{DIMENSIONS, Divisor, Number, collider};
use avian::math::RVector;
use avian::prelude::*;
use bevy::prelude::*;
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

/// A random world.
#[derive(Resource)]
pub(crate) struct RandomWorld {
    rng: StdRng,
    plan: Plan,
    entities: Entities,
    /// Changes that were made within steps.
    pub(crate) changes_within: usize,
    /// The next event is the first one of a step.
    is_event_awaited: bool,
    /// Only colliders without a body change.
    spares_bodies: bool,
}

#[derive(Default)]
struct Entities {
    /// Bodies, and colliders without one.
    bodies: Vec<Entity>,
    /// Sensors that are or were children of bodies.
    children: Vec<Entity>,
    joints: Vec<(Entity, [Entity; 2])>,
    /// Entities that `ColliderOf` names although they are no bodies.
    owners: Vec<Entity>,
    spawned: u32,
}

/// The size of a random world, and what happens in it.
#[derive(Clone, Copy)]
pub(crate) struct Plan {
    pub(crate) seed: u64,
    pub(crate) bodies: usize,
    pub(crate) steps: usize,
    /// Dynamic bodies stay in their places: what the solver does depends on the order of contacts.
    pub(crate) is_locked: bool,
    pub(crate) has_changes_within: bool,
}

impl Plan {
    /// Adds the world to an app.
    pub(crate) fn add_to(self, app: &mut App) {
        let random = RandomWorld::new(self, app.world_mut());
        app.insert_resource(random);
        if self.is_locked {
            // Which islands sleep depends on the order of contacts, too.
            app.insert_resource(TimeToSleep(f32::MAX));
        }
        if self.has_changes_within {
            add_places(app, RandomWorld::change_within);
        }
    }

    /// Makes the changes before a step.
    pub(crate) fn change(self, app: &mut App, step: usize) {
        // Quiet steps let bodies come to rest.
        let changes = if step % 4 == 3 { 0 } else { self.bodies / 20 + 1 };
        app.world_mut().resource_scope(|world, mut random: Mut<RandomWorld>| {
            (0..changes).for_each(|_| random.change(world));
            world.resource_mut::<Divisor>().0 = random.rng.random_range(0..6);
            random.is_event_awaited = true;
        });
    }

    /// Adds the world to an app, and runs all steps.
    pub(crate) fn run(self, app: &mut App) {
        self.add_to(app);
        for step in 0..self.steps {
            self.change(app, step);
            app.update();
        }
    }
}

impl RandomWorld {
    fn new(plan: Plan, world: &mut World) -> Self {
        let rng = StdRng::seed_from_u64(plan.seed);
        let mut random = Self {
            rng,
            plan,
            entities: Entities::default(),
            changes_within: 0,
            is_event_awaited: false,
            spares_bodies: false,
        };
        (0..4).for_each(|_| random.spawn_owner(world));
        (0..plan.bodies).for_each(|_| random.spawn(world));
        (0..plan.bodies / 10).for_each(|_| random.join(world));
        random
    }

    /// Makes some changes at a third of all places. One observer in a step makes some: the order of events may differ.
    fn change_within(world: &mut World, place: Place) {
        world.resource_scope(|world, mut random: Mut<Self>| {
            if place == Place::Observer && !std::mem::take(&mut random.is_event_awaited)
                || random.rng.random_bool(0.7)
            {
                return;
            }
            // Avian's solver panics if contacts of bodies go after its narrow phase.
            random.spares_bodies = matches!(place, Place::AfterPairs | Place::NarrowPhase | Place::Solver);
            let changes = random.plan.bodies / 60 + 1;
            (0..changes).for_each(|_| random.change(world));
            random.changes_within += changes;
            random.spares_bodies = false;
        });
    }

    fn change(&mut self, world: &mut World) {
        let i = self.rng.random_range(0..self.entities.bodies.len());
        let body = self.entities.bodies[i];
        if self.spares_bodies && world.entity(body).contains::<RigidBody>() {
            return;
        }
        match self.rng.random_range(0..22) {
            0 => {
                world.despawn(self.entities.bodies.swap_remove(i));
                self.spawn(world);
            }
            1 => toggle(world, body, RigidBodyDisabled),
            2 if world.entity(body).contains::<Collider>() => toggle(world, body, ColliderDisabled),
            3 => toggle(world, body, Sensor),
            4 => self.set_layers(world, body),
            5 if !self.spares_bodies => self.set_body(world, body),
            6 | 7 if !self.spares_bodies => self.change_joint(world),
            8 => self.replace_collider(world, body),
            9 => toggle(world, body, ActiveCollisionHooks::FILTER_PAIRS),
            10 | 11 => toggle_collider(world, body),
            12 | 13 => self.set_owner(world, body),
            14 => self.replace_owner(world),
            15 | 16 if !self.spares_bodies => self.change_child(world),
            _ => self.jump(world, body),
        }
    }

    fn place(&mut self) -> Transform {
        let width = (self.plan.bodies as f32).powf(1.0 / DIMENSIONS) * 1.5;
        let mut one = || self.rng.random_range(0.0..width);
        Transform::from_xyz(one(), one(), one())
    }

    fn number(&mut self) -> Number {
        self.entities.spawned += 1;
        Number(self.entities.spawned)
    }

    fn spawn_owner(&mut self, world: &mut World) {
        let bundle = (self.place(), self.number());
        self.entities.owners.push(world.spawn(bundle).id());
    }

    fn spawn(&mut self, world: &mut World) {
        let bundle = (collider(self.rng.random_range(0.2..1.2)), self.place(), self.number());
        let entity = world.spawn(bundle).id();
        self.entities.bodies.push(entity);
        let mut parts = [0.1, 0.3, 0.3, 0.2].map(|share| self.rng.random_bool(share)).into_iter();
        let mut has = || parts.next() == Some(true);
        if has() {
            world.entity_mut(entity).insert(Sensor);
        }
        if has() {
            world.entity_mut(entity).insert(ActiveCollisionHooks::FILTER_PAIRS);
        }
        if has() {
            world.entity_mut(entity).insert(CollisionEventsEnabled);
        }
        if has() {
            self.spawn_child(world, entity);
        }
        self.set_body(world, entity);
    }

    fn spawn_child(&mut self, world: &mut World, parent: Entity) {
        // Avian panics if a collider with constraints gets another body.
        let child = (collider(0.5), Sensor, Transform::from_xyz(0.7, 0.0, 0.0));
        let child = world.spawn((child, ChildOf(parent), self.number())).id();
        self.entities.children.push(child);
    }

    fn jump(&mut self, world: &mut World, body: Entity) {
        let (place, speed) = (self.place(), self.rng.random_range(-5.0..5.0));
        world.entity_mut(body).insert((place, LinearVelocity(RVector::X * speed)));
    }

    fn set_layers(&mut self, world: &mut World, body: Entity) {
        let bits = self.rng.random_range(0..8u32);
        let mask = if self.rng.random_bool(0.5) { u32::MAX } else { self.rng.random_range(0..8) };
        world.entity_mut(body).insert(CollisionLayers::new(LayerMask(bits), LayerMask(mask)));
    }

    fn set_body(&mut self, world: &mut World, body: Entity) {
        if is_loose(world, body) {
            return;
        }
        let kinds = [RigidBody::Static, RigidBody::Static, RigidBody::Kinematic];
        let number = self.rng.random_range(0..9);
        if number > 6 {
            world.entity_mut(body).remove::<RigidBody>();
            return;
        }
        let kind = kinds.get(number).copied().unwrap_or(RigidBody::Dynamic);
        let locked = if self.plan.is_locked { LockedAxes::ALL_LOCKED } else { LockedAxes::default() };
        world.entity_mut(body).insert((kind, GravityScale(0.0), locked));
    }

    /// Two bodies that stay dynamic, and a joint between them. (Avian panics if the bodies of a joint become static.)
    fn join(&mut self, world: &mut World) {
        let locked = if self.plan.is_locked { LockedAxes::ALL_LOCKED } else { LockedAxes::default() };
        let ends = [(); 2].map(|()| {
            let body = (RigidBody::Dynamic, GravityScale(0.0), locked);
            world.spawn((body, collider(1.0), self.place(), self.number())).id()
        });
        let joint = spawn_joint(world, ends, true);
        self.entities.joints.push((joint, ends));
    }

    fn change_joint(&mut self, world: &mut World) {
        let i = self.rng.random_range(0..self.entities.joints.len());
        let (joint, ends) = self.entities.joints[i];
        let place = self.place();
        world.entity_mut(ends[0]).insert(place);
        world.entity_mut(ends[1]).insert(place.with_translation(place.translation + Vec3::X * 0.5));
        match self.rng.random_range(0..3) {
            0 => {
                world.despawn(joint);
                self.entities.joints[i].0 = spawn_joint(world, ends, self.rng.random_bool(0.5));
            }
            1 => toggle(world, joint, JointDisabled),
            _ => {}
        }
    }

    fn replace_collider(&mut self, world: &mut World, body: Entity) {
        let size = self.rng.random_range(0.2..1.5);
        world.entity_mut(body).insert(collider(size));
    }

    /// Gives a loose collider an owner, or takes it away.
    fn set_owner(&mut self, world: &mut World, collider: Entity) {
        let owner = self.entities.owners[self.rng.random_range(0..self.entities.owners.len())];
        if !is_loose(world, collider) || !world.entity(collider).contains::<Collider>() {
            return;
        }
        if self.rng.random_bool(0.3) {
            world.entity_mut(collider).remove::<ColliderOf>();
        } else {
            world.entity_mut(collider).insert(ColliderOf { body: owner });
        }
    }

    /// Replaces an owner, whose colliders go on to name it.
    fn replace_owner(&mut self, world: &mut World) {
        let i = self.rng.random_range(0..self.entities.owners.len());
        world.despawn(self.entities.owners.swap_remove(i));
        self.spawn_owner(world);
    }

    /// A child leaves its body, comes to another one, or is replaced by another one.
    fn change_child(&mut self, world: &mut World) {
        let body = self.entities.bodies[self.rng.random_range(0..self.entities.bodies.len())];
        let i = self.rng.random_range(0..self.entities.children.len());
        let (child, change) = (self.entities.children[i], self.rng.random_range(0..4));
        if change == 0 || world.get_entity(child).is_err() {
            world.try_despawn(child).ok();
            self.entities.children.swap_remove(i);
            return self.spawn_child(world, body);
        }
        match change {
            1 => _ = world.entity_mut(child).remove::<ChildOf>(),
            2 => _ = world.entity_mut(child).insert(ChildOf(body)),
            _ => toggle_collider(world, child),
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

/// Returns true if a collider may have an owner that is no body, but never a body: avian's contacts would go on to name the owner,
/// and panic.
fn is_loose(world: &World, collider: Entity) -> bool {
    world.get::<Number>(collider).is_some_and(|number| number.0.is_multiple_of(5))
}

/// Removes the collider, or inserts one again. Avian keeps the proxies of some entities that are despawned without a collider:
/// of disabled ones, and of those that got an owner since they have none.
fn toggle_collider(world: &mut World, entity: Entity) {
    if !world.entity(entity).contains::<ColliderDisabled>() {
        toggle(world, entity, collider(0.7));
    }
}

fn toggle<C: Component + Clone>(world: &mut World, entity: Entity, component: C) {
    let mut entity = world.entity_mut(entity);
    if entity.contains::<C>() {
        entity.remove::<C>();
    } else {
        entity.insert(component);
    }
}
