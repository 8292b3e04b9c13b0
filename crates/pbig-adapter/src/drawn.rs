//! The boxes and cells that rapier's debug renderer draws.

use crate::{BoxStore, Colliders, Handle, Tree};

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

/// A box to draw.
#[derive(Clone, Copy, Debug)]
pub struct DrawnBox<A> {
    /// The collider of the box, or the first collider in the cell.
    pub collider: Handle,
    /// The box or cell.
    pub aabb: A,
    /// Hue, saturation, lightness and alpha.
    pub color: [f32; 4],
}

/// The alpha of boxes and of cells, which are more numerous.
const ALPHA: [f32; 2] = [1.0, 0.5];

impl<T: Tree> Colliders<T> {
    /// Returns the cells, then the stored boxes of the colliders that exist.
    pub fn drawn(&self, parts: DebugRenderParts, exists: impl Fn(Handle) -> bool) -> Vec<DrawnBox<T::Aabb>> {
        let known = |id: u32| self.registry.handle(id).filter(|&handle| exists(handle));
        let (cells, mut drawn) = (self.core().cells(), Vec::new());
        let mut in_grid = vec![false; self.core().id_count() as usize];
        for cell in &cells {
            cell.ids.iter().for_each(|&id| in_grid[id as usize] = true);
            if let (true, Some(collider)) = (parts.cells, cell.ids.iter().find_map(|&id| known(id))) {
                let lightness = 0.2 + 0.1 * (cell.ids.len().min(8) as f32);
                let aabb = self.boxes.widen(cell.aabb);
                drawn.push(DrawnBox { collider, aabb, color: hsla(true, lightness, ALPHA[1]) });
            }
        }
        for (id, in_grid) in (0..).zip(in_grid).filter(|_| parts.fat_boxes) {
            if let (Some(aabb), Some(collider)) = (self.boxes.fat(self.core(), id), known(id)) {
                drawn.push(DrawnBox { collider, aabb, color: hsla(in_grid, 0.5, ALPHA[0]) });
            }
        }
        drawn
    }
}

/// Returns the edges of a rectangle or a box, by the numbers that parry gives its vertices.
pub fn box_edges(axes: usize) -> Vec<[u32; 2]> {
    let ring = |k| [[k, k + 1], [k + 1, k + 2], [k + 3, k + 2], [k, k + 3]];
    let rings = [0, 4].into_iter().take(axes - 1).flat_map(ring);
    rings.chain((0..4).filter(|_| axes > 2).map(|k| [k, k + 4])).collect()
}

/// Returns green for cells and the boxes in them, grey for boxes in no cell.
fn hsla(in_grid: bool, lightness: f32, alpha: f32) -> [f32; 4] {
    if in_grid { [120.0, 1.0, lightness, alpha] } else { [0.0, 0.0, lightness, alpha] }
}
