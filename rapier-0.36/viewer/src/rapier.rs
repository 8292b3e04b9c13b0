//! The differences between versions of rapier, apart from the broad phase: vectors, contacts and the trait of the debug renderer.

use crate::cells::Boxes;
use kiss3d::prelude::{Pose3, Quat, Vec3};
use rapier3d::math::{Pose, Vector};
use rapier3d::pipeline::{DebugColor, DebugRenderBackend, DebugRenderObject};
use rapier3d::prelude::*;

/// Returns a pose of rapier's as one that can be drawn.
pub fn pose(pose: &Pose) -> Pose3 {
    let (at, turn) = (pose.translation.into(), pose.rotation.into());
    Pose3::from_parts(Vec3::from_array(at), Quat::from_array(turn))
}

/// Returns true if the colliders of a pair touch.
pub fn is_touching(pair: &ContactPair) -> bool {
    pair.has_any_active_contact()
}

impl DebugRenderBackend for Boxes {
    fn draw_line(&mut self, _: DebugRenderObject, _: Vector, _: Vector, _: DebugColor) {}

    fn draw_polyline(
        &mut self,
        object: DebugRenderObject,
        _: &[Vector],
        _: &[[u32; 2]],
        _: &Pose,
        _: Vector,
        color: DebugColor,
    ) {
        self.push(object, color);
    }
}
