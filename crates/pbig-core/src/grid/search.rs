//! The search of a whole grid: every pair of overlapping boxes is met once, from the box whose slot comes first or whose
//! cell is lower.

use super::cells::{Cells, query_of};
use super::hits::{HitWriter, Hits, Rule};
use super::plan::NeighbourScan;
use super::record::Record;
use super::simd::{BLOCK, Kernel, Simd, dispatch};
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
        dispatch(SearchPiece { grid: self, slots, rule, hits });
    }
}

struct SearchPiece<'a, 'b> {
    grid: &'a Grid,
    slots: Range<usize>,
    rule: &'a Rule<'b>,
    hits: &'a mut Hits,
}

impl Kernel for SearchPiece<'_, '_> {
    type Output = ();

    #[inline(always)]
    unsafe fn run<S: Simd>(self) {
        let Self { grid, slots, rule, hits } = self;
        let scan = Scan { cells: grid.plan.cells, own: grid, grid, rule };
        // SAFETY: the slots are those of the grid; the caller has the instructions.
        unsafe {
            match (grid.plan.scan, grid.plan.cells.wraps) {
                (NeighbourScan::Runs, _) => scan.runs::<S>(slots, hits),
                (NeighbourScan::Windows, false) => scan.windows::<S, false>(slots, hits),
                (NeighbourScan::Windows, true) => scan.windows::<S, true>(slots, hits),
            }
        }
    }
}

/// A search for the boxes of one grid in another one of the same plan, or in itself.
pub(super) struct Scan<'a, 'b> {
    pub(super) cells: Cells,
    /// The grid with the boxes that are searched for.
    pub(super) own: &'a Grid,
    /// The grid that is searched.
    pub(super) grid: &'a Grid,
    pub(super) rule: &'a Rule<'b>,
}

impl Scan<'_, '_> {
    /// Visits five runs for each box: the rest of its row of three cells, and the four rows of three cells above it and
    /// in the next layer. The first block of a run is tested unseen: most have no second one.
    #[inline(always)]
    unsafe fn runs<S: Simd>(&self, slots: Range<usize>, hits: &mut Hits) {
        let (dx, layer) = (self.cells.dims[0] as usize, (self.cells.dims[0] * self.cells.dims[1]) as usize);
        let (starts, records) = (self.grid.starts.as_ptr(), self.grid.records.as_ptr());
        let codes = self.grid.codes.as_ptr();
        let mut writer = hits.writer();
        hits.runs += 5 * slots.len() as u64;
        for slot in slots {
            // SAFETY: the ring of border cells is never a box's own: all keys below are inside `starts`, all slots
            // inside `codes`, which has two blocks more.
            unsafe {
                let query = query_of(*codes.add(slot));
                let cell = starts.add((*records.add(slot)).key as usize);
                let row = |first: *const u32| (*first as usize, *first.add(3) as usize);
                let runs = [
                    (slot + 1, *cell.add(2) as usize),
                    row(cell.add(dx - 1)),
                    row(cell.add(layer - dx - 1)),
                    row(cell.add(layer - 1)),
                    row(cell.add(layer + dx - 1)),
                ];
                let mut longest = 0;
                for (first, end) in runs {
                    self.block::<S>(query, slot, (first, end), &mut writer);
                    writer.tests += (end - first) as u64;
                    longest = longest.max(end - first);
                }
                if longest > BLOCK {
                    for (first, end) in runs {
                        self.rest::<S>(query, slot, (first + BLOCK, end), &mut writer, hits);
                    }
                }
            }
            self.make_room::<S>(&mut writer, hits);
            if hits.is_full {
                break;
            }
        }
        self.finish::<S>(writer, hits);
    }

    /// Tests the blocks of a run that are left.
    #[inline(always)]
    unsafe fn rest<S: Simd>(
        &self,
        query: u64,
        slot: usize,
        (first, end): (usize, usize),
        writer: &mut HitWriter,
        hits: &mut Hits,
    ) {
        let mut first = first;
        while first < end {
            // SAFETY: as the caller says.
            unsafe { self.block::<S>(query, slot, (first, end), writer) };
            self.make_room::<S>(writer, hits);
            first += BLOCK;
        }
    }

    /// Tests the block from `first` on, up to `end`.
    #[inline(always)]
    unsafe fn block<S: Simd>(
        &self,
        query: u64,
        slot: usize,
        (first, end): (usize, usize),
        writer: &mut HitWriter,
    ) {
        // SAFETY: the codes are padded by two blocks of tombstones; the caller keeps the room.
        unsafe {
            let mask = S::test(query, self.grid.codes.as_ptr().add(first));
            let beyond = (end - first).min(BLOCK) as u32;
            writer.push(slot, first, mask & ((1u32 << beyond) - 1));
        }
    }

    #[inline(always)]
    fn make_room<S: Simd>(&self, writer: &mut HitWriter, hits: &mut Hits) {
        if !writer.has_room() {
            // SAFETY: hits have slots of these grids; the caller has the instructions.
            unsafe { hits.flush::<S>(writer, (&self.own.records, &self.grid.records), self.rule) };
        }
    }

    #[inline(always)]
    pub(super) fn finish<S: Simd>(&self, mut writer: HitWriter, hits: &mut Hits) {
        // SAFETY: as above.
        unsafe { hits.flush::<S>(&mut writer, (&self.own.records, &self.grid.records), self.rule) };
        hits.tests += writer.tests;
    }

    /// Visits, for each box, the cells after its own in which the lower corner of an overlapping box can lie.
    #[inline(always)]
    unsafe fn windows<S: Simd, const WRAPS: bool>(&self, slots: Range<usize>, hits: &mut Hits) {
        let cells = &self.cells;
        let mut writer = hits.writer();
        for slot in slots {
            if hits.is_full {
                break;
            }
            let record: &Record = &self.grid.records[slot];
            // SAFETY: the caller has the instructions; slots come from `starts`.
            unsafe {
                let (low, high) = S::steps(cells, &record.aabb);
                let (query, window) = (query_of(S::code(low, high)), cells.window(low, high));
                let own: [i32; 3] = std::array::from_fn(|k| {
                    let cell = low[k] >> cells.shift;
                    if WRAPS { cell } else { cell.clamp(1, cells.dims[k] - 2) }
                });
                let key = record.key as usize;
                let own_row = if WRAPS { 0 } else { (window.high[0] - own[0]) as usize };
                let rest_of_row = (slot + 1, self.grid.starts[key + own_row + 1] as usize);
                self.slots::<S>(query, slot, rest_of_row, &mut writer, hits);
                if WRAPS {
                    let row = cells.row::<WRAPS>([own[0] + 1, own[1], own[2]], window.high[0]);
                    self.row::<S>(query, slot, row, &mut writer, hits);
                }
                for y in own[1] + 1..=window.high[1] {
                    let row = cells.row::<WRAPS>([window.low[0], y, own[2]], window.high[0]);
                    self.row::<S>(query, slot, row, &mut writer, hits);
                }
                for z in own[2] + 1..=window.high[2] {
                    for y in window.low[1]..=window.high[1] {
                        let row = cells.row::<WRAPS>([window.low[0], y, z], window.high[0]);
                        self.row::<S>(query, slot, row, &mut writer, hits);
                    }
                }
            }
        }
        self.finish::<S>(writer, hits);
    }

    /// Tests a row of cells.
    #[inline(always)]
    pub(super) unsafe fn row<S: Simd>(
        &self,
        query: u64,
        slot: usize,
        row: [KeyRun; 2],
        writer: &mut HitWriter,
        hits: &mut Hits,
    ) {
        for run in row {
            hits.runs += 1;
            // SAFETY: as the caller says.
            unsafe { self.slots::<S>(query, slot, self.grid.slots(run), writer, hits) };
        }
    }

    /// Tests a run of slots, and counts the tests.
    #[inline(always)]
    unsafe fn slots<S: Simd>(
        &self,
        query: u64,
        slot: usize,
        slots: (usize, usize),
        writer: &mut HitWriter,
        hits: &mut Hits,
    ) {
        writer.tests += (slots.1 - slots.0) as u64;
        // SAFETY: as the caller says.
        unsafe { self.rest::<S>(query, slot, slots, writer, hits) };
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
