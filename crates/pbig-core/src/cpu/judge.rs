//! Judge: candidates against the exact test, equation 1 of PBIG, and those that pass into pairs.
//!
//! The scan of codes leaves *hits*, blocks with a bit for each candidate. They are judged many at a time: first all are
//! expanded, which asks for the memory of each record, then all are tested, when it has come. (Tested at once, each would
//! wait for its record: 6 ms instead of 2.4 for the movers of a million boxes.) Tests have no branches: a pair is written,
//! and kept or overwritten by the next one.

use super::codes::{BLOCK, prefetch};
use super::found::Room;
use super::record::Record;
use crate::Pair;

/// Hits that are judged together.
pub(super) const HITS: usize = 512;

/// A block of candidates for one query.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Hits {
    /// The query, counted from the first of its batch.
    pub(super) query: u16,
    /// A bit for each candidate.
    pub(super) mask: u16,
    /// The slot of the first candidate.
    pub(super) from: u32,
}

/// Room for the hits of a batch and what comes of them, one for each thread.
pub(super) struct Scratch {
    pub(super) hits: Box<[Hits; HITS]>,
    candidates: Box<[(u32, u32); HITS * BLOCK]>,
    passed: Box<[(u32, u32); HITS * BLOCK]>,
}

impl Default for Scratch {
    fn default() -> Self {
        Self {
            hits: Box::new([Hits::default(); HITS]),
            candidates: Box::new([(0, 0); HITS * BLOCK]),
            passed: Box::new([(0, 0); HITS * BLOCK]),
        }
    }
}

/// Whether an overlapping pair is to be reported.
pub(crate) trait Accept: Sync {
    /// Asks for what [`Accept::fresh`] will read.
    fn prepare(&self, _: [u32; 2]) {}

    /// Whether the two are to be judged from this side: false for one side of pairs that are met from both, and for a box and
    /// itself.
    #[inline(always)]
    fn meets(&self, _query: u32, _candidate: u32) -> bool {
        true
    }

    /// Of any two boxes that overlap.
    fn pair(&self, pair: Pair) -> bool;

    /// Of two that are not known to have overlapped before.
    fn fresh(&self, pair: Pair) -> bool {
        self.pair(pair)
    }
}

/// Candidates to pairs.
pub(super) struct Judge<'a, R, A> {
    /// Where the queries are.
    pub(super) queries: &'a [R],
    /// Where the candidates are, and at which place by slot.
    pub(super) candidates: &'a [R],
    pub(super) places: &'a [u32],
    /// The present one where candidates need not have changed in it.
    pub(super) update: Option<u64>,
    pub(super) accept: &'a A,
    pub(super) out: &'a mut Vec<Pair>,
    pub(super) room: &'a Room,
    pub(super) taken: usize,
    pub(super) overlaps: u64,
}

impl<R: Record, A: Accept> Judge<'_, R, A> {
    /// Judges the first `count` hits; false when there is no more room. `place_of` tells the place of a query.
    pub(super) fn settle(
        &mut self,
        scratch: &mut Scratch,
        count: usize,
        place_of: impl Fn(usize) -> u32,
    ) -> bool {
        let expanded = self.expand(scratch, count, place_of);
        let passed = match self.update {
            None => self.test(scratch, expanded, R::overlapped),
            Some(update) => self.test(scratch, expanded, |a, b| a.overlapped_still(b, update)),
        };
        let (passed, accept) = (&scratch.passed[..passed], self.accept);
        passed.iter().for_each(|&(query, candidate)| accept.prepare([query, candidate]));
        let met = passed.iter().filter(|(query, candidate)| accept.meets(*query, *candidate));
        let pairs = met.map(|&(query, candidate)| Pair::new(query, candidate));
        self.out.extend(pairs.filter(|pair| accept.fresh(*pair)));
        self.room.take(self.out.len(), &mut self.taken)
    }

    fn expand(&self, scratch: &mut Scratch, count: usize, place_of: impl Fn(usize) -> u32) -> usize {
        let mut n = 0;
        for hits in &scratch.hits[..count] {
            let query = place_of(usize::from(hits.query));
            prefetch(&self.queries[query as usize]);
            let mut mask = hits.mask;
            while mask != 0 {
                let place = self.places[hits.from as usize + mask.trailing_zeros() as usize];
                mask &= mask - 1;
                prefetch(&self.candidates[place as usize]);
                scratch.candidates[n] = (query, place);
                n += 1;
            }
        }
        n
    }

    /// The exact test; pairs that overlapped before are not kept either.
    #[inline(always)]
    fn test(&mut self, scratch: &mut Scratch, count: usize, overlapped: impl Fn(&R, &R) -> bool) -> usize {
        let mut passed = 0;
        for &(query, candidate) in &scratch.candidates[..count] {
            let (one, other) = (&self.queries[query as usize], &self.candidates[candidate as usize]);
            let now = one.item().aabb.overlaps(&other.item().aabb);
            self.overlaps += u64::from(now);
            scratch.passed[passed] = (one.item().id, other.item().id);
            passed += usize::from(now & !overlapped(one, other));
        }
        passed
    }
}
