//! The plan of PBIG's single grid (Lo et al. 2013, section 4.1).

use crate::Aabb;
use crate::config::GpuOptions;
use crate::pbig::Summary;
use crate::pbig::cell_size::{cell_size, cells_along, cells_in, ordinary, pbig_objective, space_of};
use std::fmt;

/// Most cells per box. With more cells, empty cells cost more than full ones.
const MAX_CELLS_PER_BOX: f64 = 4.0;

/// Most cells that a box touches before it is tested against all others instead.
const MAX_TOUCHED_CELLS: u32 = 512;

/// The grid of [`super::pbig_grid`]: one entry for each cell that a box touches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PbigPlan {
    /// Edge of the cubic cells, in the boxes' length unit.
    pub cell: f32,
    /// Lower corner of cell 0, in the boxes' length unit.
    pub origin: [f32; 3],
    /// Number of cells on each axis. Boxes beyond are clamped into the border cells.
    pub dims: [u32; 3],
    /// Most cells that a box touches before it is tested against all others instead.
    pub max_cells_per_box: u32,
    /// `f` of equation 2 at this cell size: average entries per cell.
    pub objective: f32,
}

/// `16 x 16 x 16 cells of 1.5, f = 4 entries a cell`.
impl fmt::Display for PbigPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y, z] = self.dims;
        write!(f, "{x} x {y} x {z} cells of {}, f = {} entries a cell", self.cell, self.objective)
    }
}

impl PbigPlan {
    /// Plans the grid for the boxes, with the cell size by [`GpuOptions::cell_rule`] and [`GpuOptions::boxes_per_cell`].
    pub fn new(boxes: &[Aabb], options: &GpuOptions) -> Self {
        let summary = Summary::of(boxes);
        let sample = ordinary(&summary);
        let (space, origin) = space_of(&summary, &sample);
        let n = summary.valid;
        let mut cell = cell_size(options.cell_rule, &sample, n, space, options.boxes_per_cell.max(1.0));
        // Oversize boxes in the sample raise alpha, and with it f, at any cell size. Equation 6 would then have a billion
        // cells for a handful of boxes.
        while cells_in(space, cell) > f64::from(n.max(64)) * MAX_CELLS_PER_BOX {
            cell *= 1.25;
        }
        let dims = space.map(|length| cells_along(length, cell) as u32);
        let objective = pbig_objective(&sample, n, space, cell);
        Self { cell, origin, dims, max_cells_per_box: MAX_TOUCHED_CELLS, objective }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ground_under_a_pile_does_not_enlarge_the_cells() {
        let at = |i: u32| [i % 10, i / 10 % 10, i / 100].map(|c| c as f32 * 2.0);
        let mut boxes: Vec<Aabb> = (0..999).map(|i| Aabb::from_center(at(i), [0.5; 3])).collect();
        for half in [1e3, 1e6, 0.5 * f32::MAX] {
            boxes.push(Aabb::from_center([0.0; 3], [half; 3]));
            let plan = PbigPlan::new(&boxes, &GpuOptions::DEFAULT);
            assert!(plan.cell < 10.0, "ground of {half}: {plan}");
        }
    }
}
