//! The occupied cells of a grid, for pictures.

use super::{Cells, Grid};
use crate::simd::Portable;
use crate::{Aabb, OccupiedCell};

/// Sorts boxes into a grid, and returns the cells in which some lie.
pub(crate) fn occupied_cells(boxes: &[Aabb]) -> Vec<OccupiedCell> {
    let (cells, mut grid) = (Cells::new(boxes, None, 1), Grid::default());
    grid.build(cells, boxes, 1);
    (0..cells.count()).filter_map(|key| grid.occupied_cell(key)).collect()
}

impl Grid {
    fn occupied_cell(&self, key: usize) -> Option<OccupiedCell> {
        let (first, end) = self.slots((key, 1));
        let records = &self.records[first..end];
        let first = self.cell_around(&records.first()?.aabb);
        let with = |cell: Aabb, corner: [f32; 3]| cell.union(&Aabb::new(corner, corner));
        let aabb = records.iter().fold(first, |cell, record| with(cell, record.aabb.min));
        Some(OccupiedCell { aabb, ids: records.iter().map(|record| record.id).collect() })
    }

    /// Returns the cell in which the lower corner of a box lies.
    fn cell_around(&self, aabb: &Aabb) -> Aabb {
        let cells = &self.cells;
        let (low, _) = cells.steps(Portable, aabb);
        let edge = cells.edges();
        let min: [f32; 3] = std::array::from_fn(|k| {
            let step = low[k] >> cells.shift << cells.shift;
            (cells.origin[k] + f64::from(step) / cells.scale[k]) as f32
        });
        Aabb::new(min, std::array::from_fn(|k| min[k] + edge[k]))
    }
}
