//! The differences between versions of rapier, apart from the broad phase: vectors, contacts and pbig's debug renderer.
//! `rapier-0.36/viewer` has its own file of this name.

use crate::cells::Cell;
use crate::engine::Pbig;
use kiss3d::prelude::{Pose3, Quat, Vec3};
use rapier_pbig::DebugRenderParts;
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

/// Returns the boxes that pbig draws, each with its collider and whether it lies in a cell.
pub fn boxes(
    pbig: &Pbig,
    colliders: &ColliderSet,
    parts: DebugRenderParts,
) -> Vec<(ColliderHandle, Cell, bool)> {
    let mut boxes = Boxes(Vec::new());
    pbig.debug_render(colliders, parts, &mut boxes);
    boxes.0
}

struct Boxes(Vec<(ColliderHandle, Cell, bool)>);

impl DebugRenderBackend for Boxes {
    fn draw_line(&mut self, _: DebugRenderObject, _: Point<Real>, _: Point<Real>, _: DebugColor) {}

    fn draw_polyline(
        &mut self,
        object: DebugRenderObject,
        _: &[Point<Real>],
        _: &[[u32; 2]],
        _: &Isometry<Real>,
        _: &Vector<Real>,
        [_, saturation, lightness, _]: DebugColor,
    ) {
        if let DebugRenderObject::ColliderAabb(handle, _, aabb) = object {
            let cell = Cell { min: aabb.mins.into(), max: aabb.maxs.into(), lightness };
            // Pbig draws boxes outside the grid in grey.
            self.0.push((handle, cell, saturation > 0.0));
        }
    }
}
