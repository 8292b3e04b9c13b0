//! Pictures of the broad phase through rapier's debug renderer.

use crate::PbigBroadPhase;
use pbig_core::Aabb;
use rapier3d::parry::bounding_volume::Aabb as DrawnAabb;
use rapier3d::pipeline::{DebugColor, DebugRenderBackend, DebugRenderObject};
use rapier3d::prelude::{Collider, ColliderHandle, ColliderSet, Isometry, Point, Vector};

/// What is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DebugRenderParts {
    /// The stored boxes, with their margins. Their hue tells the level of their grid: green, blue, violet, ...,
    /// each grid of boxes at rest and of boxes that have moved from the start; grey for those that are tested against all others, or that no grid holds.
    pub fat_boxes: bool,
    /// The occupied cells of the grids. Their lightness tells how many boxes lie in one: white with eight or more.
    pub cells: bool,
}

impl DebugRenderParts {
    /// Everything.
    pub const ALL: Self = Self { fat_boxes: true, cells: true };
}

/// Alpha of boxes, and of the more numerous cells.
const OPAQUE: [f32; 2] = [1.0, 0.5];

impl PbigBroadPhase {
    /// Draws what the broad phase has stored, with lines, through the renderer that also draws rapier's own pictures.
    /// Boxes and cells come as [`DebugRenderObject::ColliderAabb`], a cell with the first collider in it. There are cells
    /// where the CPU searches with a grid; a few boxes, or all on a GPU, have none.
    pub fn debug_render(
        &self,
        colliders: &ColliderSet,
        parts: DebugRenderParts,
        backend: &mut dyn DebugRenderBackend,
    ) {
        let cells = self.finder.cells();
        let mut levels = vec![None; self.roll.generations().len()];
        for cell in &cells {
            cell.ids.iter().for_each(|&id| levels[id as usize] = Some(cell.level));
            let first = cell.ids.iter().find_map(|&id| self.collider(colliders, id));
            if let (true, Some((handle, collider))) = (parts.cells, first) {
                let lightness = 0.2 + 0.1 * (cell.ids.len().min(8) as f32);
                draw(backend, (handle, collider), &cell.aabb, hsla(Some(cell.level), lightness, OPAQUE[1]));
            }
        }
        for (id, level) in levels.into_iter().enumerate().filter(|_| parts.fat_boxes) {
            let aabb = self.finder.fat_aabb(id as u32);
            if let (Some(aabb), Some(drawn)) = (aabb, self.collider(colliders, id as u32)) {
                draw(backend, drawn, &aabb, hsla(level, 0.5, OPAQUE[0]));
            }
        }
    }

    fn collider<'a>(&self, colliders: &'a ColliderSet, id: u32) -> Option<(ColliderHandle, &'a Collider)> {
        let handle = self.roll.handle(id)?;
        Some((handle, colliders.get(handle)?))
    }
}

fn hsla(level: Option<u32>, lightness: f32, alpha: f32) -> DebugColor {
    match level {
        Some(level) => [(120.0 + 75.0 * level as f32) % 360.0, 1.0, lightness, alpha],
        None => [0.0, 0.0, lightness, alpha],
    }
}

fn draw(
    backend: &mut dyn DebugRenderBackend,
    (handle, collider): (ColliderHandle, &Collider),
    aabb: &Aabb,
    color: DebugColor,
) {
    let aabb = DrawnAabb::new(Point::from(aabb.min), Point::from(aabb.max));
    let object = DebugRenderObject::ColliderAabb(handle, collider, &aabb);
    if backend.filter_object(object) {
        let edges = DrawnAabb::EDGES_VERTEX_IDS.map(|(a, b)| [a as u32, b as u32]);
        let (pose, scale) = (Isometry::identity(), Vector::repeat(1.0));
        backend.draw_polyline(object, &aabb.vertices(), &edges, &pose, &scale, color);
    }
}
