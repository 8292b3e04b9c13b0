//! The cells of pbig's grid, and the cell of each collider.

use crate::simulation::Simulation;
use pbig_core::Plan;
use rapier_pbig::{DebugRenderParts, PbigBroadPhase};
use rapier3d::pipeline::{DebugColor, DebugRenderBackend, DebugRenderObject};
use rapier3d::prelude::*;
use std::collections::HashMap;

/// An occupied cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    pub min: [f32; 3],
    pub max: [f32; 3],
    /// From 0.2 to 1: more boxes, more light.
    pub lightness: f32,
}

/// The cells of pbig's grid, as the last step left them. Stock has none, and neither have few boxes, which need no grid, or
/// a grid on a GPU.
#[derive(Clone, Debug, Default)]
pub struct Cells {
    pub occupied: Vec<Cell>,
    of_collider: HashMap<ColliderHandle, [i64; 3]>,
}

impl Cells {
    /// Reads the cells of the broad phase in use.
    pub fn of(simulation: &Simulation) -> Self {
        let pbig = simulation.broad_phase.pbig();
        pbig.map_or_else(Self::default, |pbig| Self::read(pbig, &simulation.world.colliders))
    }

    /// Returns the cell of a collider, counted from the grid's origin. A box lies in the cell of its lower corner.
    pub fn cell_of(&self, collider: ColliderHandle) -> Option<[i64; 3]> {
        self.of_collider.get(&collider).copied()
    }

    fn read(pbig: &PbigBroadPhase, colliders: &ColliderSet) -> Self {
        let cells = boxes_of(pbig, colliders, DebugRenderParts { cells: true, fat_boxes: false });
        let fat_boxes = boxes_of(pbig, colliders, DebugRenderParts { cells: false, fat_boxes: true });
        let occupied = cells.into_iter().map(|(_, cell, _)| cell).collect();
        let plan = &pbig.stats().report.plan;
        let in_grid = fat_boxes.into_iter().filter(|(.., is_in_grid)| *is_in_grid);
        let of_collider =
            in_grid.filter_map(|(handle, fat, _)| Some((handle, cell_at(fat.min, plan)?))).collect();
        Self { occupied, of_collider }
    }
}

/// The boxes that pbig draws, each with its collider and whether it lies in a cell.
struct Boxes(Vec<(ColliderHandle, Cell, bool)>);

impl DebugRenderBackend for Boxes {
    fn draw_line(&mut self, _: DebugRenderObject, _: Point<Real>, _: Point<Real>, _: DebugColor) {}

    /// Appends an AABB; other objects are left out.
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

fn boxes_of(
    pbig: &PbigBroadPhase,
    colliders: &ColliderSet,
    parts: DebugRenderParts,
) -> Vec<(ColliderHandle, Cell, bool)> {
    let mut boxes = Boxes(Vec::new());
    pbig.debug_render(colliders, parts, &mut boxes);
    boxes.0
}

/// Steps of a cell, to which pbig rounds a coordinate (docs/ARCHITECTURE.md, Build).
const STEPS_OF_CELL: f64 = 64.0;

/// Returns the cell of a lower corner, or `None` if the last update used no grid. Boxes beyond the grid lie in its outermost
/// cells, around which a ring stays empty.
fn cell_at(corner: [f32; 3], plan: &Plan) -> Option<[i64; 3]> {
    let has_cells = plan.cell.iter().all(|&edge| edge > 0.0);
    let along = |i: usize| {
        let cells = (f64::from(corner[i]) - plan.origin[i]) / f64::from(plan.cell[i]);
        let index = ((cells * STEPS_OF_CELL).round() / STEPS_OF_CELL).floor() as i64;
        index.clamp(1, (i64::from(plan.dims[i]) - 2).max(1))
    };
    has_cells.then(|| std::array::from_fn(along))
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
    fn objects_in_the_grid_lie_in_occupied_cells() {
        let (cells, simulation) = cells(Choice::Cpu);
        let plan = &simulation.broad_phase.pbig().unwrap().stats().report.plan;
        // The middle of a cell, because its corner lies on a border.
        let middle = |cell: &Cell| std::array::from_fn(|i| cell.min[i] + 0.5 * plan.cell[i]);
        let occupied: Vec<_> = cells.occupied.iter().filter_map(|cell| cell_at(middle(cell), plan)).collect();
        let found: Vec<_> =
            simulation.world.colliders.iter().filter_map(|(handle, _)| cells.cell_of(handle)).collect();
        let inside = found.iter().filter(|cell| occupied.contains(cell)).count();
        assert!(found.len() == 500 && inside > 490, "{inside} of {}", found.len());
        assert!(occupied.len() > 20 && occupied.len() < 500, "{}", occupied.len());
    }

    #[test]
    fn stock_has_no_cells() {
        let (cells, simulation) = cells(Choice::Stock);
        assert!(cells.occupied.is_empty());
        assert!(simulation.world.colliders.iter().all(|(handle, _)| cells.cell_of(handle).is_none()));
    }
}
