//! The most work that a search can take, known before it: the rows and slots that each box visits are.

use super::Grid;
use super::scan::Sorted;
use crate::NeighbourScan;
use crate::parallel::{run, threads_for};
use crate::policy::search::{WORK_OF_EXACT_TEST, WORK_OF_ROW, WORK_OF_RUNS, WORK_OF_VAGUE_TEST};
use crate::search::Budget;
use crate::simd::{Simd, dispatch};
use std::ops::Range;

/// Boxes that are counted together.
const PIECE: usize = 4096;

impl Sorted<'_> {
    /// Returns true if a search takes no more than this work, even if no code tells two boxes apart.
    pub(crate) fn takes_at_most(&self, work: u64) -> bool {
        let (len, budget) = (self.own.len, Budget::new(work));
        let pieces = len.div_ceil(PIECE);
        run(threads_for(pieces), pieces, |_, piece| {
            if !budget.is_over() {
                let slots = piece * PIECE..len.min((piece + 1) * PIECE);
                budget.charge(dispatch!(count_slots, self, slots.clone()));
            }
        });
        for i in 0..self.oversize_count() {
            if budget.is_over() {
                break;
            }
            budget.charge(self.most_of_oversize(i));
        }
        !budget.is_over()
    }

    fn most_of_oversize(&self, i: usize) -> u64 {
        let (one, grid, others) = self.oversize(i);
        let mut work = others.len() as u64 * WORK_OF_EXACT_TEST;
        grid.reached_by(&one.aabb, |run| {
            let (first, end) = grid.slots(run);
            work += WORK_OF_ROW + (end - first) as u64 * WORK_OF_EXACT_TEST;
        });
        work
    }
}

/// Returns the most work of the boxes in some slots.
#[inline(always)]
fn count_slots(simd: impl Simd, sorted: &Sorted<'_>, slots: Range<usize>) -> u64 {
    let grid = sorted.searched();
    let of_slot = |slot: usize| match (sorted.other, grid.cells.scan, grid.cells.wraps) {
        (None, NeighbourScan::Runs, _) => WORK_OF_RUNS + WORK_OF_VAGUE_TEST * in_runs(grid, slot),
        (_, _, false) => in_window::<false>(simd, sorted, slot),
        (_, _, true) => in_window::<true>(simd, sorted, slot),
    };
    slots.map(of_slot).sum()
}

/// Returns the slots behind a box in its own row of cells, and in four rows more.
#[inline(always)]
fn in_runs(grid: &Grid, slot: usize) -> u64 {
    let (dx, layer) = (grid.cells.dims[0] as usize, (grid.cells.dims[0] * grid.cells.dims[1]) as usize);
    let key = grid.records[slot].key as usize;
    let row = |first: usize| u64::from(grid.starts[first + 3] - grid.starts[first]);
    let own = u64::from(grid.starts[key + 2]) - slot as u64;
    own + row(key + dx - 1) + row(key + layer - dx - 1) + row(key + layer - 1) + row(key + layer + dx - 1)
}

/// Returns the most work of a box in its window, of which it visits half in its own grid.
#[inline(always)]
fn in_window<const WRAPS: bool>(simd: impl Simd, sorted: &Sorted<'_>, slot: usize) -> u64 {
    let grid = sorted.searched();
    let cells = &grid.cells;
    let (low, high) = cells.steps(simd, &sorted.own.records[slot].aabb);
    let window = cells.window(low, high);
    let mut work = 0;
    for z in window.low[2]..=window.high[2] {
        for y in window.low[1]..=window.high[1] {
            work += WORK_OF_ROW;
            for run in cells.row::<WRAPS>([window.low[0], y, z], window.high[0]) {
                let (first, end) = grid.slots(run);
                work += (end - first) as u64 * WORK_OF_VAGUE_TEST;
            }
        }
    }
    work
}
