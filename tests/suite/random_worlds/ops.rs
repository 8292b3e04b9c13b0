//! Operations on a small world: what they are, how proptest draws them, and what they do.
//!
//! They stay within what rapier 0.27 itself survives: nothing is attached to a disabled body and no collider
//! enabled on one, and kinematic targets are near.

use pbig_harness::world::World;
use proptest::prelude::{Just, Strategy, any, prop_oneof};
use rapier3d::prelude::*;

/// No more bodies than this, and no more than twice as many colliders.
const MOST_BODIES: usize = 40;

/// One operation. A number means a body or a collider, modulo how many there are: so each operation does
/// something in any world, also when those before it are left out.
#[derive(Clone, Copy, Debug)]
pub(super) enum Op {
    /// This number of steps.
    Step(u8),
    /// World and broad phase are saved, and it goes on with what was restored.
    Snapshot,
    /// As [`Op::Snapshot`], but with a new broad phase that has never seen the world, and that adopts it or not.
    Fresh(bool),
    /// A body with a collider.
    Insert(RigidBodyType, What, Place),
    /// A collider without a body.
    InsertLone(What, Place),
    /// Another collider on a body, in eighths of a metre from its origin.
    Attach(u8, What, [i8; 3]),
    /// A body that is gone again before any step.
    InsertAndRemove(What, Place),
    Body(u8, BodyOp),
    Collider(u8, ColliderOp),
    /// In m/s^2.
    Gravity([i8; 3]),
    /// One of a few prediction distances.
    Prediction(u8),
    /// One of a few length units, in which margins are measured.
    LengthUnit(u8),
}

impl Op {
    /// Returns this operation on each of the first few bodies and colliders.
    pub(super) fn renumbered(self) -> Vec<Self> {
        let few = || 0..6u8;
        match self {
            Self::Attach(_, what, at) => few().map(|n| Self::Attach(n, what, at)).collect(),
            Self::Body(_, op) => few().map(|n| Self::Body(n, op)).collect(),
            Self::Collider(_, ColliderOp::Reparent(Some(_))) => few()
                .flat_map(|n| few().map(move |to| Self::Collider(n, ColliderOp::Reparent(Some(to)))))
                .collect(),
            Self::Collider(_, op) => few().map(|n| Self::Collider(n, op)).collect(),
            _ => vec![],
        }
    }
}

#[derive(Clone, Copy, Debug)]
pub(super) enum BodyOp {
    WakeUp,
    Sleep,
    Teleport(Place),
    /// In 1/8 m/s.
    Velocity([i8; 3]),
    /// Where a kinematic body goes in the next step, in eighths of a metre from where it is.
    Target([i8; 3]),
    Retype(RigidBodyType),
    Enable(bool),
    Ccd(bool),
    /// In metres.
    SoftCcd(u8),
    Remove,
}

#[derive(Clone, Copy, Debug)]
pub(super) enum ColliderOp {
    Sensor(bool),
    Reshape(What),
    /// One of a few pairs of groups.
    Regroup(u8),
    /// One of a few sets of body types that may meet.
    Types(u8),
    /// In units of 1/32 m.
    Skin(u8),
    Reparent(Option<u8>),
    Enable(bool),
    Remove,
}

#[derive(Clone, Copy, Debug)]
pub(super) enum Form {
    Ball,
    Cuboid,
    Capsule,
    /// A ball and a cuboid, apart.
    Compound,
    Convex,
    Mesh,
    Field,
    HalfSpace,
}

/// A shape and its size, in units of 0.25 m.
pub(super) type What = (Form, u8);

/// In eighths of a metre from the origin, or from a place where a float's steps are 1/128 m.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    at: [i8; 3],
    far: bool,
}

impl Place {
    fn vector(self) -> Vector<Real> {
        let origin: Vector<Real> = if self.far { vector![1e5, 0.0, -1e5] } else { Vector::zeros() };
        origin + eighths(self.at)
    }
}

fn eighths(v: [i8; 3]) -> Vector<Real> {
    v.map(|x| f32::from(x) / 8.0).into()
}

/// Any operation. What comes first is what others shrink to.
pub(super) fn any_op() -> impl Strategy<Value = Op> {
    let n = any::<u8>;
    prop_oneof![
        28 => (1..=3u8).prop_map(Op::Step),
        2 => Just(Op::Snapshot),
        2 => any::<bool>().prop_map(Op::Fresh),
        22 => (kind(), what(), place()).prop_map(|(kind, what, place)| Op::Insert(kind, what, place)),
        5 => (what(), place()).prop_map(|(what, place)| Op::InsertLone(what, place)),
        6 => (n(), what(), triple(8)).prop_map(|(n, what, at)| Op::Attach(n, what, at)),
        2 => (what(), place()).prop_map(|(what, place)| Op::InsertAndRemove(what, place)),
        24 => (n(), body_op()).prop_map(|(n, op)| Op::Body(n, op)),
        22 => (n(), collider_op()).prop_map(|(n, op)| Op::Collider(n, op)),
        1 => triple(10).prop_map(Op::Gravity),
        1 => (0..4u8).prop_map(Op::Prediction),
        1 => (0..3u8).prop_map(Op::LengthUnit),
    ]
}

fn body_op() -> impl Strategy<Value = BodyOp> {
    prop_oneof![
        2 => Just(BodyOp::WakeUp),
        2 => Just(BodyOp::Sleep),
        4 => place().prop_map(BodyOp::Teleport),
        4 => triple(120).prop_map(BodyOp::Velocity),
        3 => triple(10).prop_map(BodyOp::Target),
        3 => kind().prop_map(BodyOp::Retype),
        2 => any::<bool>().prop_map(BodyOp::Enable),
        1 => any::<bool>().prop_map(BodyOp::Ccd),
        2 => (0..3u8).prop_map(BodyOp::SoftCcd),
        2 => Just(BodyOp::Remove),
    ]
}

fn collider_op() -> impl Strategy<Value = ColliderOp> {
    prop_oneof![
        2 => any::<bool>().prop_map(ColliderOp::Sensor),
        2 => what().prop_map(ColliderOp::Reshape),
        3 => (0..5u8).prop_map(ColliderOp::Regroup),
        3 => (0..5u8).prop_map(ColliderOp::Types),
        1 => (0..16u8).prop_map(ColliderOp::Skin),
        4 => proptest::option::of(any::<u8>()).prop_map(ColliderOp::Reparent),
        2 => any::<bool>().prop_map(ColliderOp::Enable),
        2 => Just(ColliderOp::Remove),
    ]
}

fn kind() -> impl Strategy<Value = RigidBodyType> {
    prop_oneof![
        6 => Just(RigidBodyType::Dynamic),
        2 => Just(RigidBodyType::Fixed),
        1 => Just(RigidBodyType::KinematicPositionBased),
        1 => Just(RigidBodyType::KinematicVelocityBased),
    ]
}

fn what() -> impl Strategy<Value = What> {
    use Form::{Ball, Capsule, Compound, Convex, Cuboid, Field, HalfSpace, Mesh};
    let round = proptest::sample::select(vec![Ball, Capsule]);
    let edged = proptest::sample::select(vec![Cuboid, Compound, Convex, Mesh]);
    let form = prop_oneof![6 => round, 9 => edged, 1 => Just(Field), 1 => Just(HalfSpace)];
    (form, 1..=4u8)
}

/// Near each other, so that much overlaps; a few far away.
fn place() -> impl Strategy<Value = Place> {
    (triple(20), proptest::bool::weighted(0.06)).prop_map(|(at, far)| Place { at, far })
}

fn triple(reach: i8) -> impl Strategy<Value = [i8; 3]> {
    proptest::array::uniform3(-reach..=reach)
}

/// Does it to the world. Steps and the broad phase are the caller's.
pub(super) fn apply(world: &mut World, op: Op) {
    let room = world.bodies.len() < MOST_BODIES && world.colliders.len() < 2 * MOST_BODIES;
    match op {
        Op::Insert(kind, what, place) if room => _ = insert(world, kind, what, place),
        Op::InsertLone(what, place) if room => {
            world.colliders.insert(ColliderBuilder::new(shape(what)).translation(place.vector()));
        }
        Op::Attach(n, what, at) if room => attach(world, n, what, at),
        Op::InsertAndRemove(what, place) if room => {
            let body = insert(world, RigidBodyType::Dynamic, what, place);
            world.remove(body);
        }
        Op::Body(n, op) => on_body(world, n, op),
        Op::Collider(n, op) => on_collider(world, n, op),
        Op::Gravity(g) => world.gravity = glam::Vec3::from_array(g.map(f32::from)),
        Op::Prediction(n) => predict(world, n),
        Op::LengthUnit(n) => measure(world, n),
        _ => {}
    }
}

fn insert(world: &mut World, kind: RigidBodyType, what: What, place: Place) -> RigidBodyHandle {
    // Shapes without a volume make no good dynamic bodies.
    let flat = matches!(what.0, Form::Field | Form::HalfSpace);
    let kind = if flat { RigidBodyType::Fixed } else { kind };
    let body = RigidBodyBuilder::new(kind).translation(place.vector()).rotation(eighths(place.at) * 0.25);
    world.add(body, ColliderBuilder::new(shape(what)))
}

fn attach(world: &mut World, n: u8, what: What, at: [i8; 3]) {
    let Some(body) = enabled_body(world, n) else { return };
    let collider = ColliderBuilder::new(shape(what)).translation(eighths(at));
    world.colliders.insert_with_parent(collider, body, &mut world.bodies);
}

fn on_body(world: &mut World, n: u8, op: BodyOp) {
    let place = usize::from(n) % world.bodies.len().max(1);
    let Some(handle) = world.bodies.iter().map(|(handle, _)| handle).nth(place) else { return };
    let body = &mut world.bodies[handle];
    match op {
        BodyOp::WakeUp => body.wake_up(true),
        BodyOp::Sleep => body.sleep(),
        BodyOp::Teleport(place) => body.set_translation(place.vector(), true),
        BodyOp::Velocity(v) => set_velocity(body, v),
        BodyOp::Target(by) => body.set_next_kinematic_translation(body.translation() + eighths(by)),
        BodyOp::Retype(kind) => retype(body, kind),
        BodyOp::Enable(enabled) => body.set_enabled(enabled),
        BodyOp::Ccd(enabled) => body.enable_ccd(enabled),
        BodyOp::SoftCcd(metres) => set_soft_ccd(world, handle, metres),
        BodyOp::Remove => world.remove(handle),
    }
}

fn set_velocity(body: &mut RigidBody, [x, y, z]: [i8; 3]) {
    body.set_linvel(eighths([x, y, z]), true);
    body.set_angvel(eighths([z, x, y]), true);
}

/// Rapier 0.27 loses track of a body that stops being kinematic and is woken by the removal of a collider
/// before the next step, and panics once it is gone. A body whose sleep has been touched is not woken.
fn retype(body: &mut RigidBody, kind: RigidBodyType) {
    body.set_body_type(kind, true);
    body.activation_mut();
}

/// Touches the colliders, as the prediction of a body at rest would stay in its boxes.
fn set_soft_ccd(world: &mut World, body: RigidBodyHandle, metres: u8) {
    world.bodies[body].set_soft_ccd_prediction(f32::from(metres));
    for &collider in world.bodies[body].colliders() {
        touch(&mut world.colliders[collider]);
    }
}

/// Touches all colliders, as boxes depend on it.
fn predict(world: &mut World, n: u8) {
    let distances = [0.002, 0.0, 0.05, 0.3];
    world.params.normalized_prediction_distance = distances[usize::from(n) % distances.len()];
    world.colliders.iter_mut().for_each(|(_, collider)| touch(collider));
}

/// Touches all colliders, as margins depend on it.
fn measure(world: &mut World, n: u8) {
    let units = [1.0, 0.3, 4.0];
    world.params.length_unit = units[usize::from(n) % units.len()];
    world.colliders.iter_mut().for_each(|(_, collider)| touch(collider));
}

/// Makes rapier report a change where its setter does not.
fn touch(collider: &mut Collider) {
    collider.set_position(*collider.position());
}

fn on_collider(world: &mut World, n: u8, op: ColliderOp) {
    let place = usize::from(n) % world.colliders.len().max(1);
    let Some(handle) = world.colliders.iter().map(|(handle, _)| handle).nth(place) else { return };
    let collider = &mut world.colliders[handle];
    match op {
        ColliderOp::Sensor(sensor) => collider.set_sensor(sensor),
        ColliderOp::Reshape(what) => collider.set_shape(shape(what)),
        ColliderOp::Regroup(n) => collider.set_collision_groups(groups(n)),
        ColliderOp::Types(n) => collider.set_active_collision_types(types(n)),
        ColliderOp::Skin(thickness) => {
            collider.set_contact_skin(f32::from(thickness) / 32.0);
            touch(collider);
        }
        ColliderOp::Reparent(to) => reparent(world, handle, to),
        ColliderOp::Enable(enabled) => enable(world, handle, enabled),
        ColliderOp::Remove => world.remove_collider(handle),
    }
}

fn reparent(world: &mut World, collider: ColliderHandle, to: Option<u8>) {
    let parent = to.and_then(|n| enabled_body(world, n));
    world.colliders.set_parent(collider, parent, &mut world.bodies);
}

fn enable(world: &mut World, collider: ColliderHandle, enabled: bool) {
    let parent = world.colliders[collider].parent();
    if !enabled || parent.is_none_or(|body| world.bodies[body].is_enabled()) {
        world.colliders[collider].set_enabled(enabled);
    }
}

fn enabled_body(world: &World, n: u8) -> Option<RigidBodyHandle> {
    let enabled: Vec<_> = world.bodies.iter().filter(|(_, body)| body.is_enabled()).collect();
    enabled.get(usize::from(n) % enabled.len().max(1)).map(|(handle, _)| *handle)
}

fn groups(n: u8) -> InteractionGroups {
    let (one, two) = (Group::GROUP_1, Group::GROUP_2);
    match n {
        0 => InteractionGroups::all(),
        1 => InteractionGroups::none(),
        2 => InteractionGroups::new(one, one),
        3 => InteractionGroups::new(one, two),
        _ => InteractionGroups::new(two, Group::ALL),
    }
}

fn types(n: u8) -> ActiveCollisionTypes {
    match n {
        0 => ActiveCollisionTypes::default(),
        1 => ActiveCollisionTypes::all(),
        2 => ActiveCollisionTypes::empty(),
        3 => ActiveCollisionTypes::KINEMATIC_FIXED | ActiveCollisionTypes::KINEMATIC_KINEMATIC,
        _ => ActiveCollisionTypes::FIXED_FIXED,
    }
}

fn shape((form, size): What) -> SharedShape {
    let r = f32::from(size) * 0.25;
    match form {
        Form::Ball => SharedShape::ball(r),
        Form::Cuboid => SharedShape::cuboid(r, 0.5 * r, 0.75 * r),
        Form::Capsule => SharedShape::capsule_y(r, 0.5 * r),
        Form::Compound => compound(r),
        Form::Convex => SharedShape::convex_hull(&corners(r)).expect("four corners, not in a plane"),
        Form::Mesh => SharedShape::trimesh(corners(r), FACES.to_vec()).expect("the faces of a tetrahedron"),
        Form::Field => field(r),
        Form::HalfSpace => SharedShape::halfspace(Vector::y_axis()),
    }
}

/// Faces of a tetrahedron, counter-clockwise from outside.
const FACES: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];

fn corners(r: f32) -> Vec<Point<Real>> {
    vec![point![r, r, r], point![-r, -r, r], point![-r, r, -r], point![r, -r, -r]]
}

fn field(r: f32) -> SharedShape {
    let heights = DMatrix::from_fn(4, 4, |i, j| (i * j % 3) as f32 * 0.25);
    SharedShape::heightfield(heights, vector![4.0 * r, r, 4.0 * r])
}

fn compound(r: f32) -> SharedShape {
    let (ball, cuboid) = (SharedShape::ball(0.5 * r), SharedShape::cuboid(0.5 * r, r, 0.5 * r));
    let at = |x: f32| Isometry::translation(x, 0.0, 0.0);
    SharedShape::compound(vec![(at(-r), ball), (at(r), cuboid)])
}
