//! Builds the world of a plan on rapier 0.36.

use crate::dimension::{angular, cuboid, heightfield, joint};
use crate::world::{pose, real, to_vector, turned};
use pbig_scenes::plan::{Body, BodyKind, Collider, Joint, Plan, Shape};
use rapier::prelude::*;

/// Builds the world of a plan around a broad phase.
pub fn world_of(plan: &Plan, broad_phase: BroadPhaseBvh) -> PhysicsWorld {
    let mut world = crate::world::with(broad_phase);
    world.gravity = to_vector(plan.gravity);
    let bodies: Vec<_> = plan.bodies.iter().map(|body| world.insert_body(rigid_body(body))).collect();
    for part in &plan.colliders {
        world.insert_collider(collider(part), part.body.map(|body| bodies[body]));
    }
    for part in &plan.joints {
        let [one, other] = part.bodies.map(|body| bodies[body]);
        world.impulse_joints.insert(one, other, anchored(part), true);
    }
    world
}

fn rigid_body(body: &Body) -> RigidBodyBuilder {
    let built = match body.kind {
        BodyKind::Dynamic => RigidBodyBuilder::dynamic(),
        BodyKind::Fixed => RigidBodyBuilder::fixed(),
        BodyKind::Kinematic => RigidBodyBuilder::kinematic_velocity_based(),
    };
    built
        .pose(turned(body.at, body.turn))
        .linvel(to_vector(body.linvel))
        .angvel(angular(body.angvel))
        .can_sleep(body.can_sleep)
        .sleeping(body.is_sleeping)
        .ccd_enabled(body.has_ccd)
        .soft_ccd_prediction(real(body.soft_ccd))
}

fn collider(part: &Collider) -> ColliderBuilder {
    let pose = turned(part.at, part.turn);
    let mut built = ColliderBuilder::new(shape(&part.shape)).position(pose).sensor(part.is_sensor);
    if let Some(friction) = part.friction {
        built = built.friction(real(friction));
    }
    if let Some(restitution) = part.restitution {
        built = built.restitution(real(restitution));
    }
    if part.sees_fixed {
        built =
            built.active_collision_types(ActiveCollisionTypes::default() | ActiveCollisionTypes::FIXED_FIXED);
    }
    if let Some([own, met]) = part.groups.map(|groups| groups.map(Group::from_bits_truncate)) {
        built = built.collision_groups(InteractionGroups::new(own, met, InteractionTestMode::And));
    }
    built
}

fn shape(shape: &Shape) -> SharedShape {
    match shape {
        Shape::HalfSpace => SharedShape::halfspace(Vector::Y),
        Shape::Ball(radius) => SharedShape::ball(real(*radius)),
        Shape::Cuboid(half) => cuboid(*half),
        Shape::Capsule(half, radius) => {
            SharedShape::capsule(to_vector(-*half), to_vector(*half), real(*radius))
        }
        Shape::Heights(side, heights, scale) => heightfield(*side, heights, *scale),
        Shape::Compound(parts) => {
            SharedShape::compound(parts.iter().map(|(at, part)| (pose(*at), self::shape(part))).collect())
        }
    }
}

fn anchored(part: &Joint) -> GenericJoint {
    let [one, other] = part.anchors.map(to_vector);
    let mut built = joint(part.kind);
    built.set_local_anchor1(one).set_local_anchor2(other).set_contacts_enabled(part.has_contacts);
    built
}

/// Returns a joint that leaves all motion, and pulls the second body to the first along some axes.
pub(crate) fn pull(axes: &[JointAxis], pull: f32) -> GenericJoint {
    let free = GenericJointBuilder::new(JointAxesMask::empty());
    let pulled = axes.iter().fold(free, |joint, &axis| {
        joint.motor_model(axis, MotorModel::AccelerationBased).motor_position(axis, 0.0, real(pull), 0.0)
    });
    pulled.into()
}
