//! Groups: found pairs gathered by ranges of `a`, so that each group is sorted within the cache, by any thread.

use super::row::{self, SHORT};
use crate::Pair;
use crate::id_set::IdSet;
use crate::memory::ShrinkingVec;
use crate::parallel::{SharedSlice, empty_room, ensure_scratch, run_parts, run_parts_with, split_into};
use crate::simd::{Simd, dispatch};
use std::mem::MaybeUninit;
use std::ops::{Range, RangeInclusive};

/// log2 of the ids in a group: in larger groups the rows do not fit the cache.
const SHIFTS: RangeInclusive<u32> = 10..=14;

/// Approximate number of groups, up to 650,000 ids: their write positions fit the TLB.
const MAX_GROUPS: usize = 40;

/// Division of ids into groups.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Grouping {
    pub(crate) ids: usize,
    pub(crate) shift: u32,
    pub(crate) count: usize,
}

impl Grouping {
    pub(crate) fn new(ids: usize) -> Self {
        let mut shifts = SHIFTS;
        let shift = shifts.find(|shift| ids >> shift <= MAX_GROUPS).unwrap_or(*SHIFTS.end());
        Self { ids, shift, count: (ids >> shift) + 1 }
    }

    pub(super) fn ids_of(&self, group: usize) -> Range<usize> {
        group << self.shift..((group + 1) << self.shift).min(self.ids)
    }
}

/// Place and length of a row of pairs: among those of its group until they are compared, then among all.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Span {
    pub(super) start: u32,
    pub(super) len: u32,
}

impl Span {
    pub(super) fn range(self) -> Range<usize> {
        self.start as usize..(self.start + self.len) as usize
    }
}

/// The pairs that one thread has found, and how many of each group.
#[derive(Clone, Debug, Default)]
pub(crate) struct Found {
    /// In no particular order.
    pub(crate) pairs: ShrinkingVec<Pair>,
    /// By group of `a`: pairs found, in four counts, because one after the other in the same count would wait for it. Empty if pairs
    /// are not counted by group.
    groups: Vec<[u32; 4]>,
    shift: u32,
}

impl Found {
    /// Forgets the pairs; counts the next ones by group, if there is a grouping.
    pub(crate) fn begin(&mut self, grouping: Option<Grouping>) {
        let Grouping { count, shift, .. } = grouping.unwrap_or_default();
        self.pairs.clear();
        self.groups.clear();
        self.groups.resize(count, [0; 4]);
        self.shift = shift;
    }

    /// Counts the pairs from `from` on by group.
    #[inline(always)]
    pub(crate) fn count(&mut self, from: usize) {
        if !self.groups.is_empty() {
            for (i, pair) in self.pairs[from..].iter().enumerate() {
                self.groups[(pair.a >> self.shift) as usize][i % 4] += 1;
            }
        }
    }

    /// Asserts that all pairs were counted: each gets a place by its count.
    fn assert_counted(&self) {
        let counted: u64 = self.groups.iter().flatten().map(|count| u64::from(*count)).sum();
        assert_eq!(counted, self.pairs.len() as u64, "each pair is counted");
    }

    /// Takes pairs that were found elsewhere, and leaves other memory for them.
    pub(crate) fn take(&mut self, pairs: &mut Vec<Pair>) {
        std::mem::swap(&mut *self.pairs, pairs);
        self.count(0);
    }

    pub(crate) fn add(&mut self, pairs: &[Pair]) {
        let from = self.pairs.len();
        self.pairs.extend_from_slice(pairs);
        self.count(from);
    }
}

/// Pairs by group, with the buffers to sort them.
#[derive(Clone, Debug, Default)]
pub(crate) struct Groups {
    pub(super) grouping: Grouping,
    /// Pairs, group by group.
    pairs: ShrinkingVec<Pair>,
    /// By group: its first pair; then the number of pairs.
    starts: Vec<u32>,
    /// By thread.
    pub(super) sorters: Vec<Sorter>,
}

impl Groups {
    /// Gathers the pairs that threads have found and counted by this grouping. `of` returns those of a thread.
    pub(crate) fn gather<T: Send>(
        &mut self,
        grouping: Grouping,
        threads: &mut [T],
        of: fn(&mut T) -> &mut Found,
    ) {
        self.grouping = grouping;
        threads.iter_mut().for_each(|thread| of(thread).assert_counted());
        let count = self.place(threads, of);
        if let ([one], 1) = (&mut *threads, grouping.count) {
            return std::mem::swap(&mut self.pairs, &mut of(one).pairs);
        }
        let pairs = SharedSlice::new(empty_room(&mut self.pairs, count));
        run_parts(threads.len(), threads, |_, thread| {
            let Found { pairs: found, groups: next, .. } = of(thread);
            for pair in found.iter() {
                let place = &mut next[(pair.a >> grouping.shift) as usize][0];
                // SAFETY: every pair of every list has its own place.
                unsafe { pairs.write(*place as usize, MaybeUninit::new(*pair)) };
                *place += 1;
            }
        });
        // SAFETY: as many pairs were counted as there are, so every place has one.
        unsafe { self.pairs.set_len(count) };
    }

    /// Forgets the pairs, and gives back memory if as many as `needed` are expected.
    pub(crate) fn settle(&mut self, needed: usize) {
        let needed = needed.max(self.len());
        self.starts.clear();
        self.pairs.settle(needed);
        self.sorters.iter_mut().for_each(Sorter::settle);
    }

    /// Renames the `b` of all pairs; their `a`, by which they are grouped, keep the names of the search.
    pub(crate) fn rename_partners(&mut self, names: &[u32]) {
        let count = self.len();
        self.pairs[..count].iter_mut().for_each(|pair| pair.b = names[pair.b as usize]);
    }

    /// Turns the counts of all lists into places.
    fn place<T>(&mut self, threads: &mut [T], of: fn(&mut T) -> &mut Found) -> usize {
        self.starts.clear();
        let mut next = 0;
        for group in 0..self.grouping.count {
            self.starts.push(next);
            for thread in threads.iter_mut() {
                let places = [next, 0, 0, 0];
                next += std::mem::replace(&mut of(thread).groups[group], places).iter().sum::<u32>();
            }
        }
        self.starts.push(next);
        next as usize
    }

    pub(super) fn len(&self) -> usize {
        self.starts.last().map_or(0, |&count| count as usize)
    }

    /// Returns the places of a group's pairs.
    pub(super) fn range(&self, group: usize) -> Range<usize> {
        self.starts[group] as usize..self.starts[group + 1] as usize
    }

    /// Takes the memory of a list for the next pairs.
    pub(crate) fn take_memory(&mut self, list: &mut Vec<Pair>) {
        std::mem::swap(&mut *self.pairs, list);
    }

    /// Swaps `list` with all pairs in order.
    pub(crate) fn list(&mut self, list: &mut Vec<Pair>, workers: usize) {
        std::mem::swap(&mut *self.pairs, list);
        let mut sorters = self.take_sorters(workers);
        let groups = split_into(list, (0..self.grouping.count).map(|group| self.range(group).len()));
        run_parts_with(&mut sorters[..workers], groups, |sorter, group, pairs| {
            sorter.sort_in_place(self.grouping.ids_of(group), pairs);
        });
        self.sorters = sorters;
    }

    /// Takes the buffers of the threads that sort groups, to be put back.
    pub(super) fn take_sorters(&mut self, workers: usize) -> Vec<Sorter> {
        let mut sorters = std::mem::take(&mut self.sorters);
        sorters.resize_with(workers.max(sorters.len()), Sorter::default);
        sorters
    }

    /// Sorts a group: the `b` of each pair into `others`, row by row, and the place of each row in `others` into `spans`.
    pub(super) fn sort(&self, group: usize, sorter: &mut Sorter, spans: &mut [Span], others: &mut [u32]) {
        let first_id = self.grouping.ids_of(group).start as u32;
        let pairs = &self.pairs[self.range(group)];
        sorter.make_room(pairs.len());
        dispatch!(sort_rows, pairs, first_id, spans, others, sorter);
    }
}

/// The buffers with which a thread sorts groups.
#[derive(Clone, Debug, Default)]
pub(super) struct Sorter {
    spans: Vec<Span>,
    /// The `b` of a long row, in order.
    others: ShrinkingVec<u32>,
    /// The `b` of each pair, by row, in no order within it.
    unsorted: ShrinkingVec<u32>,
    /// Empty: for rows that are long.
    long: IdSet,
    /// Number of pairs of the largest group since memory was last given back.
    largest: usize,
}

impl Sorter {
    /// Sorts pairs whose `a` are among some ids.
    fn sort_in_place(&mut self, ids: Range<usize>, pairs: &mut [Pair]) {
        let mut spans = std::mem::take(&mut self.spans);
        spans.resize(ids.len(), Span::default());
        self.make_room(pairs.len());
        dispatch!(sort_pairs, pairs, ids.start as u32, &mut spans, self);
        self.spans = spans;
    }

    fn make_room(&mut self, pairs: usize) {
        ensure_scratch(&mut self.unsorted, pairs + SHORT, 0);
        self.largest = self.largest.max(pairs);
    }

    fn settle(&mut self) {
        let needed = std::mem::take(&mut self.largest) + SHORT;
        [&mut self.others, &mut self.unsorted].into_iter().for_each(|list| list.settle(needed));
    }
}

/// Shortens the rows of a group to what a device that breaks its promise may have said: each id once, and known ones only. Each span
/// comes with the id of its row. A sorted row that repeats an id has every id of the row and no other,
/// but perhaps not in order.
pub(super) fn drop_false<'a>(
    rows: impl Iterator<Item = (&'a mut Span, u32)>,
    others: &mut [u32],
    known: &IdSet,
) {
    for (span, a) in rows {
        let row = &mut others[span.range()];
        let is_known = |b: u32| known.contains(b);
        if !known.contains(a) {
            span.len = 0;
        } else if !row.is_sorted_by(|one, next| one < next) || !row.iter().all(|b| is_known(*b)) {
            row.sort_unstable();
            span.len = keep_known(row, is_known) as u32;
        }
    }
}

/// Moves each known id of a sorted row to its start, once. Returns their number.
fn keep_known(row: &mut [u32], is_known: impl Fn(u32) -> bool) -> usize {
    let mut len = 0;
    for i in 0..row.len() {
        if is_known(row[i]) && (len == 0 || row[len - 1] < row[i]) {
            row[len] = row[i];
            len += 1;
        }
    }
    len
}

/// Scatters the `b` of pairs into rows: into `unsorted`, in no order within a row.
#[inline(always)]
fn scatter(pairs: &[Pair], first_id: u32, spans: &mut [Span], unsorted: &mut [u32]) {
    spans.fill(Span::default());
    for pair in pairs {
        spans[(pair.a - first_id) as usize].len += 1;
    }
    let mut next = 0;
    for span in spans.iter_mut() {
        span.start = next;
        next += std::mem::take(&mut span.len);
    }
    for pair in pairs {
        let span = &mut spans[(pair.a - first_id) as usize];
        unsorted[(span.start + span.len) as usize] = pair.b;
        span.len += 1;
    }
}

/// Sorts the `b` of pairs into rows. The first row is that of `first_id`.
#[inline(always)]
fn sort_rows(
    simd: impl Simd,
    pairs: &[Pair],
    first_id: u32,
    spans: &mut [Span],
    others: &mut [u32],
    Sorter { unsorted, long, .. }: &mut Sorter,
) {
    scatter(pairs, first_id, spans, unsorted);
    for span in spans {
        row::sort_into(simd, unsorted, span.range(), others, long);
    }
}

/// Sorts pairs. The first row is that of `first_id`.
#[inline(always)]
fn sort_pairs(
    simd: impl Simd,
    pairs: &mut [Pair],
    first_id: u32,
    spans: &mut [Span],
    Sorter { unsorted, long, others, .. }: &mut Sorter,
) {
    scatter(pairs, first_id, spans, unsorted);
    for (a, span) in (first_id..).zip(spans) {
        let (len, pairs) = (span.len as usize, &mut pairs[span.start as usize..]);
        let unsorted = &unsorted[span.start as usize..];
        match pairs.first_chunk_mut::<SHORT>() {
            // The next rows overwrite what is behind this one.
            Some(pairs) if len <= SHORT => {
                let sorted = row::sorted_short(simd, unsorted, len);
                write(a, &sorted[..4], &mut pairs[..4]);
                if len > 4 {
                    write(a, &sorted[4..], &mut pairs[4..]);
                }
            }
            _ => {
                ensure_scratch(others, len + SHORT, 0);
                row::sort_into(simd, unsorted, 0..len, others, long);
                write(a, others, &mut pairs[..len]);
            }
        }
    }
}

#[inline(always)]
fn write(a: u32, others: &[u32], pairs: &mut [Pair]) {
    for (pair, &b) in pairs.iter_mut().zip(others) {
        *pair = Pair { a, b };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_group_is_sorted_where_it_lies_whatever_the_lengths_of_its_rows() {
        for last in [0u32, 1, 4, 5, 8, 9, 200] {
            let lens = [0, 3, 0, 0, 8, 1, 96, 97, 9, 5, 0, 4, last];
            let rows = (100u32..).zip(lens);
            let sorted: Vec<Pair> =
                rows.flat_map(|(a, len)| (0..len).map(move |i| Pair { a, b: 1000 + 7 * i })).collect();
            let mut pairs = sorted.clone();
            pairs.reverse();
            pairs.sort_by_key(|pair| pair.b % 11);
            let mut sorter = Sorter::default();
            sorter.sort_in_place(100..100 + lens.len(), &mut pairs);
            assert_eq!(pairs, sorted, "{last}");
        }
    }

    #[test]
    fn rows_that_repeat_an_id_or_name_an_unknown_one_are_shortened_and_others_stay() {
        let mut known = IdSet::default();
        known.reserve(64);
        (1..30).filter(|id| *id != 8).for_each(|id| known.insert(id));
        let mut others = [3, 5, 9, 5, 9, 7, 7, 1, 2, 4, 4, 8, 63, 5];
        let lens = [1, 4, 0, 2, 2, 2, 3];
        let mut start = 0;
        let mut spans = lens.map(|len| {
            start += len;
            Span { start: start - len, len }
        });
        let ids = [1, 2, 30, 20, 4, 8, 10];
        drop_false(spans.iter_mut().zip(ids), &mut others, &known);
        let rows = spans.map(|span| others[span.range()].to_vec());
        assert_eq!(rows, [vec![3], vec![5, 9], vec![], vec![7], vec![1, 2], vec![], vec![5]]);
    }
}
