//! The differences between versions of rapier in `debug_render`. `rapier-0.36/rapier-pbig` has its own file of this name.

pub(crate) use crate::PbigBroadPhase as Drawn;
pub(crate) use crate::scene::to_collider as to_handle;

use rapier3d::pipeline::{DebugColor, DebugRenderBackend, DebugRenderObject};
use rapier3d::prelude::{Isometry, Point, Real, Vector};

/// Draws edges between corners, given in world coordinates.
pub(crate) fn draw_edges(
    backend: &mut dyn DebugRenderBackend,
    object: DebugRenderObject,
    corners: &[Point<Real>],
    edges: &[[u32; 2]],
    color: DebugColor,
) {
    backend.draw_polyline(object, corners, edges, &Isometry::identity(), &Vector::repeat(1.0), color);
}
