//! Check: candidates against the exact test, equation 1 of PBIG, a run of entries at a time.

use super::entries::{Entries, Query};
use super::map::Grid;
use crate::{Aabb, Pair};
use std::ops::Range;

/// Tests boxes against runs of candidates, and takes those that overlap and are accepted.
pub(crate) struct Checker<'a, A> {
    /// Whether an overlapping pair of ids is to be reported (filters, changes).
    accept: &'a A,
    pub(crate) out: &'a mut Vec<Pair>,
    pub(crate) checks: u64,
    pub(crate) overlaps: u64,
}

/// Candidates whose results are looked at together: most blocks of a sweep have no hit, so that one
/// well predicted branch does for all.
const BLOCK: usize = 8;

impl<'a, A: Fn(u32, u32) -> bool> Checker<'a, A> {
    pub(crate) fn new(accept: &'a A, out: &'a mut Vec<Pair>) -> Self {
        Self { accept, out, checks: 0, overlaps: 0 }
    }

    /// Tests the box `id` against the entries in `run`.
    #[inline(always)]
    pub(crate) fn test(&mut self, query: &Query, id: u32, entries: &Entries, run: Range<usize>) {
        let (candidates, ids) = (&entries.boxes[run.start..run.end], &entries.ids[run.start..run.end]);
        self.checks += candidates.len() as u64;
        for (block, ids) in candidates.chunks(BLOCK).zip(ids.chunks(BLOCK)) {
            let mut mask = 0u32;
            for (bit, candidate) in block.iter().enumerate() {
                mask |= u32::from(candidate.overlaps(query)) << bit;
            }
            if mask != 0 {
                self.take(id, ids, mask);
            }
        }
    }

    fn take(&mut self, id: u32, ids: &[u32], mut mask: u32) {
        self.overlaps += u64::from(mask.count_ones());
        while mask != 0 {
            let other = ids[mask.trailing_zeros() as usize];
            mask &= mask - 1;
            if (self.accept)(id, other) {
                self.out.push(Pair::new(id, other));
            }
        }
    }
}

impl Grid {
    /// Any box against every entry whose box it may overlap, each once.
    pub(crate) fn check_window<A: Fn(u32, u32) -> bool>(
        &self,
        one: &Aabb,
        id: u32,
        checker: &mut Checker<'_, A>,
    ) {
        let query = Query::new(one);
        let (low, high) = self.cells.window(one);
        let wide: [i64; 3] = std::array::from_fn(|k| high[k] - low[k] + 1);
        // A window that wraps onto itself would meet entries twice; one with more rows than there
        // are entries is slower than a sweep.
        let wraps = (0..3).any(|k| wide[k] > i64::from(self.cells.dims[k]));
        if wraps || wide[1] * wide[2] > self.len() as i64 {
            return checker.test(&query, id, &self.entries, 0..self.len());
        }
        for z in low[2]..=high[2] {
            for y in low[1]..=high[1] {
                let key = self.cells.key([low[0], y, z]);
                self.test_row(checker, &query, id, key, wide[0] as u32);
            }
        }
    }

    /// The entries in `length` consecutive cells from `key` on; keys wrap around, and rows of large
    /// boxes can be longer than there are ghosts.
    #[inline(always)]
    fn test_row<A: Fn(u32, u32) -> bool>(
        &self,
        checker: &mut Checker<'_, A>,
        query: &Query,
        id: u32,
        key: u32,
        length: u32,
    ) {
        let (cells, start, end) = (self.cell_count(), self.starts[key as usize] as usize, key + length);
        checker.test(query, id, &self.entries, start..self.starts[end.min(cells) as usize] as usize);
        if end > cells {
            let rest = self.starts[(end - cells) as usize] as usize;
            checker.test(query, id, &self.entries, 0..rest);
        }
    }
}
