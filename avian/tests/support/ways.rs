//! Ways in which a collider appears, changes or goes.

use super::{Number, collider};
use avian::collider_tree::update_moved_collider_aabbs;
use avian::collision::collider::EnlargedAabb;
use avian::prelude::*;
use bevy::ecs::entity_disabling::Disabled;
use bevy::prelude::*;

/// The kinds of targets at first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Kind {
    /// A collider without a body.
    Alone,
    /// A collider whose `ColliderOf` names an entity that is no body.
    OfNobody,
    Body(RigidBody),
    ChildOf(RigidBody),
}

/// The entities of a lane.
#[derive(Clone, Copy)]
pub(crate) struct Lane {
    pub(crate) kind: Kind,
    /// The collider that changes.
    pub(crate) target: Entity,
    /// The parent of a child, or the target.
    pub(crate) body: Entity,
    /// A kinematic body that overlaps the target, and rests.
    pub(crate) resting: Entity,
    /// An entity that is no body.
    pub(crate) nobody: Entity,
    /// The place along the second axis.
    pub(crate) y: f32,
    /// Numbers from this one on are the lane's.
    pub(crate) number: u32,
}

pub(crate) type Change = fn(&mut World, Lane);

/// A name, and what happens to the target: at first, and twice within a step.
pub(crate) type Way = (&'static str, [Change; 3]);

const fn way(name: &'static str, before: Change, change: Change, again: Change) -> Way {
    (name, [before, change, again])
}

/// Ways of the collider itself.
pub(crate) const OF_COLLIDERS: &[Way] = &[
    way("nothing", NOTHING, NOTHING, NOTHING),
    way("inserted", REMOVE, INSERT, REMOVE),
    way("removed", NOTHING, REMOVE, INSERT),
    way("replaced", NOTHING, LARGER, INSERT),
    way("removed and inserted at once", NOTHING, |w, l| both(w, l, REMOVE, LARGER), NOTHING),
    way("inserted and removed at once", REMOVE, |w, l| both(w, l, INSERT, REMOVE), INSERT),
    way("despawned", NOTHING, DESPAWN, SPAWN),
    way("replaced by another entity", NOTHING, |w, l| both(w, l, DESPAWN, SPAWN), NOTHING),
    way("cloned", NOTHING, CLONE, DESPAWN),
    way("constructed", REMOVE, CONSTRUCT, NOTHING),
    way("marker removed", NOTHING, |w, l| remove::<ColliderMarker>(w, l.target), LARGER),
    way("disabled", NOTHING, DISABLE, ENABLE),
    way("enabled", DISABLE, ENABLE, DISABLE),
    way("disabled twice", NOTHING, |w, l| both(w, l, DISABLE, DISABLE), ENABLE),
    way("enabled, and disabled twice", DISABLE, DISABLE, ENABLE),
    way("disabled and replaced", DISABLE, LARGER, ENABLE),
    way("entity disabled", NOTHING, HIDE, SHOW),
    way("entity enabled", HIDE, SHOW, HIDE),
    way("enabled without a collider", |w, l| both(w, l, REMOVE, DISABLE), ENABLE, INSERT),
    way("written", NOTHING, |w, l| shift::<Collider>(w, l, |old| *old = collider(1.5)), INSERT),
    way("scaled", NOTHING, |w, l| shift::<Transform>(w, l, |old| old.scale = Vec3::splat(1.5)), LARGER),
    way("inserted into a disabled entity", |w, l| both(w, l, REMOVE, HIDE), INSERT, SHOW),
];

/// Ways of what belongs to a collider.
pub(crate) const OF_PARTS: &[Way] = &[
    way("no layers", NOTHING, NO_LAYERS, ALL_LAYERS),
    way("all layers", NO_LAYERS, ALL_LAYERS, NO_LAYERS),
    way("layers removed", NO_LAYERS, |w, l| remove::<CollisionLayers>(w, l.target), LARGER),
    way("layers of a disabled one", DISABLE, NO_LAYERS, ENABLE),
    way("sensor", NOTHING, SENSE, UNSENSE),
    way("no sensor", SENSE, UNSENSE, SENSE),
    way(
        "sensor of a disabled one",
        |w, l| both(w, l, DISABLE, NO_LAYERS),
        SENSE,
        |w, l| both(w, l, ENABLE, ALL_LAYERS),
    ),
    way("margin", NOTHING, |w, l| insert(w, l.target, CollisionMargin(0.5)), LARGER),
    way("hooks", NOTHING, HOOK, LARGER),
    way("hooks at first", HOOK, |w, l| insert(w, l.target, ActiveCollisionHooks::empty()), LARGER),
    way("events", NOTHING, |w, l| insert(w, l.target, CollisionEventsEnabled), LARGER),
    way("jump", NOTHING, JUMP, JUMP_BACK),
    way("jump of a transform", NOTHING, JUMP_TRANSFORM, JUMP_BACK),
    way("jump and replaced", NOTHING, |w, l| both(w, l, JUMP, LARGER), JUMP_BACK),
    way("AABB written", NOTHING, |w, l| both(w, l, WRITE_AABB, INSERT), JUMP_BACK),
];

/// Ways in which the AABBs of all colliders change.
pub(crate) const OF_ALL_AABBS: &[Way] =
    &[way("jump and AABBs at once", NOTHING, |w, l| both(w, l, JUMP, UPDATE_AABBS), JUMP_BACK)];

/// Ways of the body of a collider, and of the hierarchy.
pub(crate) const OF_BODIES: &[Way] = &[
    way("static", NOTHING, |w, l| insert(w, l.body, RigidBody::Static), KINEMATIC),
    way("kinematic", NOTHING, KINEMATIC, |w, l| insert(w, l.body, RigidBody::Static)),
    way("dynamic", NOTHING, DYNAMIC, KINEMATIC),
    way("no body", NOTHING, |w, l| remove::<RigidBody>(w, l.body), KINEMATIC),
    way("body and collider", REMOVE, |w, l| both(w, l, KINEMATIC, INSERT), REMOVE),
    way("body disabled", NOTHING, |w, l| insert(w, l.body, RigidBodyDisabled), BODY_ENABLE),
    way("body enabled", |w, l| insert(w, l.body, RigidBodyDisabled), BODY_ENABLE, NOTHING),
    way(
        "body's entity disabled",
        NOTHING,
        |w, l| insert(w, l.body, Disabled),
        |w, l| remove::<Disabled>(w, l.body),
    ),
    way("asleep", NOTHING, |w, l| insert(w, l.body, Sleeping), |w, l| remove::<Sleeping>(w, l.body)),
    way("body despawned", NOTHING, |w, l| _ = w.despawn(l.body), SPAWN),
    way("speculative", NOTHING, |w, l| insert(w, l.body, SpeculativeCcd::default()), JUMP),
    way("another's", NOTHING, OF_RESTING, NO_OWNER),
    way("nobody's", NOTHING, OF_NOBODY_IF_ALONE, NO_OWNER),
    way("nobody's, then inserted", REMOVE, OF_NOBODY_IF_ALONE, INSERT),
    way("nobody's for a step", OF_NOBODY, NO_OWNER, OF_NOBODY),
    way("nobody's that is despawned", OF_NOBODY, |w, l| _ = w.despawn(l.nobody), LARGER),
    way("nobody's that becomes a body", OF_NOBODY, ADOPT, LARGER),
    way(
        "nobody's that is a body when the collider is replaced",
        OF_NOBODY,
        |w, l| both(w, l, ADOPT, LARGER),
        NO_OWNER,
    ),
    way("orphan", NOTHING, |w, l| remove::<ChildOf>(w, l.target), CHILD),
    way("child", NOTHING, CHILD, |w, l| remove::<ChildOf>(w, l.target)),
    way("child that appears", REMOVE, |w, l| both(w, l, CHILD, INSERT), REMOVE),
    way("joint", NOTHING, JOIN, |w, l| remove::<JointCollisionDisabled>(w, l.nobody)),
    way("joint first", |w, l| both(w, l, REMOVE, JOIN), INSERT, |w, l| remove::<DistanceJoint>(w, l.nobody)),
];

const NOTHING: Change = |_, _| {};
const INSERT: Change = |world, lane| insert(world, lane.target, collider(1.0));
const LARGER: Change = |world, lane| insert(world, lane.target, collider(1.5));
const REMOVE: Change = |world, lane| remove::<Collider>(world, lane.target);
const DESPAWN: Change = |world, lane| _ = world.despawn(lane.target);
const SPAWN: Change = |world, lane| _ = spawn(world, lane.kind, lane.nobody, lane.y, lane.number + 7);
const CLONE: Change = |world, lane| {
    let clone = world.entity_mut(lane.target).clone_and_spawn();
    insert(world, clone, Number(lane.number + 8));
};
const CONSTRUCT: Change = |world, lane| {
    insert(world, lane.target, ColliderConstructor::Capsule { radius: 0.3, height: 0.4 });
};
const DISABLE: Change = |world, lane| insert(world, lane.target, ColliderDisabled);
const ENABLE: Change = |world, lane| remove::<ColliderDisabled>(world, lane.target);
const HIDE: Change = |world, lane| insert(world, lane.target, Disabled);
const SHOW: Change = |world, lane| remove::<Disabled>(world, lane.target);
const NO_LAYERS: Change =
    |world, lane| insert(world, lane.target, CollisionLayers::new(LayerMask::NONE, LayerMask::NONE));
const ALL_LAYERS: Change =
    |world, lane| insert(world, lane.target, CollisionLayers::new(LayerMask::ALL, LayerMask::ALL));
const SENSE: Change = |world, lane| insert(world, lane.target, Sensor);
const UNSENSE: Change = |world, lane| remove::<Sensor>(world, lane.target);
const HOOK: Change = |world, lane| insert(world, lane.target, ActiveCollisionHooks::FILTER_PAIRS);
const JUMP: Change = |world, lane| shift::<Position>(world, lane, |position| position.x += 0.4);
const JUMP_BACK: Change = |world, lane| shift::<Position>(world, lane, |position| position.x -= 0.4);
const JUMP_TRANSFORM: Change =
    |world, lane| shift::<Transform>(world, lane, |transform| transform.translation.x += 0.4);
const UPDATE_AABBS: Change =
    |world, _| world.run_system_cached(update_moved_collider_aabbs::<Collider>).expect("it runs");
const WRITE_AABB: Change = |world, lane| {
    shift::<EnlargedAabb>(world, lane, |aabb| {
        let mut large = aabb.get();
        large.min.x -= 0.4;
        *aabb = EnlargedAabb::new(large);
    });
};
const KINEMATIC: Change = |world, lane| insert(world, lane.body, RigidBody::Kinematic);
const DYNAMIC: Change = |world, lane| insert(world, lane.body, dynamic());
const BODY_ENABLE: Change = |world, lane| remove::<RigidBodyDisabled>(world, lane.body);
const CHILD: Change = |world, lane| insert(world, lane.target, ChildOf(lane.resting));
const OF_RESTING: Change = |world, lane| insert(world, lane.target, ColliderOf { body: lane.resting });
const OF_NOBODY: Change = |world, lane| insert(world, lane.target, ColliderOf { body: lane.nobody });
/// Avian panics if a contact of two bodies loses one of them like this.
const OF_NOBODY_IF_ALONE: Change = |world, lane| {
    if matches!(lane.kind, Kind::Alone | Kind::OfNobody) {
        OF_NOBODY(world, lane);
    }
};
const NO_OWNER: Change = |world, lane| remove::<ColliderOf>(world, lane.target);
const ADOPT: Change = |world, lane| insert(world, lane.nobody, RigidBody::Kinematic);
const JOIN: Change = |world, lane| {
    let joint = DistanceJoint::new(lane.body, lane.resting).with_limits(0.0, 1000.0);
    insert(world, lane.nobody, (joint, JointCollisionDisabled));
};

fn both(world: &mut World, lane: Lane, one: Change, other: Change) {
    one(world, lane);
    other(world, lane);
}

fn insert(world: &mut World, entity: Entity, bundle: impl Bundle) {
    if let Ok(mut entity) = world.get_entity_mut(entity) {
        entity.insert(bundle);
    }
}

fn remove<B: Bundle>(world: &mut World, entity: Entity) {
    if let Ok(mut entity) = world.get_entity_mut(entity) {
        entity.remove::<B>();
    }
}

fn shift<C: Component<Mutability = bevy::ecs::component::Mutable>>(
    world: &mut World,
    lane: Lane,
    edit: fn(&mut C),
) {
    if let Some(mut component) = world.get_mut::<C>(lane.target) {
        edit(&mut component);
    }
}

/// A dynamic body that stays in its place: what the solver does depends on the order of contacts.
pub(crate) fn dynamic() -> impl Bundle {
    (RigidBody::Dynamic, LockedAxes::ALL_LOCKED, GravityScale(0.0))
}

/// Spawns a target. Returns it and its body, or itself.
pub(crate) fn spawn(world: &mut World, kind: Kind, nobody: Entity, y: f32, number: u32) -> [Entity; 2] {
    let place = Transform::from_xyz(0.0, y, 0.0);
    let target = world.spawn((collider(1.0), Number(number), place)).id();
    let add_body = |world: &mut World, entity, body| match body {
        RigidBody::Dynamic => insert(world, entity, dynamic()),
        _ => insert(world, entity, body),
    };
    let body = match kind {
        Kind::ChildOf(_) => world.spawn((Number(number + 1), place)).id(),
        _ => target,
    };
    match kind {
        Kind::Alone => {}
        Kind::OfNobody => insert(world, target, ColliderOf { body: nobody }),
        Kind::Body(kind) => add_body(world, target, kind),
        Kind::ChildOf(kind) => {
            add_body(world, body, kind);
            insert(world, target, (ChildOf(body), Transform::default()));
        }
    }
    [target, body]
}
