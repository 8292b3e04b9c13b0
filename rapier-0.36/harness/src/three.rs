//! The parts of a world that differ between two and three dimensions: three.

use crate::world::{real, to_vector};
use glam::{Quat, Vec3};
use pbig_scenes::plan::JointKind;
use rapier::math::{AngVector, Real, Rotation};
use rapier::parry::utils::Array2;
use rapier::prelude::*;

/// Returns a rotation, bit by bit. The builders' own `rotation` takes an angle, of which rapier computes the sine and the cosine
/// as the platform does.
pub fn rotation(turn: Quat) -> Rotation {
    let [x, y, z, w] = turn.to_array().map(real);
    Rotation::from_xyzw(x, y, z, w)
}

pub fn parts(turn: &Rotation) -> [Real; 4] {
    [turn.x, turn.y, turn.z, turn.w]
}

pub fn angular(velocity: Vec3) -> AngVector {
    to_vector(velocity)
}

/// Returns a cuboid, by half its extents.
pub fn cuboid(half: Vec3) -> SharedShape {
    let [x, y, z] = half.to_array().map(real);
    SharedShape::cuboid(x, y, z)
}

pub(crate) fn heightfield(side: usize, heights: &[f32], scale: Vec3) -> SharedShape {
    let heights = heights.iter().copied().map(real).collect();
    SharedShape::heightfield(Array2::new(side, side, heights), to_vector(scale))
}

/// Returns a cube that bends, by half its edge.
pub fn soft_cube(at: Vec3, half: f32) -> SoftBodyBuilder {
    SoftBodyBuilder::cuboid(to_vector(at), Vector::splat(real(half)), 3, 3, 3)
}

pub fn joint(kind: JointKind) -> GenericJoint {
    match kind {
        JointKind::Socket(most) => {
            let axes = [JointAxis::AngX, JointAxis::AngY, JointAxis::AngZ].into_iter();
            let most = real(most);
            axes.fold(SphericalJointBuilder::new(), |joint, axis| joint.limits(axis, [-most, most])).into()
        }
        JointKind::Hinge(axis, limits) => {
            RevoluteJointBuilder::new(to_vector(axis)).limits(limits.map(real)).into()
        }
        JointKind::Pull(pull) => {
            crate::build::pull(&[JointAxis::LinX, JointAxis::LinY, JointAxis::LinZ], pull)
        }
    }
}
