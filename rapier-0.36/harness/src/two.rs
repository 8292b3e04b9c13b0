//! The parts of a world that differ between two and three dimensions: two. A world is what is left of the scene without z.

use crate::world::{real, to_vector};
use glam::{Quat, Vec3};
use pbig_scenes::plan::JointKind;
use rapier::math::{AngVector, Real, Rotation};
use rapier::prelude::*;

/// Returns the rotation around z.
pub fn rotation(turn: Quat) -> Rotation {
    Rotation::from_angle(real(2.0 * turn.z.atan2(turn.w)))
}

pub fn parts(turn: &Rotation) -> [Real; 2] {
    [turn.re, turn.im]
}

pub fn angular(velocity: Vec3) -> AngVector {
    real(velocity.z)
}

/// Returns a rectangle, by half its extents.
pub fn cuboid(half: Vec3) -> SharedShape {
    SharedShape::cuboid(real(half.x), real(half.y))
}

/// Takes the heights along x at the first z.
pub(crate) fn heightfield(side: usize, heights: &[f32], scale: Vec3) -> SharedShape {
    let heights = heights.iter().step_by(side).copied().map(real).collect();
    SharedShape::heightfield(heights, to_vector(scale))
}

/// Returns a square that bends, by half its edge.
pub fn soft_cube(at: Vec3, half: f32) -> SoftBodyBuilder {
    SoftBodyBuilder::grid(to_vector(at), Vector::splat(real(half)), 3, 3)
}

/// Returns a joint. A socket is a hinge.
pub fn joint(kind: JointKind) -> GenericJoint {
    match kind {
        JointKind::Socket(most) => RevoluteJointBuilder::new().limits([-most, most].map(real)).into(),
        JointKind::Hinge(_, limits) => RevoluteJointBuilder::new().limits(limits.map(real)).into(),
        JointKind::Pull(pull) => crate::build::pull(&[JointAxis::LinX, JointAxis::LinY], pull),
    }
}
