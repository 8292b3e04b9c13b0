//! Hits: candidates that the test of codes leaves, tested exactly many at a time.
//!
//! A hit is a block of slots with a bit for each candidate. Hits are gathered first; then all are expanded, and then all
//! tested, while the records further ahead are on their way. (Tested at once, each would wait for its record.) The test
//! has no branch: a pair is written, and kept or overwritten by the next one.

use super::Budget;
use super::brute::Block;
use crate::aabb::one_box;
use crate::boxes::share_no_key;
use crate::pairs::{Found, Grouping};
use crate::policy::search::{WORK_OF_EXACT_TEST, WORK_OF_VAGUE_TEST, in_vain};
use crate::simd::{BLOCK, Simd, eight_from, prefetch};
use crate::{Aabb, Keys, Pair, ProxyFilter};
use std::sync::atomic::{AtomicU64, Ordering};

/// Number of hits that are tested together.
const ROOM: usize = 256;

/// Maximum number of hits that a loop adds between two checks of the room.
const SLACK: usize = 8;

/// Number of candidates between a prefetch and the test: a record from memory takes about as long.
const AHEAD: usize = 24;

/// Pairs that a thread gathers before it accounts for them, or hands them over.
const BATCH: usize = 4096;

/// Work, in tests of codes, that is charged before a piece of work is done.
pub(super) const CHARGED_FROM: u64 = 1 << 16;

/// A box with its id and the key of its cell: half a cache line.
#[repr(C, align(32))]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Record {
    pub(crate) aabb: Aabb,
    pub(crate) id: u32,
    pub(crate) key: u32,
}

const _: () = assert!(size_of::<Record>() == 32);

impl Record {
    pub(crate) const EMPTY: Self = Self { aabb: Aabb::NOWHERE, id: 0, key: 0 };

    /// Makes a record by words of eight bytes. Otherwise a copy of the record would wait until eight separate writes are done.
    #[inline(always)]
    pub(crate) fn new(aabb: Aabb, id: u32, key: u32) -> Self {
        let [x, y, z]: [u64; 3] = bytemuck::cast(aabb);
        let tail = u64::from_ne_bytes(bytemuck::cast([id, key]));
        bytemuck::cast([x, y, z, tail])
    }

    /// The exact test of two valid boxes, see [`Aabb::overlaps`]. A record has two numbers behind its box, so that both
    /// corners can be loaded as four lanes.
    #[inline(always)]
    pub(crate) fn overlaps(&self, other: &Self) -> bool {
        one_box::records_overlap(bytemuck::cast_ref(self), bytemuck::cast_ref(other))
    }
}

/// Receiver of pairs that are not listed, some at a time. Each thread calls it.
pub(crate) type Receiver<'a> = &'a (dyn Fn(&[Pair]) + Sync);

/// A value for each box, by id. Of two sets each has a list of its own, and the second has the ids behind the first's.
#[derive(Clone, Copy)]
pub(crate) struct ById<'a, T> {
    /// The values of boxes that are the first of a pair.
    first: &'a [T],
    /// The values of boxes that are the second of a pair.
    second: &'a [T],
    /// The id of the first value of `second`.
    split: usize,
}

impl<'a, T> ById<'a, T> {
    pub(crate) fn of_one(values: &'a [T]) -> Self {
        Self { first: values, second: values, split: 0 }
    }

    pub(crate) fn of_two([first, second]: [&'a [T]; 2]) -> Self {
        Self { first, second, split: first.len() }
    }
}

/// Conditions for a found pair, besides that its boxes overlap, and where it goes.
#[derive(Clone, Copy)]
pub(crate) struct Rule<'a> {
    /// None if all may pair.
    pub(crate) filters: Option<ById<'a, ProxyFilter>>,
    /// None if boxes have no keys.
    pub(crate) keys: Option<ById<'a, Keys>>,
    /// None if pairs are listed.
    pub(crate) receiver: Option<Receiver<'a>>,
    /// Pairs that may be found.
    pub(crate) max_pairs: u64,
    /// Pairs found by all threads.
    pub(crate) found: &'a AtomicU64,
    /// The work that the search may take; none if it may take any.
    pub(crate) budget: Option<&'a Budget>,
}

impl<'a> Rule<'a> {
    /// Makes a rule for a list of all pairs.
    #[cfg(test)]
    pub(crate) fn listing(found: &'a AtomicU64) -> Self {
        Self { filters: None, keys: None, receiver: None, max_pairs: u64::MAX, found, budget: None }
    }
}

/// The pairs that one thread finds, and its buffers.
#[derive(Clone, Debug, Default)]
pub(crate) struct Hits {
    queries: Vec<u32>,
    places: Vec<u32>,
    pub(crate) found: Found,
    /// Candidates tested.
    pub(crate) tests: u64,
    /// Work besides a unit for each test: cells and nodes looked at, and what makes a test longer.
    pub(crate) extra: u64,
    /// Overlapping boxes met, filtered ones included.
    pub(crate) overlaps: u64,
    /// Pairs that a receiver got.
    handed_over: u64,
    /// Number of listed pairs that were added to the count of all threads.
    accounted: usize,
    /// Work and overlaps that were charged to a budget.
    charged: (u64, u64),
    /// No more pairs are wanted: they are too many, or the budget is spent.
    pub(super) is_full: bool,
    /// The boxes of [`brute_force`](super::brute_force), and their ids.
    pub(super) blocks: Vec<Block>,
    pub(super) ids: Vec<u32>,
}

/// Room for the hits of a writer.
pub(super) const HIT_ROOM: usize = ROOM + SLACK;

/// Writes hits: slot of the query, first slot of the block, mask (28, 28 and 8 bits). A value of its own, so that a loop keeps it in
/// registers.
pub(super) struct HitWriter<'a> {
    blocks: &'a mut [u64; HIT_ROOM],
    len: usize,
    /// Candidates tested.
    pub(super) tests: u64,
    /// Work of looking at rows of cells.
    pub(super) rows: u64,
}

impl<'a> HitWriter<'a> {
    pub(super) fn new(blocks: &'a mut [u64; HIT_ROOM]) -> Self {
        Self { blocks, len: 0, tests: 0, rows: 0 }
    }

    /// Adds a hit unless its mask is empty. At most [`SLACK`] hits are added while there is no room.
    #[inline(always)]
    pub(super) fn push(&mut self, query: usize, first: usize, mask: u32) {
        self.blocks[self.len] = (query as u64) << 36 | (first as u64) << 8 | u64::from(mask);
        self.len += usize::from(mask != 0);
    }

    /// Returns true if [`SLACK`] more hits fit.
    #[inline(always)]
    pub(super) fn has_room(&self) -> bool {
        self.len <= ROOM
    }
}

impl Hits {
    /// Forgets the pairs of an earlier search; counts those of the next one by group, if there is a grouping.
    pub(crate) fn begin(&mut self, grouping: Option<Grouping>) {
        self.queries.resize(HIT_ROOM * BLOCK + AHEAD, 0);
        self.places.resize(HIT_ROOM * BLOCK + AHEAD, 0);
        self.found.begin(grouping);
        (self.tests, self.extra, self.overlaps, self.handed_over) = (0, 0, 0, 0);
        (self.accounted, self.charged, self.is_full) = (0, (0, 0), false);
    }

    /// Returns the work so far, in tests of codes.
    pub(crate) fn work(&self) -> u64 {
        self.tests + self.extra
    }

    /// Charges the work since the last charge, less what its overlaps pay for. All boxes of a search make the same charges whichever
    /// threads search for them, so the sum is the same, too. A box that meets thousands does not pay for others that meet none.
    pub(crate) fn charge(&mut self, budget: Option<&Budget>) {
        let Some(budget) = budget else { return };
        let (work, overlaps) = (self.work(), self.overlaps);
        budget.charge(in_vain(work - self.charged.0, overlaps - self.charged.1));
        self.charged = (work, overlaps);
        self.is_full |= budget.is_over();
    }

    /// As [`Hits::charge`], if the work is much.
    pub(crate) fn charge_much(&mut self, budget: Option<&Budget>) {
        if self.work() - self.charged.0 > CHARGED_FROM {
            self.charge(budget);
        }
    }

    /// Tests all hits exactly and keeps the pairs that the rule allows. Queries have slots of the first records, blocks of the
    /// second ones.
    #[inline(always)]
    pub(super) fn flush(
        &mut self,
        simd: impl Simd,
        writer: &mut HitWriter<'_>,
        (own, records): (&[Record], &[Record]),
        rule: &Rule<'_>,
    ) {
        let candidates = self.expand(simd, &writer.blocks[..writer.len]);
        self.extra += candidates as u64 * (WORK_OF_VAGUE_TEST - 1);
        self.test(own, records, candidates, rule);
        writer.len = 0;
    }

    #[inline(always)]
    fn expand(&mut self, simd: impl Simd, hits: &[u64]) -> usize {
        let mut count = 0;
        for hit in hits {
            let (query, first, mask) =
                ((hit >> 36) as u32, (hit >> 8) as u32 & 0xFFF_FFFF, *hit as u32 & 255);
            let (queries, places) =
                (eight_from(&mut self.queries, count), eight_from(&mut self.places, count));
            count += simd.expand(query, first, mask, queries, places);
        }
        count
    }

    #[inline(always)]
    fn test(&mut self, own: &[Record], records: &[Record], candidates: usize, rule: &Rule<'_>) {
        let from = self.found.pairs.len();
        let (queries, places) = (&self.queries[..candidates], &self.places[..candidates + AHEAD]);
        let ahead = queries.iter().zip(places).zip(&places[AHEAD..]);
        let pairs = ahead.map(
            #[inline(always)]
            |((query, place), ahead)| {
                prefetch(records.as_ptr().wrapping_add(*ahead as usize));
                (&own[*query as usize], &records[*place as usize])
            },
        );
        // SAFETY: zipped slices have as many elements as they say.
        unsafe { push_overlapping(&mut self.found.pairs, pairs) };
        self.keep(from, rule);
    }

    /// Keeps the pairs from `from` on if they are many. Returns the first one that is not kept yet.
    #[inline(always)]
    pub(super) fn keep_many(&mut self, from: usize, rule: &Rule<'_>) -> usize {
        if self.found.pairs.len() < from + BATCH {
            return from;
        }
        self.keep(from, rule);
        self.found.pairs.len()
    }

    /// Filters, counts and accounts for the pairs from `from` on.
    #[inline(always)]
    pub(crate) fn keep(&mut self, from: usize, rule: &Rule<'_>) {
        self.overlaps += (self.found.pairs.len() - from) as u64;
        if let Some(filters) = rule.filters {
            self.filter(from, filters, ProxyFilter::allows);
        }
        if let Some(keys) = rule.keys {
            self.filter(from, keys, share_no_key);
        }
        if let Some(receiver) = rule.receiver {
            if self.found.pairs.len() >= BATCH {
                self.hand_over(receiver);
            }
            return;
        }
        self.found.count(from);
        let new = self.found.pairs.len() - self.accounted;
        if new >= BATCH {
            self.accounted = self.found.pairs.len();
            let found = rule.found.fetch_add(new as u64, Ordering::Relaxed) + new as u64;
            self.is_full |= found > rule.max_pairs;
        }
    }

    pub(crate) fn hand_over(&mut self, receiver: Receiver<'_>) {
        self.handed_over += self.found.pairs.len() as u64;
        receiver(&self.found.pairs);
        self.found.pairs.clear();
    }

    /// Returns the number of pairs found: listed ones, and those that a receiver got.
    pub(crate) fn count(&self) -> u64 {
        self.handed_over + self.found.pairs.len() as u64
    }

    /// Tests a box exactly against each of a run. The pairs from `from` on were not filtered and counted yet. Keeps them if they are many,
    /// and returns the first one that is left.
    pub(super) fn test_part(
        &mut self,
        one: &Record,
        run: &[Record],
        mut from: usize,
        rule: &Rule<'_>,
    ) -> usize {
        for run in run.chunks(BATCH) {
            self.tests += run.len() as u64;
            self.extra += run.len() as u64 * (WORK_OF_EXACT_TEST - 1);
            let pairs = run.iter().map(
                #[inline(always)]
                |other| (one, other),
            );
            // SAFETY: a slice has as many elements as it says.
            unsafe { push_overlapping(&mut self.found.pairs, pairs) };
            from = self.keep_many(from, rule);
        }
        from
    }

    /// Drops the pairs from `from` on whose filters, or keys, do not allow them.
    #[inline(always)]
    fn filter<T>(&mut self, from: usize, by_id: ById<'_, T>, allow: impl Fn(&T, &T) -> bool) {
        let ById { first, second, split } = by_id;
        let (mut kept, len) = (from, self.found.pairs.len());
        for i in from..len {
            if let Some(ahead) = self.found.pairs.get(i + AHEAD) {
                prefetch(first.as_ptr().wrapping_add(ahead.a as usize));
                prefetch(second.as_ptr().wrapping_add(ahead.b as usize - split));
            }
            let pair = self.found.pairs[i];
            self.found.pairs[kept] = pair;
            kept += usize::from(allow(&first[pair.a as usize], &second[pair.b as usize - split]));
        }
        self.found.pairs.truncate(kept);
    }
}

/// Appends those of some pairs of boxes that overlap.
///
/// # Safety
/// There are no more pairs than their iterator says.
#[inline(always)]
unsafe fn push_overlapping<'a>(
    pairs: &mut Vec<Pair>,
    candidates: impl ExactSizeIterator<Item = (&'a Record, &'a Record)>,
) {
    let from = pairs.len();
    pairs.reserve(candidates.len() + 1);
    // SAFETY: there is room for all pairs, and for one more that is overwritten.
    unsafe {
        let start = pairs.as_mut_ptr().add(from);
        let mut next = start;
        for (one, other) in candidates {
            next.write(Pair::new(one.id, other.id));
            next = next.add(usize::from(one.overlaps(other)));
        }
        pairs.set_len(from + next.offset_from(start) as usize);
    }
}
