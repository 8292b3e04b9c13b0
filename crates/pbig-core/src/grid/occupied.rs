//! The occupied cells of a grid, for pictures.

use super::cells::steps_portable;
use super::edit::EditedGrid;
use crate::Aabb;

/// A cell of a grid with the boxes whose lower corners lie in it, or a leaf of a tree with its boxes.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct OccupiedCell {
    /// The cell; a border cell reaches to the lower corners of the boxes beyond the border.
    pub aabb: Aabb,
    /// The ids of the boxes.
    pub ids: Vec<u32>,
}

impl EditedGrid {
    /// Returns the cells in which boxes lie.
    pub(crate) fn occupied_cells(&self) -> Vec<OccupiedCell> {
        let all = 0..self.grid.plan.cells.count();
        all.filter_map(|key| self.occupied_cell(key)).collect()
    }

    fn occupied_cell(&self, key: usize) -> Option<OccupiedCell> {
        let (first, end) = self.grid.slots((key, 1));
        let in_slots = self.grid.records[first..end].iter();
        let mut records: Vec<_> = in_slots.filter(|record| record.aabb.is_valid()).collect();
        self.spill.visit((key, 1), |entry| records.push(self.spill.record(entry)));
        let first = self.cell_around(&records.first()?.aabb);
        let with = |cell: Aabb, corner: [f32; 3]| cell.union(&Aabb::new(corner, corner));
        let aabb = records.iter().fold(first, |cell, record| with(cell, record.aabb.min));
        Some(OccupiedCell { aabb, ids: records.iter().map(|record| record.id).collect() })
    }

    /// Returns the cell in which the lower corner of a box lies.
    fn cell_around(&self, aabb: &Aabb) -> Aabb {
        let cells = &self.grid.plan.cells;
        let (low, _) = steps_portable(cells, aabb);
        let edge = cells.edges();
        let min: [f32; 3] = std::array::from_fn(|k| {
            let step = low[k] >> cells.shift << cells.shift;
            (cells.origin[k] + f64::from(step) / cells.scale[k]) as f32
        });
        Aabb::new(min, std::array::from_fn(|k| min[k] + edge[k]))
    }
}
