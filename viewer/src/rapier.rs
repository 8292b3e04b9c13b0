//! Conversions of rapier's vectors, its contacts, and its trait of the debug renderer.

use crate::cells::Boxes;
use kiss3d::prelude::{Pose3, Quat, Vec3};
use rapier3d::pipeline::{DebugColor, DebugRenderBackend, DebugRenderObject};
use rapier3d::prelude::*;

/// Returns a pose of rapier's as one that can be drawn.
pub fn pose(pose: &Isometry<Real>) -> Pose3 {
    let (at, turn) = (pose.translation.vector.into(), pose.rotation.coords.into());
    Pose3::from_parts(Vec3::from_array(at), Quat::from_array(turn))
}

/// Returns true if the colliders of a pair touch.
pub fn is_touching(pair: &ContactPair) -> bool {
    pair.has_any_active_contact
}

impl DebugRenderBackend for Boxes {
    fn draw_line(&mut self, _: DebugRenderObject, _: Point<Real>, _: Point<Real>, _: DebugColor) {}

    fn draw_polyline(
        &mut self,
        object: DebugRenderObject,
        _: &[Point<Real>],
        _: &[[u32; 2]],
        _: &Isometry<Real>,
        _: &Vector<Real>,
        color: DebugColor,
    ) {
        self.push(object, color);
    }
}
