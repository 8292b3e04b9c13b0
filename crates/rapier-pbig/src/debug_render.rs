//! Draws the broad phase through rapier's debug renderer.

use crate::PbigBroadPhase;
use crate::scene::to_handle;
use crate::tree::to_tree;
use pbig_adapter::DebugRenderParts;
use rapier3d::parry::bounding_volume::Aabb as DrawnAabb;
use rapier3d::pipeline::{DebugRenderBackend, DebugRenderObject};
use rapier3d::prelude::{ColliderSet, Isometry, Vector};

impl PbigBroadPhase {
    /// Draws the stored boxes and cells as lines, through the renderer that also draws rapier's own pictures. Each is passed as
    /// a [`DebugRenderObject::ColliderAabb`], a cell with the first collider in it. Few boxes have no cells, because
    /// they need no grid. A GPU shows no cells.
    pub fn debug_render(
        &self,
        colliders: &ColliderSet,
        parts: DebugRenderParts,
        backend: &mut dyn DebugRenderBackend,
    ) {
        for drawn in self.colliders.drawn(parts, |handle| colliders.contains(to_handle(handle))) {
            let (handle, aabb) = (to_handle(drawn.collider), to_tree(&drawn.aabb));
            let object = DebugRenderObject::ColliderAabb(handle, &colliders[handle], &aabb);
            if backend.filter_object(object) {
                let edges = DrawnAabb::EDGES_VERTEX_IDS.map(|(a, b)| [a as u32, b as u32]);
                let (pose, scale) = (Isometry::identity(), Vector::repeat(1.0));
                backend.draw_polyline(object, &aabb.vertices(), &edges, &pose, &scale, drawn.color);
            }
        }
    }
}
