//! Builds the world of a plan on rapier 0.27.

use crate::plan::{Body, BodyKind, Collider, Joint, JointKind, Plan, Shape};
use crate::world::{World, pose, to_point, to_vector, turned};
use rapier3d::prelude::*;

impl World {
    /// Builds the world of a plan.
    pub fn of(plan: &Plan) -> Self {
        let mut world = Self::with_gravity(plan.gravity);
        let bodies: Vec<_> = plan.bodies.iter().map(|body| world.bodies.insert(rigid_body(body))).collect();
        for part in &plan.colliders {
            match part.body {
                Some(body) => {
                    _ = world.colliders.insert_with_parent(collider(part), bodies[body], &mut world.bodies)
                }
                None => _ = world.colliders.insert(collider(part)),
            }
        }
        for part in &plan.joints {
            let [one, other] = part.bodies.map(|body| bodies[body]);
            world.impulse_joints.insert(one, other, joint(part), true);
        }
        world
    }
}

fn rigid_body(body: &Body) -> RigidBodyBuilder {
    let built = match body.kind {
        BodyKind::Dynamic => RigidBodyBuilder::dynamic(),
        BodyKind::Fixed => RigidBodyBuilder::fixed(),
        BodyKind::Kinematic => RigidBodyBuilder::kinematic_velocity_based(),
    };
    built
        .position(turned(body.at, body.turn))
        .linvel(to_vector(body.linvel))
        .angvel(to_vector(body.angvel))
        .can_sleep(body.can_sleep)
        .sleeping(body.is_sleeping)
        .ccd_enabled(body.has_ccd)
        .soft_ccd_prediction(body.soft_ccd)
}

fn collider(part: &Collider) -> ColliderBuilder {
    let mut built =
        ColliderBuilder::new(shape(&part.shape)).position(turned(part.at, part.turn)).sensor(part.is_sensor);
    if let Some(friction) = part.friction {
        built = built.friction(friction);
    }
    if let Some(restitution) = part.restitution {
        built = built.restitution(restitution);
    }
    if part.sees_fixed {
        built =
            built.active_collision_types(ActiveCollisionTypes::default() | ActiveCollisionTypes::FIXED_FIXED);
    }
    if let Some([own, met]) = part.groups.map(|groups| groups.map(Group::from_bits_truncate)) {
        built = built.collision_groups(InteractionGroups::new(own, met));
    }
    built
}

fn shape(shape: &Shape) -> SharedShape {
    match shape {
        Shape::HalfSpace => SharedShape::halfspace(Vector::y_axis()),
        Shape::Ball(radius) => SharedShape::ball(*radius),
        Shape::Cuboid(half) => SharedShape::cuboid(half.x, half.y, half.z),
        Shape::Capsule(half, radius) => SharedShape::capsule(to_point(-*half), to_point(*half), *radius),
        Shape::Heights(side, heights, scale) => {
            SharedShape::heightfield(DMatrix::from_column_slice(*side, *side, heights), to_vector(*scale))
        }
        Shape::Compound(parts) => {
            SharedShape::compound(parts.iter().map(|(at, part)| (pose(*at), self::shape(part))).collect())
        }
    }
}

fn joint(part: &Joint) -> GenericJoint {
    let [one, other] = part.anchors.map(to_point);
    let mut built: GenericJoint = match part.kind {
        JointKind::Socket(most) => {
            let axes = [JointAxis::AngX, JointAxis::AngY, JointAxis::AngZ].into_iter();
            axes.fold(SphericalJointBuilder::new(), |joint, axis| joint.limits(axis, [-most, most])).into()
        }
        JointKind::Hinge(axis, limits) => {
            RevoluteJointBuilder::new(UnitVector::new_unchecked(to_vector(axis))).limits(limits).into()
        }
        JointKind::Pull(pull) => {
            let axes = [JointAxis::LinX, JointAxis::LinY, JointAxis::LinZ].into_iter();
            let free = GenericJointBuilder::new(JointAxesMask::empty());
            axes.fold(free, |joint, axis| {
                joint.motor_model(axis, MotorModel::AccelerationBased).motor_position(axis, 0.0, pull, 0.0)
            })
            .into()
        }
    };
    built.set_local_anchor1(one).set_local_anchor2(other).set_contacts_enabled(part.has_contacts);
    built
}
