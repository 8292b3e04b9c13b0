//! Counts the work of a search before the search: once boxes are sorted, the slots that each would visit are known.

use super::Grid;
use super::cells::query_of;
use super::hits::{ById, Hits, Rule};
use super::record::Record;
use super::search::Sorted;
use super::simd::{BLOCK, Simd, dispatch};
use super::spacing::NeighbourScan;
use crate::ProxyFilter;
use crate::parallel::run;
use crate::policy::search;
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

/// Slots that are counted together.
const PIECE: usize = 16_384;

impl Sorted<'_> {
    /// Returns the work of a search: of the boxes in cells one in [`search::COUNT_ONE_IN`] is counted, without a test.
    pub(crate) fn work(&self, workers: usize) -> u64 {
        let (len, oversize, total) = (self.own.len, self.oversize_count(), AtomicU64::new(0));
        // Pieces do not depend on the number of threads: otherwise other boxes would be counted, and the choice could differ.
        run(workers, len.div_ceil(PIECE), |_, piece| {
            let slots = piece * PIECE..len.min((piece + 1) * PIECE);
            total.fetch_add(dispatch!(count_slots, self, slots.clone()), Ordering::Relaxed);
        });
        let step = oversize.div_ceil(search::COUNTED_OVERSIZE).max(1);
        let work_of = |i: usize| {
            let (one, grid, others) = self.oversize(i);
            grid.work_of_oversize(one) + others.len() as u64 * search::WORK_OF_EXACT_TEST
        };
        let counted = scattered(0..oversize, step).map(work_of).sum::<u64>();
        total.into_inner() * search::COUNT_ONE_IN as u64 + counted * step as u64
    }

    /// Estimates the work in vain of a search, by a sample of one box in `step`: the tests of each box that its own overlaps do not
    /// pay for. A box that meets thousands does not pay for others that meet none. `hits` are scratch.
    pub(crate) fn vain_work(
        &self,
        step: usize,
        filters: Option<ById<'_, ProxyFilter>>,
        hits: &mut Hits,
    ) -> u64 {
        let found = AtomicU64::new(0);
        let rule = Rule::listing(filters, &found);
        let mut vain = 0;
        for slot in scattered(0..self.own.len, step) {
            hits.begin(0, 0);
            self.search_slots(slot..slot + 1, &rule, hits);
            vain += search::in_vain(hits.work_in_cells(), hits.overlaps) * step as u64;
        }
        let step = step.min(self.oversize_count() / search::SAMPLED_OVERSIZE + 1);
        for i in scattered(0..self.oversize_count(), step) {
            hits.begin(0, 0);
            self.search_oversize(i, &rule, hits);
            vain += search::in_vain(hits.work_of_oversize(), hits.overlaps) * step as u64;
        }
        vain
    }
}

/// Yields a number of every `step` in a range, each somewhere else in its part: a pattern in the order of the boxes cannot
/// bias a sample.
#[inline(always)]
pub(crate) fn scattered(range: Range<usize>, step: usize) -> impl Iterator<Item = usize> {
    const GOLDEN: u64 = 0x9E37_79B9_7F4A_7C15;
    let at = move |first: usize| {
        let hash = (first as u64).wrapping_mul(GOLDEN) >> 32;
        first + ((hash * step as u64) >> 32) as usize
    };
    let end = range.end;
    range.step_by(step).map(at).filter(move |at| *at < end)
}

impl Grid {
    /// Returns the work of an oversize box: the rows of cells that it reaches, and the boxes in them.
    fn work_of_oversize(&self, one: &Record) -> u64 {
        let mut work = 0;
        self.reached_by(&one.aabb, |run| {
            let (first, end) = self.slots(run);
            work += (1 + end - first) as u64 * search::WORK_OF_EXACT_TEST;
        });
        work
    }
}

/// Counts the rows and slots that one box in [`search::COUNT_ONE_IN`] visits.
#[inline(always)]
fn count_slots(simd: impl Simd, sorted: &Sorted<'_>, slots: Range<usize>) -> u64 {
    let grid = sorted.searched();
    let mut work = 0;
    for slot in scattered(slots, search::COUNT_ONE_IN) {
        let (rows, slots) = match (sorted.other, grid.plan.scan, grid.plan.cells.wraps) {
            (None, NeighbourScan::Runs, _) => (0, in_runs(grid, slot)),
            (_, _, false) => in_window::<false>(simd, sorted, slot),
            (_, _, true) => in_window::<true>(simd, sorted, slot),
        };
        let is_vague = has_vague_code(simd, sorted, slot);
        work += rows + if is_vague { slots * search::WORK_OF_VAGUE_TEST } else { slots };
    }
    work
}

/// Returns true if the code of a box is like all eight codes behind it, or the first ones of the other set in its cell. Boxes beyond
/// the cells, and many tiny ones in one place, have such codes; their candidates need the exact test.
#[inline(always)]
fn has_vague_code(simd: impl Simd, sorted: &Sorted<'_>, slot: usize) -> bool {
    let (record, grid) = (&sorted.own.records[slot], sorted.searched());
    let first = if sorted.other.is_some() { grid.starts[record.key as usize] as usize } else { slot + 1 };
    // SAFETY: a start, or a slot in use is before it.
    let codes = unsafe { grid.block(first) };
    let (low, high) = simd.steps(&grid.plan.cells, &record.aabb);
    let alike = simd.test(query_of(simd.code(low, high)), codes);
    alike.count_ones() as usize == BLOCK
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

/// Returns the rows in the window of a box, and the slots that the box visits there: half of them in its own grid.
#[inline(always)]
fn in_window<const WRAPS: bool>(simd: impl Simd, sorted: &Sorted<'_>, slot: usize) -> (u64, u64) {
    let grid = sorted.searched();
    let cells = &grid.plan.cells;
    let (low, high) = simd.steps(cells, &sorted.own.records[slot].aabb);
    let window = cells.window(low, high);
    let (mut rows, mut slots) = (0, 0);
    for z in window.low[2]..=window.high[2] {
        for y in window.low[1]..=window.high[1] {
            for run in cells.row::<WRAPS>([window.low[0], y, z], window.high[0]) {
                let (first, end) = grid.slots(run);
                (rows, slots) = (rows + 1, slots + (end - first) as u64);
            }
        }
    }
    (rows, if sorted.other.is_none() { slots / 2 } else { slots })
}
