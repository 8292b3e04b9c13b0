//! Colliders that begin anew in the next update, because avian has changed their proxies or removed their contacts.
//!
//! Avian's trees change at any time. Its list of moved proxies tells which did, but avian clears it at the end of a step, perhaps
//! before pbig has seen it. Avian also removes contacts of AABBs that still overlap, and finds such a pair again when one of its
//! colliders moves. pbig reports a pair once, when it begins. So these colliders begin anew: their boxes are removed and set again,
//! and pbig reports their pairs again. The observers below watch all components that avian's trees, narrow phase and joint graph
//! watch. A collider that begins anew for nothing does no harm.

use crate::boxes::ColliderBoxes;
use avian::collider_tree::{ColliderTrees, MovedProxies};
use avian::dynamics::joints::joint_graph::JointGraph;
use avian::prelude::*;
use bevy::ecs::component::ComponentInfo;
use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::event::{EntityEvent, EventPattern};
use bevy::prelude::*;

/// Components that decide about proxies and contacts, beside colliders. None of them can be written to: users insert and remove
/// them.
type Watched = (
    (Disabled, ColliderDisabled, ColliderMarker, ColliderOf, CollisionLayers, Sensor),
    (RigidBody, RigidBodyDisabled, JointCollisionDisabled),
);

/// Watches colliders of all types. Their plug-ins must be built.
pub(crate) fn add_observers(world: &mut World) {
    let marker = world.register_component::<ColliderMarker>();
    let is_collider =
        |info: &ComponentInfo| info.required_components().iter_direct_ids().any(|id| id == marker);
    let all = world.components().iter_registered();
    let colliders: Vec<_> = all.filter(|(_, info)| is_collider(info)).map(|(id, _)| id).collect();
    world.spawn(Observer::new(note::<Insert<Watched>>).with_components(colliders.clone()));
    world.spawn(Observer::new(note::<Remove<Watched>>).with_components(colliders));
}

/// Notes an entity as a collider, as a body with all its colliders, and as a joint between two bodies.
fn note<E: EventPattern<Event: EntityEvent>>(
    trigger: On<E>,
    joints: Res<JointGraph>,
    bodies: Query<&RigidBodyColliders, Allow<Disabled>>,
    mut boxes: ResMut<ColliderBoxes>,
) {
    let entity = trigger.event_target();
    let joined = joints.bodies_of(entity).into_iter().flatten();
    boxes.lost.insert(entity);
    boxes.lost.extend(bodies.iter_many(joined.chain([entity])).flatten().flatten());
}

/// Notes the colliders that avian lists as moved, if avian has changed the list since the update, because it clears the list next. They
/// begin anew even if their AABBs come back before the next update: the narrow phase may have removed their contacts in between.
pub(crate) fn follow_late(
    trees: Res<ColliderTrees>,
    moved: Res<MovedProxies>,
    mut boxes: ResMut<ColliderBoxes>,
) {
    if moved.last_changed() == boxes.moved_at {
        return;
    }
    let colliders = moved.proxies().iter().filter_map(|key| trees.get_proxy(*key));
    boxes.lost.extend(colliders.map(|proxy| proxy.collider));
}
