//! Bodies of joined limbs.

use super::Builder;
use crate::world::{World, to_point, to_vector};
use glam::Vec3;
use rapier3d::prelude::*;

/// Figures of eleven capsules: trunk, head, hips, and two to each limb.
pub(super) fn ragdolls(b: &mut Builder, n: usize) {
    b.ground();
    let side = (n as f32 / 11.0).sqrt().ceil() as usize;
    for i in 0..n.div_ceil(11) {
        let at = Vec3::new((i % side) as f32 * 1.5, 2.5 + (i % 3) as f32 * 2.5, (i / side) as f32 * 1.5);
        ragdoll(b, at);
    }
}

fn ragdoll(b: &mut Builder, at: Vec3) {
    let part = |b: &mut Builder, offset: Vec3, half: f32, radius: f32| {
        let body = World::dynamic(at + offset).linvel(to_vector(b.random_vec(Vec3::splat(1.0))));
        b.world.add(body, ColliderBuilder::capsule_y(half, radius))
    };
    let trunk = part(b, Vec3::ZERO, 0.25, 0.18);
    let head = part(b, Vec3::Y * 0.65, 0.03, 0.13);
    join(b, trunk, Vec3::Y * 0.48, head, Vec3::Y * -0.17);
    let hips = part(b, Vec3::Y * -0.55, 0.05, 0.16);
    join(b, trunk, Vec3::Y * -0.4, hips, Vec3::Y * 0.15);
    for side in [-1.0, 1.0] {
        let arm = Vec3::new(0.3 * side, 0.3, 0.0);
        let leg = Vec3::new(0.13 * side, -0.1, 0.0);
        limb(b, at, trunk, arm, [0.14, 0.13], 0.07);
        limb(b, at + Vec3::Y * -0.55, hips, leg, [0.18, 0.18], 0.09);
    }
}

/// Two capsules that hang from a point of a body.
fn limb(b: &mut Builder, at: Vec3, parent: RigidBodyHandle, from: Vec3, halves: [f32; 2], radius: f32) {
    let (mut parent, mut anchor, mut top) = (parent, from, at + from);
    for half in halves {
        let reach = half + radius;
        let shape = ColliderBuilder::capsule_y(half, radius);
        let body = b.world.add(World::dynamic(top - Vec3::Y * reach), shape);
        join(b, parent, anchor, body, Vec3::Y * reach);
        (parent, anchor, top) = (body, Vec3::Y * -reach, top - Vec3::Y * 2.0 * reach);
    }
}

fn join(b: &mut Builder, parent: RigidBodyHandle, at: Vec3, child: RigidBodyHandle, child_at: Vec3) {
    let joint = SphericalJointBuilder::new()
        .local_anchor1(to_point(at))
        .local_anchor2(to_point(child_at))
        .contacts_enabled(false);
    b.world.impulse_joints.insert(parent, child, joint, true);
}
