//! Check: candidates against the exact test, equation 1 of PBIG. Every pair is met once.
//!
//! The search walks the sorted entries, never the cells. Each entry meets
//! 1. in its own grid the half of its window that comes after it,
//! 2. in the grids of larger boxes the whole window,
//! 3. the boxes of the list;
//!
//! and the list meets itself.

use super::map::{Entry, Grid, Map};
use crate::{Aabb, Error, Pair};
use rayon::prelude::*;
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

/// Tests one box against others, counting.
pub(crate) struct Checker<'a, A> {
    /// Whether an overlapping pair of ids is to be reported (filters, changes).
    pub(crate) accept: &'a A,
    pub(crate) out: &'a mut Vec<Pair>,
    pub(crate) checks: u64,
    pub(crate) overlaps: u64,
}

impl<A: Fn(u32, u32) -> bool> Checker<'_, A> {
    #[inline(always)]
    pub(crate) fn test(&mut self, one: &Aabb, id: u32, others: &[Entry]) {
        self.checks += others.len() as u64;
        for other in others {
            if one.overlaps(&other.aabb) {
                self.overlaps += 1;
                if (self.accept)(id, other.id) {
                    self.out.push(Pair::new(id, other.id));
                }
            }
        }
    }
}

impl Grid {
    /// The entries in `length` consecutive cells from `key` on, in at most two pieces because keys
    /// wrap around.
    #[inline(always)]
    fn run(&self, key: u32, length: u32, mut visit: impl FnMut(&[Entry])) {
        let cells = self.starts.len() as u32 - 1;
        let (start, end) = (key as usize, key + length);
        if end <= cells {
            visit(&self.entries[self.starts[start] as usize..self.starts[end as usize] as usize]);
        } else {
            visit(&self.entries[self.starts[start] as usize..]);
            visit(&self.entries[..self.starts[(end - cells) as usize] as usize]);
        }
    }

    /// Entry `i` against the half of its window that comes after it: the rest of its row, the rows
    /// above in its layer, and the rows of the layers above.
    #[inline(always)]
    fn check_half<A: Fn(u32, u32) -> bool>(&self, i: usize, checker: &mut Checker<'_, A>) {
        let (entry, span) = (self.entries[i], self.spans[i]);
        let (one, id, cells) = (&entry.aabb, entry.id, &self.cells);
        let own_end = self.starts[entry.key as usize + 1] as usize;
        checker.test(one, id, &self.entries[i + 1..own_end]);
        if span.up_x() > 0 {
            let next = cells.wrap(entry.key + 1);
            self.run(next, span.up_x(), |others| checker.test(one, id, others));
        }
        let row = entry.key.wrapping_sub(span.down_x());
        let length = span.down_x() + span.up_x() + 1;
        for y in 1..=span.up_y() {
            let key = cells.wrap(row.wrapping_add(y * cells.stride_y));
            self.run(key, length, |others| checker.test(one, id, others));
        }
        for z in 1..=span.up_z() {
            let mut key = row.wrapping_add(z * cells.stride_z).wrapping_sub(span.down_y() * cells.stride_y);
            for _ in 0..=span.down_y() + span.up_y() {
                self.run(cells.wrap(key), length, |others| checker.test(one, id, others));
                key = key.wrapping_add(cells.stride_y);
            }
        }
    }

    /// Any box against every entry whose box it may overlap, each once.
    pub(crate) fn check_window<A: Fn(u32, u32) -> bool>(&self, one: &Aabb, id: u32, checker: &mut Checker<'_, A>) {
        let (low, high) = self.window(one);
        let wide: [i64; 3] = std::array::from_fn(|k| i64::from(high[k]) - i64::from(low[k]) + 1);
        // A window that wraps onto itself would meet entries twice; one with more rows than there
        // are entries is slower than a sweep. `CHUNK` keeps the comparison from being exact.
        let wraps = (0..3).any(|k| wide[k] > i64::from(self.cells.dims[k]));
        if wraps || wide[1] * wide[2] > self.entries.len() as i64 {
            return checker.test(one, id, &self.entries);
        }
        for z in low[2]..=high[2] {
            for y in low[1]..=high[1] {
                let key = self.cells.key([low[0], y, z]);
                self.run(key, wide[0] as u32, |others| checker.test(one, id, others));
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
        let mut checker = Checker { accept, out, checks: 0, overlaps: 0 };
        let mut taken = 0;
        for i in chunk.start..chunk.end {
            match chunk.level {
                Some(level) => self.check_entry(level, i, &mut checker),
                None => {
                    let entry = self.list[i];
                    checker.test(&entry.aabb, entry.id, &self.list[i + 1..]);
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
        let Entry { aabb, id, .. } = grid.entries[i];
        for larger in &self.grids[level + 1..] {
            larger.check_window(&aabb, id, checker);
        }
        checker.test(&aabb, id, &self.list);
    }

    /// Every pair of `one` with a box of the map that overlaps it, whatever its size.
    pub(crate) fn check_one<A>(&self, one: &Aabb, id: u32, checker: &mut Checker<'_, A>)
    where
        A: Fn(u32, u32) -> bool,
    {
        for grid in &self.grids {
            grid.check_window(one, id, checker);
        }
        checker.test(one, id, &self.list);
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
