//! Kept pairs: a sorted row of `b` for each `a`, all rows in one pool.

use super::groups::Span;
use crate::Pair;
use crate::memory::{Scratch, ShrinkingVec};
use crate::parallel::{alone, available_threads, piece_range, run_parts, split_evenly, split_into};
use crate::policy::PARALLEL_FROM_BOXES;
use crate::simd::prefetch;
use std::sync::OnceLock;

/// Minimum room of a row that has outgrown its place.
const MIN_ROOM: u32 = 4;

/// Marks a spare place of a row; the other bits are the row's id. Ids are below 2^28.
const SPARE: u32 = 1 << 31;

/// Number of ids that can be read in the time in which one event is applied to the rows of `b`. After a search with more events
/// than ids divided by this number, these rows are dropped, and made anew when they are needed.
const IDS_OF_EVENT: usize = 32;

/// Number of pairs between a prefetch of rows and their use.
const AHEAD: usize = 8;

/// Sorted rows of ids, by id. Spare places behind a row are marked as its own.
#[derive(Clone, Debug, Default)]
pub(super) struct Rows {
    pub(super) spans: Vec<Span>,
    pub(super) pool: ShrinkingVec<u32>,
}

impl Rows {
    /// Returns a row. The span of an empty one may lie beyond the pool, because the pool was replaced since.
    pub(super) fn row(&self, id: u32) -> &[u32] {
        let span = self.spans.get(id as usize);
        span.and_then(|span| self.pool.get(span.range())).unwrap_or(&[])
    }

    fn move_to_end(&mut self, id: u32, span: Span, more: u32) -> Span {
        let start = self.pool.len() as u32;
        let room = (span.len + more).next_power_of_two().max(MIN_ROOM);
        if span.len > 0 {
            self.pool.extend_from_within(span.range());
        }
        self.pool.resize((start + room) as usize, SPARE | id);
        Span { start, len: span.len }
    }

    /// Changes the rows of the `a` of sorted pairs.
    fn change(&mut self, pairs: &[Pair], change: fn(&mut Self, &[Pair])) {
        let mut rest = pairs;
        for run in pairs.chunk_by(|one, next| one.a == next.a) {
            (0..run.len().min(AHEAD)).for_each(|i| self.prefetch(&rest[i..]));
            change(self, run);
            rest = &rest[run.len()..];
        }
    }

    /// Inserts new pairs of one row. What lies behind the last one moves first.
    fn insert(&mut self, run: &[Pair]) {
        let id = run[0].a;
        let span = self.spans[id as usize];
        let behind = self.pool.get(span.range().end..span.range().end + run.len());
        let has_room = behind.is_some_and(|room| room.iter().all(|place| *place == SPARE | id));
        let span = if has_room { span } else { self.move_to_end(id, span, run.len() as u32) };
        let (mut end, len) = (span.len as usize, span.len + run.len() as u32);
        let row = &mut self.pool[span.start as usize..][..len as usize];
        for (before, pair) in run.iter().enumerate().rev() {
            let place = row[..end].partition_point(|&other| other < pair.b);
            row.copy_within(place..end, place + before + 1);
            row[place + before] = pair.b;
            end = place;
        }
        self.spans[id as usize] = Span { len, ..span };
    }

    /// Removes pairs from one row. The partners between two removed ones move together.
    fn remove(&mut self, run: &[Pair]) {
        let id = run[0].a;
        let span = self.spans[id as usize];
        // An empty row may lie beyond the pool.
        let Some(row) = self.pool.get_mut(span.range()) else { return };
        let (mut from, mut len) = (0, 0);
        for pair in run {
            if let Ok(place) = row[from..].binary_search(&pair.b) {
                row.copy_within(from..from + place, len);
                (from, len) = (from + place + 1, len + place);
            }
        }
        row.copy_within(from.., len);
        len += row.len() - from;
        row[len..].fill(SPARE | id);
        self.spans[id as usize] = Span { len: len as u32, ..span };
    }

    /// Prefetches the rows of pairs ahead of the first.
    fn prefetch(&self, pairs: &[Pair]) {
        if let Some(pair) = pairs.get(2 * AHEAD) {
            prefetch(self.spans.as_ptr().wrapping_add(pair.a as usize));
        }
        if let Some(span) = pairs.get(AHEAD).and_then(|pair| self.spans.get(pair.a as usize)) {
            prefetch(self.pool.as_ptr().wrapping_add(span.start as usize));
        }
    }

    /// Moves all rows together when more than half of the pool is unused.
    fn compact(&mut self, pairs: usize) {
        if self.pool.len() <= 2 * pairs + self.spans.len() {
            return;
        }
        let mut pool = Vec::with_capacity(pairs + pairs / 8);
        for span in &mut self.spans {
            let start = pool.len() as u32;
            pool.extend_from_slice(self.pool.get(span.range()).unwrap_or(&[]));
            span.start = start;
        }
        *self.pool = pool;
    }
}

/// The pairs that exist, kept from update to update.
#[derive(Clone, Debug, Default)]
pub(crate) struct Kept {
    /// Rows of `b`, by `a`.
    pub(super) forward: Rows,
    /// Rows of `a`, by `b`: made for the first look-ups or question after a search, then kept up to date.
    backward: OnceLock<Rows>,
    /// By id: pairs in which it is `b`.
    lower: Vec<u32>,
    len: usize,
    /// Buffers of the next comparison.
    pub(super) next: Scratch<Rows>,
    /// Changed pairs, `b` first.
    turned: Scratch<ShrinkingVec<Pair>>,
}

impl Kept {
    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// Makes ids below `ids` known.
    pub(crate) fn reserve_ids(&mut self, ids: usize) {
        self.forward.spans.resize(ids.max(self.forward.spans.len()), Span::default());
        self.lower.resize(ids.max(self.lower.len()), 0);
        if let Some(rows) = self.backward.get_mut() {
            rows.spans.resize(ids.max(rows.spans.len()), Span::default());
        }
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = Pair> {
        (0..self.forward.spans.len() as u32)
            .flat_map(|a| self.forward.row(a).iter().map(move |&b| Pair { a, b }))
    }

    /// Yields the partners of a box, sorted.
    pub(crate) fn partners(&self, id: u32) -> impl Iterator<Item = u32> {
        // Others may wait for it.
        let backward = self.backward.get_or_init(|| alone(|| self.reversed()));
        backward.row(id).iter().chain(self.forward.row(id)).copied()
    }

    /// Makes the rows of `b`, if there are none.
    pub(crate) fn make_backward(&mut self) {
        self.backward.get_or_init(|| self.reversed());
    }

    /// Returns the partners of a box with lower ids, after [`Kept::make_backward`], and those with larger ones, both sorted.
    #[inline(always)]
    pub(crate) fn rows_of(&self, id: u32) -> (&[u32], &[u32]) {
        (self.backward.get().map_or(&[], |rows| rows.row(id)), self.forward.row(id))
    }

    pub(crate) fn degree(&self, id: u32) -> u32 {
        let i = id as usize;
        self.forward.spans.get(i).map_or(0, |span| span.len + self.lower[i])
    }

    pub(crate) fn contains(&self, pair: Pair) -> bool {
        self.forward.row(pair.a).binary_search(&pair.b).is_ok()
    }

    /// Returns the rows of `a`, by `b`. Each of several threads reads all pairs, and writes the rows of its part of the ids.
    fn reversed(&self) -> Rows {
        let mut spans = vec![Span::default(); self.lower.len()];
        let mut next = 0;
        for (span, len) in spans.iter_mut().zip(&self.lower) {
            span.start = next;
            next += len;
        }
        let mut pool = ShrinkingVec::default();
        pool.resize(next as usize, 0);
        let pieces = if self.len < PARALLEL_FROM_BOXES { 1 } else { available_threads() };
        let ids = spans.len();
        let start = |piece| spans.get(piece_range(ids, piece, pieces).start).map_or(next, |span| span.start);
        let places: Vec<usize> =
            (0..pieces).map(|piece| (start(piece + 1) - start(piece)) as usize).collect();
        let parts = split_evenly(&mut spans, pieces).zip(split_into(&mut pool, places));
        run_parts(pieces, parts, |piece, (spans, pool)| {
            let own = piece_range(ids, piece, pieces);
            let Some(first) = spans.first().map(|span| span.start as usize) else { return };
            for pair in self.iter().filter(|pair| own.contains(&(pair.b as usize))) {
                let span = &mut spans[pair.b as usize - own.start];
                pool[span.range().end - first] = pair.a;
                span.len += 1;
            }
        });
        Rows { spans, pool }
    }

    /// Takes pairs out before a search, sorted. Many are not taken out of the rows of `b`, which are made anew later.
    pub(crate) fn drop_pairs(&mut self, pairs: &[Pair]) {
        self.forget_backward_if(self.are_many(pairs.len()));
        self.apply(&[], pairs);
    }

    fn are_many(&self, events: usize) -> bool {
        events * IDS_OF_EVENT > self.lower.len()
    }

    fn forget_backward_if(&mut self, is_useless: bool) {
        if is_useless {
            self.backward.take();
        }
    }

    /// Inserts added pairs into the rows, and takes removed pairs out. Both lists are sorted.
    pub(crate) fn apply(&mut self, added: &[Pair], removed: &[Pair]) {
        self.change(removed, Rows::remove);
        self.change(added, Rows::insert);
        self.count(added, removed);
        self.forward.compact(self.len);
        if let Some(rows) = self.backward.get_mut() {
            rows.compact(self.len);
        }
    }

    fn change(&mut self, pairs: &[Pair], change: fn(&mut Rows, &[Pair])) {
        self.forward.change(pairs, change);
        self.change_backward(pairs, change);
    }

    fn change_backward(&mut self, pairs: &[Pair], change: fn(&mut Rows, &[Pair])) {
        if let Some(rows) = self.backward.get_mut() {
            self.turned.clear();
            self.turned.extend(pairs.iter().map(|pair| Pair { a: pair.b, b: pair.a }));
            self.turned.sort_unstable();
            rows.change(&self.turned, change);
        }
    }

    fn count(&mut self, added: &[Pair], removed: &[Pair]) {
        added.iter().for_each(|pair| self.lower[pair.b as usize] += 1);
        removed.iter().for_each(|pair| self.lower[pair.b as usize] -= 1);
        self.len = self.len + added.len() - removed.len();
    }

    /// Takes the compared rows for the kept ones: all, or those of the ids in `names`. No other id has a pair.
    pub(super) fn adopt_next(&mut self, names: Option<&[u32]>, added: &[Pair], removed: &[Pair]) {
        std::mem::swap(&mut self.forward, &mut *self.next);
        if let Some(names) = names {
            std::mem::swap(&mut self.forward.spans, &mut self.next.spans);
            let rows = names.iter().zip(&self.next.spans);
            rows.for_each(|(id, span)| self.forward.spans[*id as usize] = *span);
        }
        self.count(added, removed);
        let events = added.len() + removed.len();
        self.forget_backward_if(names.is_none() || self.are_many(events));
        self.change_backward(removed, Rows::remove);
        self.change_backward(added, Rows::insert);
    }

    /// Gives back a piece of the memory that fewer pairs than before do not need. The last update had `events` of a kind.
    pub(crate) fn settle(&mut self, events: usize) {
        let needed = self.forward.pool.len();
        self.forward.pool.settle(needed);
        self.next.pool.settle(self.len);
        self.turned.settle(events);
    }

    /// Gives back memory that the kept pairs do not need. No pair has an id of `ids` or more.
    pub(crate) fn shrink(&mut self, ids: usize) {
        (self.next, self.turned) = Default::default();
        self.backward.take();
        self.forward.pool.shrink_to_fit();
        self.forward.spans.truncate(ids);
        self.lower.truncate(ids);
        self.forward.spans.shrink_to_fit();
        self.lower.shrink_to_fit();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_that_grows_and_shrinks_keeps_its_place() {
        let mut kept = Kept::default();
        kept.reserve_ids(100);
        let row =
            |len: u32| [3, 4].into_iter().flat_map(move |a| (0..len).map(move |i| Pair { a, b: 10 + i }));
        for (shorter, longer) in [(4, 5), (0, 1), (7, 9)] {
            kept.apply(&row(longer).collect::<Vec<_>>(), &[]);
            let places = kept.forward.pool.len();
            for _ in 0..1000 {
                let last: Vec<Pair> = row(longer).filter(|pair| pair.b >= 10 + shorter).collect();
                kept.apply(&[], &last);
                assert!(kept.iter().eq(row(shorter)));
                kept.apply(&last, &[]);
                assert!(kept.iter().eq(row(longer)));
            }
            assert_eq!(kept.forward.pool.len(), places);
            kept.apply(&[], &row(longer).collect::<Vec<_>>());
        }
    }

    /// Batches of every size, whose pairs share `a`, share `b` or neither, beside a set of pairs.
    #[test]
    fn rows_equal_a_set_after_changes_of_many_pairs_at_once() {
        for (columns, step) in [(1, 1), (200, 1), (7, 3), (40, 17)] {
            let (mut kept, mut wanted) = (Kept::default(), std::collections::BTreeSet::new());
            kept.reserve_ids(700);
            kept.partners(0).for_each(drop);
            let pair = |i: u32| Pair { a: i * step % columns, b: 200 + i * step / columns % 500 };
            for round in 0..60u32 {
                let (first, len) = (round * 37 % 300, round * round % 230);
                let batch: std::collections::BTreeSet<Pair> = (first..first + len).map(pair).collect();
                let added: Vec<Pair> = batch.difference(&wanted).copied().collect();
                let removed: Vec<Pair> = batch.intersection(&wanted).copied().collect();
                kept.apply(&added, &removed);
                wanted = wanted.symmetric_difference(&batch).copied().collect();
                assert!(kept.iter().eq(wanted.iter().copied()), "{columns}, round {round}");
                for id in 0..700 {
                    let of_id = wanted.iter().filter(|pair| pair.b == id).map(|pair| pair.a);
                    let later = wanted.iter().filter(|pair| pair.a == id).map(|pair| pair.b);
                    assert!(kept.partners(id).eq(of_id.chain(later)), "{columns}, round {round}, {id}");
                }
            }
        }
    }

    #[test]
    fn rows_survive_compaction() {
        let mut kept = Kept::default();
        kept.reserve_ids(300);
        let pairs = |from: u32, to: u32| {
            let mut pairs: Vec<_> = (from..to).map(|i| Pair { a: i % 7, b: 10 + i }).collect();
            pairs.sort_unstable();
            pairs
        };
        kept.apply(&pairs(0, 280), &[]);
        kept.apply(&[], &pairs(20, 280));
        for round in 0..50 {
            kept.apply(&pairs(20, 100 + round), &[]);
            assert!(kept.iter().eq(pairs(0, 100 + round)));
            kept.apply(&[], &pairs(20, 100 + round));
        }
        assert!(kept.forward.pool.len() <= 2 * 150 + 300, "{} places", kept.forward.pool.len());
    }
}
