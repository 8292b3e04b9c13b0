//! Operations on a small world. Each draws from a seed of its own: so it does something in any world, also when those before it
//! are left out.
//!
//! They stay within what rapier 0.27 itself survives: nothing is attached to a disabled body and no collider
//! enabled on one, and kinematic targets are near.

use pbig_harness::world::World;
use rand::rngs::SmallRng;
use rand::seq::{IndexedRandom, IteratorRandom};
use rand::{RngExt, SeedableRng};
use rapier3d::prelude::*;
use std::fmt;

/// Maximum number of operations in a list; half as many on average.
const MOST_OPS: usize = 160;

/// No more bodies than this, and no more than twice as many colliders.
const MOST_BODIES: usize = 40;

/// One operation.
#[derive(Clone, Copy)]
pub(super) struct Op {
    pub(super) name: &'static str,
    pub(super) act: Act,
    pub(super) seed: u64,
}

/// An operation: the part of the world that changes, and how.
#[derive(Clone, Copy, Debug)]
pub(super) enum Act {
    /// One to three steps.
    Step,
    /// World and broad phase are saved, and it goes on with what was restored.
    Snapshot,
    /// As [`Act::Snapshot`], but with a new broad phase that has never seen the world, and that adopts it or not.
    Fresh,
    World(fn(&mut World, &mut SmallRng)),
    /// Any body.
    Body(fn(&mut RigidBody, &mut SmallRng)),
    /// Any collider.
    Collider(fn(&mut Collider, &mut SmallRng)),
}

impl fmt::Debug for Op {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, seed {}", self.name, self.seed)
    }
}

/// The operations, each with its weight. Failing ones shrink to the first.
const OPS: [(u32, &str, Act); 28] = [
    (28, "step", Act::Step),
    (2, "snapshot", Act::Snapshot),
    (2, "fresh broad phase", Act::Fresh),
    (22, "insert", Act::World(|world, rng| _ = insert(world, rng))),
    (5, "insert a collider alone", Act::World(insert_lone)),
    (6, "attach a collider", Act::World(attach)),
    (2, "insert and remove before any step", Act::World(insert_and_remove)),
    (2, "wake", Act::Body(|body, _| body.wake_up(true))),
    (2, "sleep", Act::Body(|body, _| body.sleep())),
    (4, "teleport", Act::Body(|body, rng| body.set_translation(place(rng), true))),
    (4, "velocity", Act::Body(set_velocity)),
    (3, "kinematic target", Act::Body(set_target)),
    (3, "body type", Act::Body(retype)),
    (2, "enable a body or not", Act::Body(|body, rng| body.set_enabled(rng.random()))),
    (1, "CCD or not", Act::Body(|body, rng| body.enable_ccd(rng.random()))),
    (2, "soft CCD", Act::World(set_soft_ccd)),
    (2, "remove a body", Act::World(remove_body)),
    (2, "sensor or not", Act::Collider(|collider, rng| collider.set_sensor(rng.random()))),
    (2, "shape", Act::Collider(|collider, rng| collider.set_shape(shape(rng).0))),
    (4, "groups", Act::Collider(|collider, rng| collider.set_collision_groups(groups(rng)))),
    (4, "types that meet", Act::Collider(|collider, rng| collider.set_active_collision_types(types(rng)))),
    (1, "skin", Act::Collider(set_skin)),
    (4, "parent", Act::World(reparent)),
    (2, "enable a collider or not", Act::World(enable)),
    (3, "remove a collider", Act::World(remove_collider)),
    (1, "gravity", Act::World(|world, rng| world.gravity = glam::Vec3::from_array(vector(rng, 80).into()))),
    (1, "prediction", Act::World(predict)),
    (1, "length unit", Act::World(measure)),
];

/// Returns the operations of a run.
pub(super) fn any_ops(run: u64) -> Vec<Op> {
    let rng = &mut SmallRng::seed_from_u64(run);
    let any = |rng: &mut SmallRng| {
        let &(_, name, act) = OPS.choose_weighted(rng, |row| row.0).expect("weights above zero");
        Op { name, act, seed: rng.random() }
    };
    (0..rng.random_range(1..MOST_OPS)).map(|_| any(rng)).collect()
}

impl Op {
    pub(super) fn rng(&self) -> SmallRng {
        SmallRng::seed_from_u64(self.seed)
    }

    /// Does it to the world. Steps and the broad phase are the caller's.
    pub(super) fn apply(&self, world: &mut World) {
        let rng = &mut self.rng();
        match self.act {
            Act::World(change) => change(world, rng),
            Act::Body(change) => {
                // Not by `iter_mut`, which marks all bodies as modified.
                let any = any_body(world, rng);
                any.into_iter().for_each(|body| change(&mut world.bodies[body], rng));
            }
            Act::Collider(change) => {
                let any = any_collider(world, rng);
                any.into_iter().for_each(|collider| change(&mut world.colliders[collider], rng));
            }
            Act::Step | Act::Snapshot | Act::Fresh => {}
        }
    }
}

fn any_body(world: &World, rng: &mut SmallRng) -> Option<RigidBodyHandle> {
    world.bodies.iter().map(|(handle, _)| handle).choose(rng)
}

fn any_enabled_body(world: &World, rng: &mut SmallRng) -> Option<RigidBodyHandle> {
    world.bodies.iter().filter(|(_, body)| body.is_enabled()).map(|(handle, _)| handle).choose(rng)
}

fn any_collider(world: &World, rng: &mut SmallRng) -> Option<ColliderHandle> {
    world.colliders.iter().map(|(handle, _)| handle).choose(rng)
}

/// Returns a vector in eighths of a metre.
fn vector(rng: &mut SmallRng, reach: i32) -> Vector<Real> {
    [0; 3].map(|_| rng.random_range(-reach..=reach) as f32 / 8.0).into()
}

/// Returns a place near the others, so that much overlaps, or seldom one where a float's steps are 1/128 m.
fn place(rng: &mut SmallRng) -> Vector<Real> {
    let origin = if rng.random_ratio(3, 50) { vector![1e5, 0.0, -1e5] } else { Vector::zeros() };
    origin + vector(rng, 20)
}

fn kind(rng: &mut SmallRng) -> RigidBodyType {
    use RigidBodyType::{Dynamic, Fixed, KinematicPositionBased, KinematicVelocityBased};
    match rng.random_range(0..10) {
        0 | 1 => Fixed,
        2 => KinematicPositionBased,
        3 => KinematicVelocityBased,
        _ => Dynamic,
    }
}

fn has_room(world: &World) -> bool {
    world.bodies.len() < MOST_BODIES && world.colliders.len() < 2 * MOST_BODIES
}

fn insert(world: &mut World, rng: &mut SmallRng) -> Option<RigidBodyHandle> {
    let (shape, is_flat) = shape(rng);
    // Shapes without a volume make no good dynamic bodies.
    let kind = if is_flat { RigidBodyType::Fixed } else { kind(rng) };
    let body = RigidBodyBuilder::new(kind).translation(place(rng)).rotation(vector(rng, 20) * 0.25);
    has_room(world).then(|| world.add(body, ColliderBuilder::new(shape)))
}

fn insert_lone(world: &mut World, rng: &mut SmallRng) {
    if has_room(world) {
        world.colliders.insert(ColliderBuilder::new(shape(rng).0).translation(place(rng)));
    }
}

fn insert_and_remove(world: &mut World, rng: &mut SmallRng) {
    if let Some(body) = insert(world, rng) {
        world.remove(body);
    }
}

fn attach(world: &mut World, rng: &mut SmallRng) {
    if let Some(body) = any_enabled_body(world, rng).filter(|_| has_room(world)) {
        let collider = ColliderBuilder::new(shape(rng).0).translation(vector(rng, 8));
        world.colliders.insert_with_parent(collider, body, &mut world.bodies);
    }
}

fn set_velocity(body: &mut RigidBody, rng: &mut SmallRng) {
    body.set_linvel(vector(rng, 120), true);
    body.set_angvel(vector(rng, 120), true);
}

fn set_target(body: &mut RigidBody, rng: &mut SmallRng) {
    body.set_next_kinematic_translation(body.translation() + vector(rng, 10));
}

/// Rapier 0.27 loses track of a body that stops being kinematic and is woken by the removal of a collider
/// before the next step, and panics once it is gone. A body whose sleep has been touched is not woken.
fn retype(body: &mut RigidBody, rng: &mut SmallRng) {
    body.set_body_type(kind(rng), true);
    body.activation_mut();
}

/// Touches the colliders, as the prediction of a body at rest would stay in its boxes.
fn set_soft_ccd(world: &mut World, rng: &mut SmallRng) {
    let Some(body) = any_body(world, rng) else { return };
    world.bodies[body].set_soft_ccd_prediction(rng.random_range(0..3) as f32);
    for &collider in world.bodies[body].colliders() {
        touch(&mut world.colliders[collider]);
    }
}

fn remove_body(world: &mut World, rng: &mut SmallRng) {
    any_body(world, rng).into_iter().for_each(|body| world.remove(body));
}

fn remove_collider(world: &mut World, rng: &mut SmallRng) {
    any_collider(world, rng).into_iter().for_each(|collider| world.remove_collider(collider));
}

/// Touches all colliders, as boxes depend on it.
fn predict(world: &mut World, rng: &mut SmallRng) {
    world.params.normalized_prediction_distance = *[0.002, 0.0, 0.05, 0.3].choose(rng).expect("four");
    world.colliders.iter_mut().for_each(|(_, collider)| touch(collider));
}

/// Touches all colliders, as margins depend on it.
fn measure(world: &mut World, rng: &mut SmallRng) {
    world.params.length_unit = *[1.0, 0.3, 4.0].choose(rng).expect("three");
    world.colliders.iter_mut().for_each(|(_, collider)| touch(collider));
}

/// Makes rapier report a change where its setter does not.
fn touch(collider: &mut Collider) {
    collider.set_position(*collider.position());
}

fn set_skin(collider: &mut Collider, rng: &mut SmallRng) {
    collider.set_contact_skin(rng.random_range(0..16) as f32 / 32.0);
    touch(collider);
}

/// Gives a collider to another body, or to none.
fn reparent(world: &mut World, rng: &mut SmallRng) {
    let parent = any_enabled_body(world, rng).filter(|_| rng.random());
    let any = any_collider(world, rng);
    any.into_iter().for_each(|collider| world.colliders.set_parent(collider, parent, &mut world.bodies));
}

fn enable(world: &mut World, rng: &mut SmallRng) {
    let Some(collider) = any_collider(world, rng) else { return };
    let (parent, enabled) = (world.colliders[collider].parent(), rng.random::<bool>());
    if !enabled || parent.is_none_or(|body| world.bodies[body].is_enabled()) {
        world.colliders[collider].set_enabled(enabled);
    }
}

fn groups(rng: &mut SmallRng) -> InteractionGroups {
    let (one, two) = (Group::GROUP_1, Group::GROUP_2);
    match rng.random_range(0..5) {
        0 => InteractionGroups::all(),
        1 => InteractionGroups::none(),
        2 => InteractionGroups::new(one, one),
        3 => InteractionGroups::new(one, two),
        _ => InteractionGroups::new(two, Group::ALL),
    }
}

fn types(rng: &mut SmallRng) -> ActiveCollisionTypes {
    match rng.random_range(0..5) {
        0 => ActiveCollisionTypes::default(),
        1 => ActiveCollisionTypes::all(),
        2 => ActiveCollisionTypes::empty(),
        3 => ActiveCollisionTypes::KINEMATIC_FIXED | ActiveCollisionTypes::KINEMATIC_KINEMATIC,
        _ => ActiveCollisionTypes::FIXED_FIXED,
    }
}

/// Returns a shape, a quarter of a metre to a metre large, and true if it has no volume.
fn shape(rng: &mut SmallRng) -> (SharedShape, bool) {
    let r = rng.random_range(1..=4) as f32 * 0.25;
    let corners = || vec![point![r, r, r], point![-r, -r, r], point![-r, r, -r], point![r, -r, -r]];
    // Faces of a tetrahedron, counter-clockwise from outside.
    let faces = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
    let shape = match rng.random_range(0..34) {
        0 | 1 => return (field(r), true),
        2 | 3 => return (SharedShape::halfspace(Vector::y_axis()), true),
        4..10 => SharedShape::ball(r),
        10..16 => SharedShape::capsule_y(r, 0.5 * r),
        16..21 => SharedShape::cuboid(r, 0.5 * r, 0.75 * r),
        21..26 => compound(r),
        26..30 => SharedShape::convex_hull(&corners()).expect("four corners, not in a plane"),
        _ => SharedShape::trimesh(corners(), faces).expect("the faces of a tetrahedron"),
    };
    (shape, false)
}

fn field(r: f32) -> SharedShape {
    let heights = DMatrix::from_fn(4, 4, |i, j| (i * j % 3) as f32 * 0.25);
    SharedShape::heightfield(heights, vector![4.0 * r, r, 4.0 * r])
}

/// Returns a ball and a cuboid, apart.
fn compound(r: f32) -> SharedShape {
    let (ball, cuboid) = (SharedShape::ball(0.5 * r), SharedShape::cuboid(0.5 * r, r, 0.5 * r));
    let at = |x: f32| Isometry::translation(x, 0.0, 0.0);
    SharedShape::compound(vec![(at(-r), ball), (at(r), cuboid)])
}
