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
