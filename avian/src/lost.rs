//! Colliders whose contacts avian has removed although their AABBs may still overlap.
//!
//! Avian finds such a pair again when one of its colliders moves. pbig reports a pair once, when it begins. So these colliders
//! begin anew: their boxes are removed and set again, and pbig reports their pairs again. The observers below match those of
//! avian's narrow phase, of its joint graph, and of the layers that its narrow phase reads. Colliders that are enabled, or given
//! to another body, are here, too: avian clears its list of moved proxies at the end of a step, perhaps before pbig has seen them.

use crate::boxes::ColliderBoxes;
use avian::dynamics::joints::joint_graph::JointGraph;
use avian::prelude::*;
use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::event::{EntityEvent, EventPattern};
use bevy::prelude::*;

type Removed = (Disabled, ColliderDisabled, ColliderMarker, ColliderOf, Sensor, RigidBodyDisabled, RigidBody);

pub(crate) fn add_observers(app: &mut App) {
    app.add_observer(note::<Add<(Disabled, ColliderDisabled, Sensor, RigidBodyDisabled)>>)
        .add_observer(note::<Remove<Removed>>)
        .add_observer(note::<Insert<(ColliderOf, CollisionLayers, RigidBody)>>)
        .add_observer(note_joint);
}

/// Notes an entity as a collider, and as a body with all its colliders.
fn note<E: EventPattern<Event: EntityEvent>>(
    trigger: On<E>,
    bodies: Query<&RigidBodyColliders, Allow<Disabled>>,
    mut boxes: ResMut<ColliderBoxes>,
) {
    let entity = trigger.event_target();
    boxes.lost.insert(entity);
    boxes.lost.extend(bodies.get(entity).into_iter().flat_map(|colliders| colliders.iter()));
}

/// Notes the colliders of both bodies when a joint begins to disable their collisions.
fn note_joint(
    trigger: On<Add<JointCollisionDisabled>>,
    joints: Res<JointGraph>,
    bodies: Query<&RigidBodyColliders>,
    mut boxes: ResMut<ColliderBoxes>,
) {
    let both = joints.bodies_of(trigger.entity).into_iter().flatten();
    boxes.lost.extend(bodies.iter_many(both).flatten().flat_map(|colliders| colliders.iter()));
}
