//! Check: candidates against the exact test, equation 1 of PBIG, a run of entries at a time.

use super::entries::{Entries, Query};
use super::judge::Accept;
use crate::Pair;
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

impl<'a, A: Accept> Checker<'a, A> {
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
            // A box and itself is no pair.
            if self.accept.meets(id, other) && self.accept.pair(Pair::new(id, other)) {
                self.out.push(Pair::new(id, other));
            }
        }
    }
}
