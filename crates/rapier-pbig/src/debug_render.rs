//! Draws the broad phase through rapier's debug renderer. `rapier-0.36/rapier-pbig` has this file, too; `draw` is each crate's
//! own, for its version of rapier.

use crate::draw::{Drawn, draw_edges, to_handle};
use crate::tree::to_tree;
use pbig_core::Aabb;
use rapier3d::parry::bounding_volume::Aabb as DrawnAabb;
use rapier3d::pipeline::{DebugColor, DebugRenderBackend, DebugRenderObject};
use rapier3d::prelude::{Collider, ColliderHandle, ColliderSet};

/// The parts that `debug_render` draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DebugRenderParts {
    /// The stored AABBs, with their margins. Boxes in a cell are green, others grey.
    pub fat_boxes: bool,
    /// The occupied cells of the grid. The lightness tells how many boxes lie in one: white for eight or more.
    pub cells: bool,
}

impl DebugRenderParts {
    /// Everything.
    pub const ALL: Self = Self { fat_boxes: true, cells: true };
}

/// The alpha of boxes and of cells, which are more numerous.
const ALPHA: [f32; 2] = [1.0, 0.5];

impl Drawn {
    /// Draws the stored boxes and cells as lines, through the renderer that also draws rapier's own pictures. Each is passed as
    /// a [`DebugRenderObject::ColliderAabb`], a cell with the first collider in it. Few boxes have no cells, because
    /// they need no grid. A GPU shows no cells.
    pub fn debug_render(
        &self,
        colliders: &ColliderSet,
        parts: DebugRenderParts,
        backend: &mut dyn DebugRenderBackend,
    ) {
        let cells = self.colliders.core().cells();
        let mut in_grid = vec![false; self.colliders.core().id_count() as usize];
        for cell in &cells {
            cell.ids.iter().for_each(|&id| in_grid[id as usize] = true);
            let first = cell.ids.iter().find_map(|&id| self.collider(colliders, id));
            if let (true, Some((handle, collider))) = (parts.cells, first) {
                let lightness = 0.2 + 0.1 * (cell.ids.len().min(8) as f32);
                draw(backend, (handle, collider), &cell.aabb, hsla(true, lightness, ALPHA[1]));
            }
        }
        for (id, in_grid) in in_grid.into_iter().enumerate().filter(|_| parts.fat_boxes) {
            let aabb = self.colliders.core().fat_aabb(id as u32);
            if let (Some(aabb), Some(drawn)) = (aabb, self.collider(colliders, id as u32)) {
                draw(backend, drawn, &aabb, hsla(in_grid, 0.5, ALPHA[0]));
            }
        }
    }

    fn collider<'a>(&self, colliders: &'a ColliderSet, id: u32) -> Option<(ColliderHandle, &'a Collider)> {
        let handle = to_handle(self.colliders.handle(id)?);
        Some((handle, colliders.get(handle)?))
    }
}

/// Green for cells and the boxes in them, grey for boxes in no cell.
fn hsla(in_grid: bool, lightness: f32, alpha: f32) -> DebugColor {
    if in_grid { [120.0, 1.0, lightness, alpha] } else { [0.0, 0.0, lightness, alpha] }
}

fn draw(
    backend: &mut dyn DebugRenderBackend,
    (handle, collider): (ColliderHandle, &Collider),
    aabb: &Aabb,
    color: DebugColor,
) {
    let aabb = to_tree(aabb);
    let object = DebugRenderObject::ColliderAabb(handle, collider, &aabb);
    if backend.filter_object(object) {
        let edges = DrawnAabb::EDGES_VERTEX_IDS.map(|(a, b)| [a as u32, b as u32]);
        draw_edges(backend, object, &aabb.vertices(), &edges, color);
    }
}
