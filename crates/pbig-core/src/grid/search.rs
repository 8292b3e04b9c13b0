//! The search of a whole grid: every pair of overlapping boxes is met once, from the box whose slot comes first or whose
//! cell is lower.

use super::cells::{Cells, query_of};
use super::hits::{HIT_ROOM, HitWriter, Hits, Rule};
use super::plan::NeighbourScan;
use super::record::Record;
use super::simd::{BLOCK, Simd, dispatch};
use super::{Grid, Sorted};
use crate::parallel::run_with;
use crate::policy::PARALLEL_FROM_BOXES;
use std::ops::Range;

/// Number of boxes in a piece of work: enough to hide the cost of handing it out, few enough to balance.
pub(super) const PIECE: Range<usize> = 512..16_384;

/// Number of oversize boxes in a piece of work.
pub(super) const OVERSIZE_PIECE: usize = 4;

impl Sorted<'_> {
    /// Finds all pairs, into the lists of as many threads as there are `hits`.
    pub(crate) fn search(&self, rule: &Rule<'_>, hits: &mut [Hits]) {
        let grid = self.grid;
        let workers = if grid.len + grid.oversize.len() < PARALLEL_FROM_BOXES { 1 } else { hits.len() };
        let piece = (grid.len / (8 * workers)).clamp(PIECE.start, PIECE.end);
        let in_grid = grid.len.div_ceil(piece);
        let pieces = in_grid + grid.oversize.len().div_ceil(OVERSIZE_PIECE);
        run_with(&mut hits[..workers], pieces, |hits, i| {
            if hits.is_full {
                return;
            }
            if i < in_grid {
                grid.search_slots(i * piece..grid.len.min((i + 1) * piece), rule, hits);
            } else {
                let first = (i - in_grid) * OVERSIZE_PIECE;
                let last = grid.oversize.len().min(first + OVERSIZE_PIECE);
                (first..last).for_each(|i| grid.find_oversize_pairs(i, rule, hits));
            }
        });
    }
}

impl Grid {
    /// Finds the pairs of the boxes in some slots with those behind them.
    pub(super) fn search_slots(&self, slots: Range<usize>, rule: &Rule<'_>, hits: &mut Hits) {
        dispatch!(search_piece, self, slots.clone(), rule, hits);
    }
}

#[inline(always)]
fn search_piece(simd: impl Simd, grid: &Grid, slots: Range<usize>, rule: &Rule<'_>, hits: &mut Hits) {
    let mut blocks = [0; HIT_ROOM];
    let writer = HitWriter::new(&mut blocks);
    let mut scan = Scan { simd, cells: grid.plan.cells, own: grid, grid, rule, hits, writer };
    match (grid.plan.scan, grid.plan.cells.wraps) {
        (NeighbourScan::Runs, _) => scan.runs(slots),
        (NeighbourScan::Windows, false) => scan.windows::<false>(slots),
        (NeighbourScan::Windows, true) => scan.windows::<true>(slots),
    }
    scan.finish();
}

/// A search for the boxes of one grid in another one of the same plan, or in itself.
pub(super) struct Scan<'a, 'b, S> {
    pub(super) simd: S,
    pub(super) cells: Cells,
    /// The grid with the boxes that are searched for.
    pub(super) own: &'a Grid,
    /// The grid that is searched.
    pub(super) grid: &'a Grid,
    pub(super) rule: &'a Rule<'b>,
    pub(super) hits: &'a mut Hits,
    pub(super) writer: HitWriter<'a>,
}

/// A box that is searched for: its slot, and the query that finds its partners.
#[derive(Clone, Copy)]
pub(super) struct Seeker {
    pub(super) slot: usize,
    pub(super) query: u64,
}

impl<S: Simd> Scan<'_, '_, S> {
    /// Visits five runs for each box: the rest of its row of three cells, and the four rows of three cells above it and
    /// in the next layer. The first block of a run is tested unseen: most have no second one.
    #[inline(always)]
    fn runs(&mut self, slots: Range<usize>) {
        let (dx, layer) = (self.cells.dims[0] as usize, (self.cells.dims[0] * self.cells.dims[1]) as usize);
        let Grid { starts, records, codes, .. } = self.grid;
        self.hits.runs += 5 * slots.len() as u64;
        for slot in slots {
            let key = records[slot].key as usize;
            // SAFETY: the ring of border cells is never a box's own, so `starts` has all keys below.
            let start = |key: usize| unsafe { *starts.get_unchecked(key) as usize };
            let row = |key: usize| (start(key), start(key + 3));
            let (above, next) = (key + dx - 1, key + layer - 1);
            let runs = [(slot + 1, start(key + 2)), row(above), row(next - dx), row(next), row(next + dx)];
            let (one, mut longest) = (Seeker { slot, query: query_of(codes[slot]) }, 0);
            for (first, end) in runs {
                // SAFETY: `first` is a start, or `slot + 1`: at most the number of slots.
                let block = unsafe { self.grid.block(first) };
                self.test(one, block, (first, end));
                self.writer.tests += (end - first) as u64;
                longest = longest.max(end - first);
            }
            if longest > BLOCK {
                for (first, end) in runs {
                    self.rest(one, (first + BLOCK, end));
                }
            }
            self.make_room();
            if self.hits.is_full {
                break;
            }
        }
    }

    /// Tests the slots from `first` up to `end`.
    #[inline(always)]
    fn rest(&mut self, one: Seeker, (first, end): (usize, usize)) {
        for first in (first..end).step_by(BLOCK) {
            // SAFETY: `first` is below an end that comes from `starts`.
            let block = unsafe { self.grid.block(first) };
            self.test(one, block, (first, end));
            self.make_room();
        }
    }

    /// Tests the block from `first` on, up to `end`.
    #[inline(always)]
    fn test(&mut self, one: Seeker, block: &[u64; BLOCK], (first, end): (usize, usize)) {
        let beyond = (end - first).min(BLOCK) as u32;
        let mask = self.simd.test(one.query, block) & ((1u32 << beyond) - 1);
        self.writer.push(one.slot, first, mask);
    }

    #[inline(always)]
    fn make_room(&mut self) {
        if !self.writer.has_room() {
            let records = (&self.own.records[..], &self.grid.records[..]);
            self.hits.flush(self.simd, &mut self.writer, records, self.rule);
        }
    }

    #[inline(always)]
    pub(super) fn finish(mut self) {
        let records = (&self.own.records[..], &self.grid.records[..]);
        self.hits.flush(self.simd, &mut self.writer, records, self.rule);
        self.hits.tests += self.writer.tests;
    }

    /// Visits, for each box, the cells after its own in which the lower corner of an overlapping box can lie.
    #[inline(always)]
    fn windows<const WRAPS: bool>(&mut self, slots: Range<usize>) {
        let cells = self.cells;
        for slot in slots {
            if self.hits.is_full {
                break;
            }
            let record: &Record = &self.grid.records[slot];
            let (low, high) = self.simd.steps(&cells, &record.aabb);
            let (one, window) =
                (Seeker { slot, query: query_of(self.simd.code(low, high)) }, cells.window(low, high));
            let own: [i32; 3] = std::array::from_fn(|k| {
                let cell = low[k] >> cells.shift;
                if WRAPS { cell } else { cell.clamp(1, cells.dims[k] - 2) }
            });
            let own_row = if WRAPS { 0 } else { (window.high[0] - own[0]) as usize };
            self.slots(one, (slot + 1, self.grid.starts[record.key as usize + own_row + 1] as usize));
            if WRAPS {
                self.row(one, cells.row::<WRAPS>([own[0] + 1, own[1], own[2]], window.high[0]));
            }
            for y in own[1] + 1..=window.high[1] {
                self.row(one, cells.row::<WRAPS>([window.low[0], y, own[2]], window.high[0]));
            }
            for z in own[2] + 1..=window.high[2] {
                for y in window.low[1]..=window.high[1] {
                    self.row(one, cells.row::<WRAPS>([window.low[0], y, z], window.high[0]));
                }
            }
        }
    }

    /// Tests a row of cells.
    #[inline(always)]
    pub(super) fn row(&mut self, one: Seeker, row: [KeyRun; 2]) {
        for run in row {
            self.hits.runs += 1;
            self.slots(one, self.grid.slots(run));
        }
    }

    /// Tests a run of slots, and counts the tests.
    #[inline(always)]
    fn slots(&mut self, one: Seeker, slots: (usize, usize)) {
        self.writer.tests += (slots.1 - slots.0) as u64;
        self.rest(one, slots);
    }
}

/// Cells whose keys follow each other: the first key, and their number.
pub(super) type KeyRun = (usize, usize);

impl Grid {
    /// Returns the slots of a run of cells: the first one, and the one after the last.
    #[inline(always)]
    pub(super) fn slots(&self, (key, count): KeyRun) -> (usize, usize) {
        (self.starts[key] as usize, self.starts[key + count] as usize)
    }
}

impl Cells {
    /// Returns a row of cells, from `first` up to `last` on x. A wrapped row may be two runs; its cells are not wrapped yet.
    #[inline(always)]
    pub(super) fn row<const WRAPS: bool>(&self, first: [i32; 3], last: i32) -> [KeyRun; 2] {
        let count = (last - first[0] + 1).max(0);
        if !WRAPS {
            return [(self.key(first) as usize, count as usize), (0, 0)];
        }
        let mask = |k: usize| first[k] & (self.dims[k] - 1);
        let (x, y, z) = (mask(0), mask(1), mask(2));
        let before_border = count.min(self.dims[0] - x);
        let behind_border = (self.key([0, y, z]) as usize, (count - before_border) as usize);
        [(self.key([x, y, z]) as usize, before_border as usize), behind_border]
    }
}
