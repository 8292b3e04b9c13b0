//! The cells of pbig's grid, and the cell of each collider.

use crate::simulation::Simulation;
use rapier_pbig::{DebugRenderParts, PbigBroadPhase};
use rapier3d::pipeline::{DebugColor, DebugRenderBackend, DebugRenderObject};
use rapier3d::prelude::*;
use std::collections::HashMap;

/// An occupied cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// The lower corner.
    pub min: [f32; 3],
    /// The upper corner.
    pub max: [f32; 3],
    /// From 0.2 to 1: more boxes, more light.
    pub lightness: f32,
}

/// The cells of pbig's grid, as the last step left them. Stock has none, and neither have few boxes, which need no grid, or
/// a grid on a GPU.
#[derive(Clone, Debug, Default)]
pub struct Cells {
    /// Occupied cells.
    pub occupied: Vec<Cell>,
    of_collider: HashMap<ColliderHandle, [i64; 3]>,
}

impl Cells {
    /// Reads the cells of the broad phase in use.
    pub fn of(simulation: &Simulation) -> Self {
        simulation.engine.pbig().map_or_else(Self::default, |pbig| Self::read(pbig, &simulation.world.colliders))
    }

    /// Returns the cell of a collider, counted from the grid's origin. A box lies in the cell of its lower corner.
    pub fn cell_of(&self, collider: ColliderHandle) -> Option<[i64; 3]> {
        self.of_collider.get(&collider).copied()
    }

    fn read(pbig: &PbigBroadPhase, colliders: &ColliderSet) -> Self {
        let (mut cells, mut boxes) = (Boxes::default(), Boxes::default());
        pbig.debug_render(colliders, DebugRenderParts { cells: true, fat_boxes: false }, &mut cells);
        pbig.debug_render(colliders, DebugRenderParts { cells: false, fat_boxes: true }, &mut boxes);
        let occupied: Vec<Cell> = cells.boxes.iter().map(|(_, cell, _)| *cell).collect();
        let Some(first) = occupied.first() else { return Self::default() };
        let (origin, edges) = (first.min, std::array::from_fn(|i| first.max[i] - first.min[i]));
        let in_grid = boxes.boxes.iter().filter(|(.., is_in_grid)| *is_in_grid);
        let of_collider = in_grid.map(|(handle, fat, _)| (*handle, cell_at(fat.min, origin, edges))).collect();
        Self { occupied, of_collider }
    }
}

fn cell_at(corner: [f32; 3], origin: [f32; 3], edges: [f32; 3]) -> [i64; 3] {
    std::array::from_fn(|i| ((corner[i] - origin[i]) / edges[i]).floor() as i64)
}

/// Collects the boxes that pbig draws: its cells, or the stored boxes of colliders.
#[derive(Default)]
struct Boxes {
    /// The collider, the box, and whether it lies in a cell.
    boxes: Vec<(ColliderHandle, Cell, bool)>,
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
        [_, saturation, lightness, _]: DebugColor,
    ) {
        if let DebugRenderObject::ColliderAabb(handle, _, aabb) = object {
            let cell = Cell { min: aabb.mins.into(), max: aabb.maxs.into(), lightness };
            // Pbig draws boxes outside the grid in grey.
            self.boxes.push((handle, cell, saturation > 0.0));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::choice::Choice;
    use crate::simulation::Setting;
    use pbig_scenes::scenes::Scene;

    fn cells(choice: Choice) -> (Cells, Simulation) {
        let setting = Setting { scene: Scene::named("column").unwrap(), bodies: 500, seed: 1 };
        let mut simulation = Simulation::new(setting, choice);
        (0..20).for_each(|_| simulation.step());
        (Cells::of(&simulation), simulation)
    }

    #[test]
    fn each_object_in_the_grid_has_an_occupied_cell() {
        let (cells, simulation) = cells(Choice::Cpu);
        let first = cells.occupied[0];
        let indices: Vec<[i64; 3]> = cells.occupied.iter().map(|cell| {
            let edges = std::array::from_fn(|i| first.max[i] - first.min[i]);
            // The middle, because the corner lies on a border.
            cell_at(std::array::from_fn(|i| 0.5 * (cell.min[i] + cell.max[i])), first.min, edges)
        }).collect();
        let mut found = 0;
        for (handle, collider) in simulation.world.colliders.iter().filter(|(_, c)| c.parent().is_some()) {
            if let Some(cell) = cells.cell_of(handle) {
                found += 1;
                assert!(indices.contains(&cell), "{cell:?} of {:?}", collider.translation());
            }
        }
        assert!(found > 400, "{found}");
    }

    #[test]
    fn stock_has_no_cells() {
        let (cells, simulation) = cells(Choice::Stock);
        assert!(cells.occupied.is_empty());
        assert!(simulation.world.colliders.iter().all(|(handle, _)| cells.cell_of(handle).is_none()));
    }
}
