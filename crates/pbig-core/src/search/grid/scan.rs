//! The search of all boxes in cells: every pair of overlapping boxes is met once. In one grid it is met from the box whose slot comes
//! first or whose cell is lower.

use super::Grid;
use super::cells::{Cells, Window};
use crate::parallel::run_with;
use crate::policy::search::{WORK_OF_ROW, WORK_OF_RUNS};
use crate::search::hits::{CHARGED_FROM, HIT_ROOM, HitWriter, Hits, Record, Rule};
use crate::simd::{BLOCK, Portable, Simd, dispatch, query_of};
use crate::{Aabb, NeighbourScan};
use std::ops::Range;

/// Number of boxes in a piece of work. It does not follow the threads, because the work of a piece is charged to the budget.
const PIECE: usize = 512;

/// Number of oversize boxes in a piece of work.
const OVERSIZE_PIECE: usize = 4;

/// Boxes in cells. Boxes of one set meet each other. Those of two sets lie in two grids of one plan, and no two boxes of a set meet.
#[derive(Clone, Copy)]
pub(crate) struct Sorted<'a> {
    /// The grid whose boxes are searched for: of two, the one with fewer boxes. These may lie in their buckets only, see
    /// [`TwoGrids::build`](super::TwoGrids::build).
    pub(super) own: &'a Grid,
    /// The grid of another set, in whose cells all its boxes lie.
    pub(super) other: Option<&'a Grid>,
}

/// An oversize box, the grid that it is searched for in, and other oversize boxes that it is tested against.
type Oversize<'a> = (&'a Record, &'a Grid, &'a [Record]);

impl<'a> Sorted<'a> {
    pub(super) fn searched(&self) -> &'a Grid {
        self.other.unwrap_or(self.own)
    }

    pub(crate) fn boxes(&self) -> usize {
        self.own.len + self.other.map_or(0, |other| other.len) + self.oversize_count()
    }

    pub(crate) fn oversize_count(&self) -> usize {
        self.own.oversize.len() + self.other.map_or(0, |other| other.oversize.len())
    }

    /// Returns an oversize box. One of `own` comes first, and meets those of the other set, or those of its own set after it.
    pub(super) fn oversize(&self, i: usize) -> Oversize<'a> {
        let own = &self.own.oversize;
        match self.other {
            None => (&own[i], self.own, &own[i + 1..]),
            Some(other) if i < own.len() => (&own[i], other, &other.oversize),
            Some(other) => (&other.oversize[i - own.len()], self.own, &[]),
        }
    }

    /// Finds all pairs, into the lists of as many threads as there are `hits`.
    pub(crate) fn search(&self, rule: &Rule<'_>, hits: &mut [Hits]) {
        let (len, oversize) = (self.own.len, self.oversize_count());
        let in_grid = len.div_ceil(PIECE);
        run_with(hits, in_grid + oversize.div_ceil(OVERSIZE_PIECE), |hits, i| {
            if i < in_grid {
                let slots = i * PIECE..len.min((i + 1) * PIECE);
                if !hits.is_full {
                    dispatch!(search_piece, self, slots.clone(), rule, hits);
                }
                return hits.charge(rule.budget);
            }
            let first = (i - in_grid) * OVERSIZE_PIECE;
            (first..oversize.min(first + OVERSIZE_PIECE)).for_each(|i| self.search_oversize(i, rule, hits));
        });
    }

    fn search_oversize(&self, i: usize, rule: &Rule<'_>, hits: &mut Hits) {
        if hits.is_full {
            return;
        }
        let (one, grid, others) = self.oversize(i);
        let mut from = hits.found.pairs.len();
        grid.reached_by(&one.aabb, |run| {
            let (first, end) = grid.slots(run);
            hits.extra += WORK_OF_ROW;
            from = hits.test_part(one, &grid.records[first..end], from, rule);
        });
        from = hits.test_part(one, others, from, rule);
        hits.keep(from, rule);
        hits.charge(rule.budget);
    }
}

impl Grid {
    /// Returns the codes of eight slots.
    ///
    /// # Safety
    /// `first` is at most the number of slots in use: two blocks of tombstones are behind these.
    #[inline(always)]
    unsafe fn block(&self, first: usize) -> &[u64; BLOCK] {
        debug_assert!(first <= self.len);
        // SAFETY: the caller's promise.
        unsafe { &*self.codes.as_ptr().add(first).cast() }
    }
}

#[inline(always)]
fn search_piece(simd: impl Simd, sorted: &Sorted<'_>, slots: Range<usize>, rule: &Rule<'_>, hits: &mut Hits) {
    let mut blocks = [0; HIT_ROOM];
    let writer = HitWriter::new(&mut blocks);
    let (own, grid) = (sorted.own, sorted.searched());
    let mut scan = Scan { simd, cells: grid.cells, own, grid, rule, hits, writer };
    match (sorted.other, grid.cells.scan, grid.cells.wraps) {
        (None, NeighbourScan::Runs, _) => scan.runs(slots),
        (None, NeighbourScan::Windows, false) => scan.windows::<false>(slots),
        (None, NeighbourScan::Windows, true) => scan.windows::<true>(slots),
        (Some(_), _, false) => scan.across::<false>(slots),
        (Some(_), _, true) => scan.across::<true>(slots),
    }
    scan.finish();
}

/// A search for the boxes of one grid in another one of the same plan, or in itself.
struct Scan<'a, 'b, S> {
    simd: S,
    cells: Cells,
    /// The grid with the boxes that are searched for.
    own: &'a Grid,
    /// The grid that is searched.
    grid: &'a Grid,
    rule: &'a Rule<'b>,
    hits: &'a mut Hits,
    writer: HitWriter<'a>,
}

/// A box that is searched for: its slot, and the query that finds its partners.
#[derive(Clone, Copy)]
struct Seeker {
    slot: usize,
    query: u64,
}

impl<S: Simd> Scan<'_, '_, S> {
    /// Visits five runs for each box: the rest of its row of three cells, and the four rows of three cells above it and
    /// in the next layer.
    #[inline(always)]
    fn runs(&mut self, slots: Range<usize>) {
        let (dx, layer) = (self.cells.dims[0] as usize, (self.cells.dims[0] * self.cells.dims[1]) as usize);
        let Grid { starts, records, codes, .. } = self.grid;
        self.writer.rows += slots.len() as u64 * WORK_OF_RUNS;
        for slot in slots {
            let key = records[slot].key as usize;
            // SAFETY: the ring of border cells is never a box's own, so `starts` has all keys below.
            let start = |key: usize| unsafe { *starts.get_unchecked(key) as usize };
            let row = |key: usize| (start(key), start(key + 3));
            let (above, next) = (key + dx - 1, key + layer - 1);
            let runs = [(slot + 1, start(key + 2)), row(above), row(next - dx), row(next), row(next + dx)];
            // SAFETY: each begins at a start, or at `slot + 1`: at most the number of slots.
            unsafe { self.few(Seeker { slot, query: query_of(codes[slot]) }, runs) };
            if self.is_over() {
                break;
            }
        }
    }

    /// Tests a few runs of slots. The first block of each is tested unseen: most have no second one.
    ///
    /// # Safety
    /// Each run begins at most at the number of slots in use.
    #[inline(always)]
    unsafe fn few<const N: usize>(&mut self, one: Seeker, runs: [(usize, usize); N]) {
        let mut longest = 0;
        for (first, end) in runs {
            // SAFETY: the caller's promise.
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
    }

    /// Tests the slots from `first` up to `end`.
    #[inline(always)]
    fn rest(&mut self, one: Seeker, (mut first, end): (usize, usize)) {
        // Not `step_by`, which counts its steps first: mixed sizes took 8% longer.
        while first < end {
            // SAFETY: `first` is below an end that comes from `starts`.
            let block = unsafe { self.grid.block(first) };
            self.test(one, block, (first, end));
            self.make_room();
            first += BLOCK;
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
    fn finish(&mut self) {
        let records = (&self.own.records[..], &self.grid.records[..]);
        self.hits.flush(self.simd, &mut self.writer, records, self.rule);
        self.hits.tests += std::mem::take(&mut self.writer.tests);
        self.hits.extra += std::mem::take(&mut self.writer.rows);
    }

    /// Charges much work at once. Returns true if no more pairs are wanted.
    #[inline(always)]
    fn is_over(&mut self) -> bool {
        if self.writer.tests + self.writer.rows > CHARGED_FROM {
            self.finish();
            self.hits.charge(self.rule.budget);
        }
        self.hits.is_full
    }

    /// Visits, for each box, the cells after its own in which the lower corner of an overlapping box can lie.
    #[inline(always)]
    fn windows<const WRAPS: bool>(&mut self, slots: Range<usize>) {
        let cells = self.cells;
        for slot in slots {
            if self.is_over() {
                break;
            }
            let record: &Record = &self.grid.records[slot];
            let (low, high) = cells.steps(self.simd, &record.aabb);
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

    /// Visits, for each box, the cells of the other grid in which the lower corner of an overlapping box can lie.
    #[inline(always)]
    fn across<const WRAPS: bool>(&mut self, slots: Range<usize>) {
        let cells = self.cells;
        for slot in slots {
            if self.is_over() {
                break;
            }
            let (low, high) = cells.steps(self.simd, &self.own.records[slot].aabb);
            let one = Seeker { slot, query: query_of(self.simd.code(low, high)) };
            let window = cells.window(low, high);
            if !WRAPS && window.high[1] - window.low[1] < 2 && window.high[2] - window.low[2] < 2 {
                self.four_rows(one, &window);
                continue;
            }
            for z in window.low[2]..=window.high[2] {
                for y in window.low[1]..=window.high[1] {
                    self.row(one, cells.row::<WRAPS>([window.low[0], y, z], window.high[0]));
                }
            }
        }
    }

    /// Tests a window of up to two rows in up to two layers, as most are. Rows that it lacks are empty: no branch depends on where the
    /// box lies.
    #[inline(always)]
    fn four_rows(&mut self, one: Seeker, &Window { low, high }: &Window) {
        let count = (high[0] - low[0] + 1) as usize;
        let row = |y: i32, z: i32, is_there: bool| {
            let key = self.cells.key([low[0], y, z]) as usize;
            self.grid.slots((key, if is_there { count } else { 0 }))
        };
        let (is_higher, is_deeper) = (high[1] > low[1], high[2] > low[2]);
        let runs = [
            row(low[1], low[2], true),
            row(high[1], low[2], is_higher),
            row(low[1], high[2], is_deeper),
            row(high[1], high[2], is_higher & is_deeper),
        ];
        self.writer.rows += WORK_OF_RUNS;
        // SAFETY: each begins at a start: at most the number of slots.
        unsafe { self.few(one, runs) };
    }

    #[inline(always)]
    fn row(&mut self, one: Seeker, row: [KeyRun; 2]) {
        self.writer.rows += WORK_OF_ROW;
        for run in row {
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

    /// Visits the cells in which boxes can lie that overlap a box of any size.
    pub(super) fn reached_by(&self, aabb: &Aabb, mut visit: impl FnMut(KeyRun)) {
        let cells = &self.cells;
        let (low, high) = cells.steps(Portable, aabb);
        let window = cells.window(low, high).clipped(cells);
        for z in window.low[2]..=window.high[2] {
            if cells.are_whole_rows(&window) {
                visit(cells.layer(&window, z));
                continue;
            }
            for y in window.low[1]..=window.high[1] {
                let (first, last) = ([window.low[0], y, z], window.high[0]);
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

    /// Returns true if a window has all cells of its rows, so that its rows in a layer follow each other.
    fn are_whole_rows(&self, window: &Window) -> bool {
        let [first, last] = if self.wraps { [0, self.dims[0] - 1] } else { [1, self.dims[0] - 2] };
        let is_aligned = !self.wraps || window.low[1] >= 0 && window.high[1] < self.dims[1];
        window.low[0] <= first && window.high[0] >= last && is_aligned
    }

    /// Returns all rows of a window in a layer as one run: the border cells between them are empty.
    fn layer(&self, window: &Window, z: i32) -> KeyRun {
        let z = if self.wraps { z & (self.dims[2] - 1) } else { z };
        let first = self.key([0, window.low[1], z]) as usize;
        (first, self.key([self.dims[0] - 1, window.high[1], z]) as usize + 1 - first)
    }
}
