//! Colliders whose contacts avian has removed although their AABBs may still overlap.
//!
//! Avian finds such a pair again when one of its colliders moves. pbig reports a pair once, when it begins. So these colliders
//! begin anew: their boxes are removed and set again, and pbig reports their pairs again. The observers below match those of
//! avian's narrow phase, of its joint graph, and of the layers that its narrow phase reads. Colliders that are enabled, or given
//! to another body, are here, too: avian clears its list of moved proxies at the end of a step, perhaps before pbig has seen them.

use avian::dynamics::joints::joint_graph::JointGraph;
use avian::prelude::*;
use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::event::{EntityEvent, EventPattern};
use bevy::prelude::*;
use std::collections::BTreeSet;

/// Colliders that begin anew in the next update.
#[derive(Resource, Default)]
pub(crate) struct Lost(pub(crate) BTreeSet<Entity>);

pub(crate) fn add_observers(app: &mut App) {
    app.add_observer(note_collider::<Add<(Disabled, ColliderDisabled, Sensor)>>)
        .add_observer(
            note_collider::<Remove<(Disabled, ColliderDisabled, ColliderMarker, ColliderOf, Sensor)>>,
        )
        .add_observer(note_collider::<Insert<(ColliderOf, CollisionLayers)>>)
        .add_observer(note_body::<Add<(Disabled, RigidBodyDisabled)>>)
        .add_observer(note_body::<Remove<(RigidBodyDisabled, RigidBody)>>)
        .add_observer(note_body::<Insert<RigidBody>>)
        .add_observer(note_joint);
}

fn note_collider<E: EventPattern<Event: EntityEvent>>(trigger: On<E>, mut lost: ResMut<Lost>) {
    lost.0.insert(trigger.event_target());
}

fn note_body<E: EventPattern<Event: EntityEvent>>(
    trigger: On<E>,
    bodies: Query<&RigidBodyColliders, Allow<Disabled>>,
    mut lost: ResMut<Lost>,
) {
    if let Ok(colliders) = bodies.get(trigger.event_target()) {
        lost.0.extend(colliders.iter());
    }
}

/// Notes the colliders of both bodies when a joint begins to disable their collisions.
fn note_joint(
    trigger: On<Add<JointCollisionDisabled>>,
    joints: Res<JointGraph>,
    bodies: Query<&RigidBodyColliders>,
    mut lost: ResMut<Lost>,
) {
    for body in joints.bodies_of(trigger.entity).into_iter().flatten() {
        if let Ok(colliders) = bodies.get(body) {
            lost.0.extend(colliders.iter());
        }
    }
}
