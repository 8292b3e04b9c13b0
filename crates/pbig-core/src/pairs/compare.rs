//! The comparison: found pairs against the kept ones, group by group, in the order of ids.

use super::groups::{self, Groups, Span};
use super::kept::{Kept, Rows};
use super::row::{self, equal};
use crate::Pair;
use crate::id_set::IdSet;
use crate::memory::ShrinkingVec;
use crate::parallel::{run_parts_with, split_into};
use crate::simd::{Simd, dispatch};

/// Pairs that began, and pairs that ended.
#[derive(Clone, Debug, Default)]
pub(crate) struct Differences {
    pub(crate) added: ShrinkingVec<Pair>,
    pub(crate) removed: ShrinkingVec<Pair>,
}

impl Differences {
    pub(crate) fn clear(&mut self) {
        self.added.clear();
        self.removed.clear();
    }

    /// Forgets the pairs, and gives back a piece of the memory that fewer of them than before do not need.
    pub(crate) fn settle_and_clear(&mut self) {
        self.added.settle_and_clear(0);
        self.removed.settle_and_clear(0);
    }

    /// Takes the pairs of several threads, one behind the other.
    pub(crate) fn gather<'a>(&mut self, parts: impl Iterator<Item = &'a Self> + Clone) {
        self.clear();
        // Not twice as much: after a peak these lists are the largest.
        self.added.reserve_exact(parts.clone().map(|part| part.added.len()).sum());
        self.removed.reserve_exact(parts.clone().map(|part| part.removed.len()).sum());
        for part in parts {
            self.added.extend_from_slice(&part.added);
            self.removed.extend_from_slice(&part.removed);
        }
    }
}

/// The result of a comparison.
#[derive(Clone, Debug, Default)]
pub(crate) struct Comparison {
    /// Sorted.
    pub(crate) events: Differences,
    /// True if the found pairs have replaced the kept ones. Otherwise the events have to be applied to these.
    pub(crate) is_kept: bool,
    /// By group.
    parts: Vec<Differences>,
}

impl Comparison {
    /// Compares all found pairs with the kept pairs, and keeps the found ones. With `names`, a search of these ids alone has found
    /// the pairs, and their `a` are places in this list. Pairs that are doubted count only if these ids know both.
    pub(crate) fn run(
        &mut self,
        (found, names): (&mut Groups, Option<&[u32]>),
        kept: &mut Kept,
        workers: usize,
        doubted: Option<&IdSet>,
    ) {
        let (grouping, count) = (found.grouping, found.len());
        let mut next = std::mem::take(&mut kept.next);
        next.spans.resize(grouping.ids, Span::default());
        next.pool.resize(count, 0);
        self.parts.resize_with(grouping.count, Differences::default);
        let old = &kept.forward;
        let ids = (0..grouping.count).map(|group| grouping.ids_of(group).len());
        let mut sorters = found.take_sorters(workers);
        let pairs = &*found;
        let places = (0..grouping.count).map(|group| pairs.range(group).len());
        let Rows { spans, pool } = &mut *next;
        let parts = self.parts.iter_mut().zip(split_into(spans, ids).zip(split_into(pool, places)));
        run_parts_with(&mut sorters[..workers], parts, |sorter, group, (part, (spans, pool))| {
            let (first_id, first_place) =
                (grouping.ids_of(group).start as u32, pairs.range(group).start as u32);
            part.clear();
            pairs.sort(group, sorter, spans, pool);
            if let Some(known) = doubted {
                let name = |place: u32| names.map_or(place, |names| names[place as usize]);
                let rows = spans.iter_mut().zip((first_id..).map(name));
                groups::drop_false(rows, pool, known);
            }
            let new = NewRows { names, first_id, spans, pool };
            dispatch!(compare, part, old, &new);
            spans.iter_mut().for_each(|span| span.start += first_place);
        });
        found.sorters = sorters;
        kept.next = next;
        self.events.gather(self.parts.iter());
        kept.adopt_next(names, &self.events.added, &self.events.removed);
        self.is_kept = true;
    }

    /// Compares sorted pairs with the kept ones. Only the ids `present` have pairs.
    pub(crate) fn compare_sorted(
        &mut self,
        present: impl Iterator<Item = u32>,
        found: impl Iterator<Item = Pair>,
        kept: &Kept,
    ) {
        self.clear();
        let (mut found, mut is) = (found.peekable(), Vec::new());
        for a in present {
            is.clear();
            while let Some(pair) = found.next_if(|pair| pair.a == a) {
                is.push(pair.b);
            }
            let was = kept.rows_of(a).1;
            if !equal(was, &is) {
                row::differences(a, was, &is, &mut self.events);
            }
        }
    }

    /// Gives back a piece of the memory that fewer events than before do not need. The last update had `events`.
    pub(crate) fn settle(&mut self, events: usize) {
        self.parts.iter_mut().for_each(Differences::settle_and_clear);
        self.events.added.settle(events);
        self.events.removed.settle(events);
    }

    pub(crate) fn clear(&mut self) {
        self.events.clear();
        self.is_kept = false;
    }
}

/// The sorted rows of a group.
struct NewRows<'a> {
    /// The id of each row by its place; none if that is the id.
    names: Option<&'a [u32]>,
    /// The place of the group's first row among all rows.
    first_id: u32,
    /// The place of each row in the group's pool.
    spans: &'a [Span],
    pool: &'a [u32],
}

/// Compares rows, most of which are short and have not changed.
#[inline(always)]
fn compare(simd: impl Simd, part: &mut Differences, old: &Rows, new: &NewRows<'_>) {
    for (place, span) in (new.first_id..).zip(new.spans) {
        let a = new.names.map_or(place, |names| names[place as usize]);
        let was = old.spans[a as usize].range();
        row::compare(simd, a, (&old.pool, was), (new.pool, span.range()), part);
    }
}
