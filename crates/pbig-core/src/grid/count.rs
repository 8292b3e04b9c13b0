//! The work of a search, before it is done: once boxes are sorted, the slots that each would visit are known.

use super::cells::{Cells, Steps};
use super::hits::{Hits, Rule};
use super::plan::NeighbourScan;
use super::record::Record;
use super::simd::{Kernel, Simd, dispatch};
use super::{Grid, Sorted};
use crate::policy::search as policy;

impl Sorted<'_> {
    /// Returns the work of a search: one box in [`policy::COUNT_ONE_IN`] is counted, without a test.
    pub(crate) fn work(&self) -> u64 {
        let grid = self.grid;
        let in_grid = dispatch(CountSlots { grid, step: policy::COUNT_ONE_IN });
        let oversize = grid.oversize.len();
        let step = oversize.div_ceil(policy::COUNTED_OVERSIZE).max(1);
        let counted = grid.oversize.iter().step_by(step).map(|one| grid.work_of_oversize(one)).sum::<u64>();
        let between = (oversize * oversize / 2) as u64;
        in_grid * policy::COUNT_ONE_IN as u64 + counted * step as u64 + between * policy::WORK_OF_EXACT_TEST
    }

    /// Returns the number of overlaps that a search of one box in `step` finds, in proportion. Leaves `hits` as they come.
    pub(crate) fn overlaps_in_sample(&self, step: usize, rule: &Rule<'_>, hits: &mut Hits) -> u64 {
        let rule = Rule { max_pairs: u64::MAX, ..*rule };
        hits.begin(0, 0);
        let (len, oversize) = (self.grid.len, self.grid.oversize.len());
        for slot in (step / 2..len).step_by(step) {
            self.grid.search_slots(slot..slot + 1, &rule, hits);
        }
        let in_grid = hits.overlaps * step as u64;
        let step = step.min(oversize / policy::SAMPLED_OVERSIZE + 1);
        hits.begin(0, 0);
        for i in (step / 2..oversize).step_by(step) {
            self.grid.find_oversize_pairs(i, &rule, hits);
        }
        in_grid + hits.overlaps * step as u64
    }
}

impl Grid {
    /// Returns the work of an oversize box: the rows of cells that it reaches, and the boxes in them.
    fn work_of_oversize(&self, one: &Record) -> u64 {
        let mut work = 0;
        self.reached_by(&one.aabb, |run| {
            let (first, end) = self.slots(run);
            work += 1 + (end - first) as u64 * policy::WORK_OF_EXACT_TEST;
        });
        work
    }
}

/// Counts the slots that one box in `step` visits.
struct CountSlots<'a> {
    grid: &'a Grid,
    step: usize,
}

impl Kernel for CountSlots<'_> {
    type Output = u64;

    #[inline(always)]
    unsafe fn run<S: Simd>(self) -> u64 {
        let Self { grid, step } = self;
        let cells = grid.plan.cells;
        let mut work = 0;
        for slot in (0..grid.len).step_by(step) {
            // SAFETY: the caller has the instructions.
            let slots = unsafe {
                match (grid.plan.scan, cells.wraps) {
                    (NeighbourScan::Runs, _) => in_runs(grid, slot),
                    (NeighbourScan::Windows, false) => in_window::<S, false>(grid, &cells, slot),
                    (NeighbourScan::Windows, true) => in_window::<S, true>(grid, &cells, slot),
                }
            };
            // SAFETY: as above.
            let (low, _) = unsafe { S::steps(&cells, &grid.records[slot].aabb) };
            work += if is_outside(&cells, low) { slots * policy::WORK_OF_EXACT_TEST } else { slots };
        }
        work
    }
}

/// Returns true if a box lies beyond the cells, in one at the border: codes of such boxes seldom tell them apart.
#[inline(always)]
fn is_outside(cells: &Cells, low: Steps) -> bool {
    !cells.wraps && (0..3).any(|k| !(1..=cells.dims[k] - 2).contains(&(low[k] >> cells.shift)))
}

/// Returns the slots behind a box in its own row of cells, and in four rows more.
#[inline(always)]
fn in_runs(grid: &Grid, slot: usize) -> u64 {
    let (dx, layer) =
        (grid.plan.cells.dims[0] as usize, (grid.plan.cells.dims[0] * grid.plan.cells.dims[1]) as usize);
    let key = grid.records[slot].key as usize;
    let row = |first: usize| u64::from(grid.starts[first + 3] - grid.starts[first]);
    let own = u64::from(grid.starts[key + 2]) - slot as u64;
    own + row(key + dx - 1) + row(key + layer - dx - 1) + row(key + layer - 1) + row(key + layer + dx - 1)
}

/// Returns half of the slots in a box's window.
#[inline(always)]
unsafe fn in_window<S: Simd, const WRAPS: bool>(grid: &Grid, cells: &Cells, slot: usize) -> u64 {
    // SAFETY: the caller has the instructions.
    let window = unsafe {
        let (low, high) = S::steps(cells, &grid.records[slot].aabb);
        cells.window(low, high)
    };
    let (mut rows, mut slots) = (0, 0);
    for z in window.low[2]..=window.high[2] {
        for y in window.low[1]..=window.high[1] {
            for run in cells.row::<WRAPS>([window.low[0], y, z], window.high[0]) {
                let (first, end) = grid.slots(run);
                (rows, slots) = (rows + 1, slots + (end - first) as u64);
            }
        }
    }
    rows + slots / 2
}
