//! Find: the search over a whole map, in pieces that threads share. Every pair is met once.
//!
//! The search walks the sorted entries, never the cells. Each entry meets
//! 1. in its own grid the half of its window that comes after it (`half`),
//! 2. in the grids of larger boxes the whole window (`check`),
//! 3. the boxes of the list;
//!
//! and the list meets itself.

use super::check::Checker;
use super::entries::Query;
use super::half::Half;
use super::map::Map;
use crate::plan::OPEN;
use crate::report::stage;
use crate::{Aabb, Error, Pair, ProxyFilter};
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};

/// Entries in one piece of work: enough to hide the cost of handing it out (a few us against 50),
/// few enough to balance; fixed, so that the bytes of the result do not depend on the threads.
const CHUNK: usize = 1024;

/// Expected time of a search, in ns on one core, from which it is shared with other threads. In a
/// tight loop 150,000 pay off (4,096 unit cubes: 0.14 ms alone, 0.10 with a second thread), but in an
/// app the other threads sleep between steps and waking one costs about as much.
const PARALLEL_FROM: u64 = 500_000;

/// What an entry costs, and a check, in ns; checks as many as in the call before.
const ENTRY: u64 = 35;
const CHECK: u64 = 1;

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

    /// Sets the `i`-th buffer.
    #[cfg(feature = "gpu")]
    pub(crate) fn put(&mut self, i: usize, pairs: Vec<Pair>) {
        match self.chunks.get_mut(i) {
            Some(chunk) => *chunk = pairs,
            None => self.chunks.push(pairs),
        }
    }

    /// Makes `chunks` have at least `n` buffers, all empty, and returns the first `n`.
    pub(crate) fn buffers(&mut self, n: usize) -> &mut [Vec<Pair>] {
        self.clear();
        self.chunks.resize(n.max(self.chunks.len()), Vec::new());
        &mut self.chunks[..n]
    }
}

impl Map {
    /// All pairs of overlapping boxes in the map that `accept` takes, into `found`.
    pub(crate) fn find<A>(&self, accept: &A, max_pairs: u64, found: &mut Found) -> Result<(), Error>
    where
        A: Fn(u32, u32) -> bool + Sync,
    {
        stage!("check");
        let chunks = self.chunks();
        let room = Room::new(max_pairs);
        let work = |(chunk, out): (&Chunk, &mut Vec<Pair>)| self.check_chunk(chunk, accept, out, &room);
        let in_list = (self.list.len() as u64).pow(2) / 2;
        let expected = ENTRY * self.len_in_grids() as u64 + CHECK * found.checks.max(in_list);
        let buffers = found.buffers(chunks.len());
        let counts = if expected >= PARALLEL_FROM && rayon::current_num_threads() > 1 {
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
        let grids = self.grids.iter().enumerate().flat_map(|(i, g)| pieces(Some(i), g.len()));
        grids.chain(pieces(None, self.list.len())).collect()
    }

    fn check_chunk<A>(&self, chunk: &Chunk, accept: &A, out: &mut Vec<Pair>, room: &Room) -> (u64, u64)
    where
        A: Fn(u32, u32) -> bool,
    {
        let range = chunk.start..chunk.end;
        let mut counts = (0, 0);
        if let Some(level) = chunk.level.filter(|&level| self.grids[level].camp == OPEN) {
            let mut half = Half::new(&self.grids[level], accept, out, room);
            let room_left = half.check(range.clone());
            counts = (half.checks, half.overlaps);
            if !room_left {
                return counts;
            }
        }
        if chunk.level.is_some_and(|level| level + 1 == self.grids.len() && self.list.len() == 0) {
            return counts;
        }
        let mut taken = out.len();
        let mut checker = Checker::new(accept, out);
        for i in range {
            match chunk.level {
                Some(level) => self.check_larger(level, i, &mut checker),
                None => {
                    let (query, id) = (self.list.boxes[i].query(), self.list.ids[i]);
                    checker.test(&query, id, &self.list, i + 1..self.list.len());
                }
            }
            if !room.take(checker.out.len(), &mut taken) {
                break;
            }
        }
        add(counts, (checker.checks, checker.overlaps))
    }

    /// Entry `i` of a level against the boxes of larger levels and of the list.
    #[inline]
    fn check_larger<A: Fn(u32, u32) -> bool>(&self, level: usize, i: usize, checker: &mut Checker<'_, A>) {
        let entries = &self.grids[level].entries;
        let (stored, id) = (&entries.boxes[i], entries.ids[i]);
        let own = self.grids[level].camp;
        for larger in self.grids[level + 1..].iter().filter(|grid| grid.camp == OPEN || grid.camp != own) {
            larger.check_window(&stored.aabb(), id, checker);
        }
        checker.test(&stored.query(), id, &self.list, 0..self.list.len());
    }

    /// Every pair of `one` with a box of the map that overlaps it, whatever its size, and that its filter may allow.
    pub(crate) fn check_one<A>(&self, one: &Aabb, filter: &ProxyFilter, id: u32, checker: &mut Checker<'_, A>)
    where
        A: Fn(u32, u32) -> bool,
    {
        let own = if self.has_camps() { self.camps.camp(filter) } else { OPEN };
        for grid in self.grids.iter().filter(|grid| grid.camp == OPEN || grid.camp != own) {
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
