//! The cells that an oversize box reaches: one too large for the cells, tested exactly against every box there.

use super::Grid;
use super::cells::{Cells, Window};
use super::search::KeyRun;
use super::simd::{Simd, dispatch};
use crate::Aabb;

impl Grid {
    /// Visits the cells in which boxes can lie that overlap a box of any size.
    pub(super) fn reached_by(&self, aabb: &Aabb, mut visit: impl FnMut(KeyRun)) {
        let cells = &self.plan.cells;
        let window = dispatch!(window_of, cells, aabb).clipped(cells);
        for z in window.low[2]..=window.high[2] {
            if spans_rows(cells, &window) {
                visit(layer(cells, &window, z));
                continue;
            }
            for y in window.low[1]..=window.high[1] {
                let first = [window.low[0], y, z];
                let last = window.high[0];
                let row = if cells.wraps {
                    cells.row::<true>(first, last)
                } else {
                    cells.row::<false>(first, last)
                };
                row.into_iter().filter(|(_, count)| *count > 0).for_each(&mut visit);
            }
        }
    }
}

/// Returns true if the window has all cells of its rows, so that the rows of a layer are one run.
fn spans_rows(cells: &Cells, window: &Window) -> bool {
    let [first, last] = if cells.wraps { [0, cells.dims[0] - 1] } else { [1, cells.dims[0] - 2] };
    let is_aligned = !cells.wraps || window.low[1] >= 0 && window.high[1] < cells.dims[1];
    window.low[0] <= first && window.high[0] >= last && is_aligned
}

/// Returns all rows of a window in a layer; the border cells between them are empty.
fn layer(cells: &Cells, window: &Window, z: i32) -> KeyRun {
    let z = if cells.wraps { z & (cells.dims[2] - 1) } else { z };
    let first = cells.key([0, window.low[1], z]) as usize;
    (first, cells.key([cells.dims[0] - 1, window.high[1], z]) as usize + 1 - first)
}

#[inline(always)]
fn window_of(simd: impl Simd, cells: &Cells, aabb: &Aabb) -> Window {
    let (low, high) = simd.steps(cells, aabb);
    cells.window(low, high)
}
