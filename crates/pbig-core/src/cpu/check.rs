//! Check: candidates against the exact test, equation 1 of PBIG. Every pair is met once.
//!
//! The search walks the sorted entries, never the cells. Each entry meets
//! 1. in its own grid the half of its window that comes after it,
//! 2. in the grids of larger boxes the whole window,
//! 3. the boxes of the list;
//!
//! and the list meets itself.

use super::map::{Entries, Grid, Map, Query};
use crate::{Aabb, Error, Pair};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

/// Entries in one piece of work: enough to hide the cost of handing it out (a few us against 100),
/// few enough to balance; fixed, so that the bytes of the result do not depend on the threads.
const CHUNK: usize = 4096;

/// Below this many entries a second thread costs more than it saves (measured: 20k boxes gain
/// 1.3x, 5k lose).
const PARALLEL_FROM: usize = 16_384;

/// Pairs as found, a buffer for each chunk, kept from call to call.
#[derive(Clone, Debug, Default)]
pub(crate) struct Found {
    pub(crate) chunks: Vec<Vec<Pair>>,
    pub(crate) checks: u64,
    /// Overlapping pairs met, whether accepted or not.
    pub(crate) overlaps: u64,
}

impl Found {
    /// Accepted pairs.
    pub(crate) fn len(&self) -> usize {
        self.chunks.iter().map(Vec::len).sum()
    }

    pub(crate) fn clear(&mut self) {
        self.chunks.iter_mut().for_each(Vec::clear);
        (self.checks, self.overlaps) = (0, 0);
    }

    /// Makes `chunks` have at least `n` buffers, all empty, and returns the first `n`.
    pub(crate) fn buffers(&mut self, n: usize) -> &mut [Vec<Pair>] {
        self.clear();
        self.chunks.resize(n.max(self.chunks.len()), Vec::new());
        &mut self.chunks[..n]
    }
}

/// Tests boxes against runs of candidates, and takes those that overlap and are accepted.
pub(crate) struct Checker<'a, A> {
    /// Whether an overlapping pair of ids is to be reported (filters, changes).
    accept: &'a A,
    pub(crate) out: &'a mut Vec<Pair>,
    pub(crate) checks: u64,
    pub(crate) overlaps: u64,
    /// Places of the overlapping boxes of a run; longer than any run so far.
    hits: Vec<u32>,
}

impl<'a, A: Fn(u32, u32) -> bool> Checker<'a, A> {
    pub(crate) fn new(accept: &'a A, out: &'a mut Vec<Pair>) -> Self {
        Self { accept, out, checks: 0, overlaps: 0, hits: Vec::new() }
    }

    /// Tests the box `id` against the entries in `run`.
    ///
    /// In two passes: whether a candidate overlaps is a coin toss that no branch predictor wins, so
    /// the first appends without a branch.
    #[inline(always)]
    pub(crate) fn test(&mut self, query: &Query, id: u32, entries: &Entries, run: Range<usize>) {
        let candidates = &entries.boxes[run.start..run.end];
        self.checks += candidates.len() as u64;
        if self.hits.len() < candidates.len() {
            self.hits.resize(candidates.len(), 0);
        }
        let hits = &mut self.hits[..candidates.len()];
        let mut count = 0;
        for (i, candidate) in candidates.iter().enumerate() {
            hits[count] = i as u32;
            count += usize::from(candidate.overlaps(query));
        }
        if count > 0 {
            self.take(id, &entries.ids[run.start..run.end], count);
        }
    }

    #[inline]
    fn take(&mut self, id: u32, ids: &[u32], count: usize) {
        self.overlaps += count as u64;
        for &hit in &self.hits[..count] {
            let other = ids[hit as usize];
            if (self.accept)(id, other) {
                self.out.push(Pair::new(id, other));
            }
        }
    }
}

impl Grid {
    /// The entries in `length` consecutive cells from `key` on; keys wrap around.
    #[inline(always)]
    fn test_cells<A: Fn(u32, u32) -> bool>(
        &self,
        checker: &mut Checker<'_, A>,
        query: &Query,
        id: u32,
        key: u32,
        length: u32,
    ) {
        let cells = self.starts.len() as u32 - 1;
        let (start, end) = (self.starts[key as usize] as usize, key + length);
        if end <= cells {
            checker.test(query, id, &self.entries, start..self.starts[end as usize] as usize);
        } else {
            self.test_around_the_end(checker, query, id, start, end - cells);
        }
    }

    #[cold]
    fn test_around_the_end<A: Fn(u32, u32) -> bool>(
        &self,
        checker: &mut Checker<'_, A>,
        query: &Query,
        id: u32,
        start: usize,
        cells: u32,
    ) {
        checker.test(query, id, &self.entries, start..self.entries.len());
        checker.test(query, id, &self.entries, 0..self.starts[cells as usize] as usize);
    }

    /// Entry `i` against the half of its window that comes after it: the rest of its row, the rows
    /// above in its layer, and the rows of the layers above.
    #[inline(always)]
    fn check_half<A: Fn(u32, u32) -> bool>(&self, i: usize, checker: &mut Checker<'_, A>) {
        let (query, id, key, span) = (self.entries.boxes[i].query(), self.entries.ids[i], self.keys[i], self.spans[i]);
        let cells = &self.cells;
        checker.test(&query, id, &self.entries, i + 1..self.starts[key as usize + 1] as usize);
        if span.up_x() > 0 {
            self.test_cells(checker, &query, id, cells.wrap(key + 1), span.up_x());
        }
        let row = key.wrapping_sub(span.down_x());
        let length = span.down_x() + span.up_x() + 1;
        for y in 1..=span.up_y() {
            let key = cells.wrap(row.wrapping_add(y * cells.stride_y));
            self.test_cells(checker, &query, id, key, length);
        }
        for z in 1..=span.up_z() {
            let mut key = row.wrapping_add(z * cells.stride_z).wrapping_sub(span.down_y() * cells.stride_y);
            for _ in 0..=span.down_y() + span.up_y() {
                self.test_cells(checker, &query, id, cells.wrap(key), length);
                key = key.wrapping_add(cells.stride_y);
            }
        }
    }

    /// Any box against every entry whose box it may overlap, each once.
    pub(crate) fn check_window<A: Fn(u32, u32) -> bool>(
        &self,
        one: &Aabb,
        id: u32,
        checker: &mut Checker<'_, A>,
    ) {
        let query = Query::new(one);
        let (low, high) = self.window(one);
        let wide: [i64; 3] = std::array::from_fn(|k| i64::from(high[k]) - i64::from(low[k]) + 1);
        // A window that wraps onto itself would meet entries twice; one with more rows than there
        // are entries is slower than a sweep.
        let wraps = (0..3).any(|k| wide[k] > i64::from(self.cells.dims[k]));
        if wraps || wide[1] * wide[2] > self.entries.len() as i64 {
            return checker.test(&query, id, &self.entries, 0..self.entries.len());
        }
        for z in low[2]..=high[2] {
            for y in low[1]..=high[1] {
                let key = self.cells.key([low[0], y, z]);
                self.test_cells(checker, &query, id, key, wide[0] as u32);
            }
        }
    }
}

impl Map {
    /// All pairs of overlapping boxes in the map that `accept` takes, into `found`.
    pub(crate) fn find<A>(&self, accept: &A, max_pairs: u64, found: &mut Found) -> Result<(), Error>
    where
        A: Fn(u32, u32) -> bool + Sync,
    {
        let chunks = self.chunks();
        let room = Room::new(max_pairs);
        let work = |(chunk, out): (&Chunk, &mut Vec<Pair>)| self.check_chunk(chunk, accept, out, &room);
        let buffers = found.buffers(chunks.len());
        let size = self.len_in_grids() + self.list.len() * self.list.len() / 64;
        let counts = if size >= PARALLEL_FROM && rayon::current_num_threads() > 1 {
            chunks.par_iter().zip(buffers).map(work).reduce(|| (0, 0), add)
        } else {
            chunks.iter().zip(buffers).map(work).fold((0, 0), add)
        };
        (found.checks, found.overlaps) = counts;
        room.settle(found)
    }

    fn chunks(&self) -> Vec<Chunk> {
        let pieces = |level: Option<usize>, len: usize| {
            (0..len).step_by(CHUNK).map(move |start| Chunk { level, start, end: len.min(start + CHUNK) })
        };
        let grids = self.grids.iter().enumerate().flat_map(|(i, g)| pieces(Some(i), g.entries.len()));
        grids.chain(pieces(None, self.list.len())).collect()
    }

    fn check_chunk<A>(&self, chunk: &Chunk, accept: &A, out: &mut Vec<Pair>, room: &Room) -> (u64, u64)
    where
        A: Fn(u32, u32) -> bool,
    {
        let mut checker = Checker::new(accept, out);
        let mut taken = 0;
        for i in chunk.start..chunk.end {
            match chunk.level {
                Some(level) => self.check_entry(level, i, &mut checker),
                None => {
                    let (query, id) = (self.list.boxes[i].query(), self.list.ids[i]);
                    checker.test(&query, id, &self.list, i + 1..self.list.len());
                }
            }
            if !room.take(checker.out.len(), &mut taken) {
                break;
            }
        }
        (checker.checks, checker.overlaps)
    }

    #[inline(always)]
    fn check_entry<A: Fn(u32, u32) -> bool>(&self, level: usize, i: usize, checker: &mut Checker<'_, A>) {
        let grid = &self.grids[level];
        grid.check_half(i, checker);
        let (stored, id) = (&grid.entries.boxes[i], grid.entries.ids[i]);
        for larger in &self.grids[level + 1..] {
            larger.check_window(&stored.aabb(), id, checker);
        }
        if self.list.len() > 0 {
            checker.test(&stored.query(), id, &self.list, 0..self.list.len());
        }
    }

    /// Every pair of `one` with a box of the map that overlaps it, whatever its size.
    pub(crate) fn check_one<A>(&self, one: &Aabb, id: u32, checker: &mut Checker<'_, A>)
    where
        A: Fn(u32, u32) -> bool,
    {
        for grid in &self.grids {
            grid.check_window(one, id, checker);
        }
        checker.test(&Query::new(one), id, &self.list, 0..self.list.len());
    }
}

fn add(a: (u64, u64), b: (u64, u64)) -> (u64, u64) {
    (a.0 + b.0, a.1 + b.1)
}

/// Consecutive entries of one grid, or of the list.
struct Chunk {
    level: Option<usize>,
    start: usize,
    end: usize,
}

/// How many pairs may still be found, across threads: the limit is noticed while pairs are found,
/// before memory is exhausted.
pub(crate) struct Room {
    used: AtomicU64,
    limit: u64,
}

impl Room {
    /// Pairs that a buffer gathers before it accounts for them: the counter is shared by threads,
    /// and touching it for every box would cost more than the search.
    const BATCH: usize = 4096;

    pub(crate) fn new(limit: u64) -> Self {
        Self { used: AtomicU64::new(0), limit }
    }

    /// Accounts for a buffer that has grown from `taken` to `len`; false when the limit is passed.
    #[inline(always)]
    pub(crate) fn take(&self, len: usize, taken: &mut usize) -> bool {
        if len - *taken < Self::BATCH {
            return true;
        }
        let more = (len - *taken) as u64;
        *taken = len;
        self.used.fetch_add(more, Ordering::Relaxed) + more <= self.limit
    }

    /// Whether all that was found is within the limit.
    pub(crate) fn settle(&self, found: &Found) -> Result<(), Error> {
        if found.len() as u64 > self.limit { Err(Error::TooManyPairs { limit: self.limit }) } else { Ok(()) }
    }
}
