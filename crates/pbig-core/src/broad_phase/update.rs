//! An update: what was added, what has ended, and the kept pairs brought up to date.

#[cfg(feature = "gpu")]
use super::device::Ending;
use super::many::RANGE;
use super::near::Served;
use super::{BroadPhase, Old, flag};
use crate::cpu::codes::prefetch;
use crate::cpu::emit;
use crate::cpu::judge::Accept;
use crate::diff::{Judgement, PairStore};
use crate::plan::LazySummary;
use crate::search::Rule;
use crate::share::{self, has_threads};
use crate::{Aabb, Backend, Error, Pair, ProxyFilter, Strategy, shared_from};
use std::collections::HashMap;

/// The [`State`] of a broad phase of which other fields may be written.
macro_rules! state {
    ($of:ident) => {
        $crate::broad_phase::update::State {
            boxes: &$of.boxes,
            before: &$of.before,
            filters: &$of.filters,
            flags: &$of.flags,
            refiltered: &$of.refiltered,
        }
    };
}
pub(super) use state;

/// Who has found the pairs that came.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Route {
    /// A device, which tells which boxes have lost pairs.
    Gpu,
    /// The list of near pairs: it has also found those that went, and kept those that came.
    Near,
    /// A search for the boxes that have changed.
    Few,
    /// The same in the base grid, and a walk that has found which pairs went.
    Edits,
    /// One for all.
    All,
}

/// Events from which both lists are sorted at once.
const PARALLEL_FROM: usize = shared_from(4096);

/// Changed boxes from which all are looked at on several threads.
const RANGES_FROM: usize = shared_from(16_384);

impl BroadPhase {
    /// Pairs that overlap now and did not, into `events.added`, in no order; and who has found them.
    pub(super) fn find_added(&mut self) -> Result<Route, Error> {
        #[cfg(feature = "gpu")]
        let on_gpu = self.find_changes_on_gpu()?;
        #[cfg(not(feature = "gpu"))]
        let on_gpu = self.base.miss_gpu(&self.config, &mut self.report);
        if on_gpu { Ok(Route::Gpu) } else { self.find_added_on_cpu() }
    }

    fn find_added_on_cpu(&mut self) -> Result<Route, Error> {
        self.near.worth.failed = false;
        if self.find_near()? == Served::Yes || self.try_near()? == Served::Yes {
            return Ok(Route::Near);
        }
        self.drop_near();
        self.pairs.drop_removed();
        let route = self.edit_or_rebuild();
        self.report.plan.no_near = self.near.none;
        route
    }

    pub(super) fn may_edit(&self) -> bool {
        self.config.strategy != Strategy::Pbig && self.config.backend != Backend::Brute
    }

    /// Whether so many boxes have changed that to walk all that is kept costs less than to tell them apart.
    pub(super) fn many_changed(&self) -> bool {
        self.changed.len() * 4 >= self.present_count as usize
    }

    /// Near pairs are always few enough.
    pub(super) fn check_room(&self, route: Route) -> Result<(), Error> {
        let kept = (self.pair_count() + self.events.added.len()) as u64;
        if route != Route::Near && kept > PairStore::MOST {
            return Err(Error::TooManyPairs { limit: PairStore::MOST });
        }
        Ok(())
    }

    /// Builds the base anew from all boxes and searches it.
    pub(super) fn search_all(&mut self) -> Result<Route, Error> {
        let state = state!(self);
        let filters = Some(&self.filters[..]);
        let rule = Rule { accept: &state, filters, before: &self.before };
        let summary = LazySummary::new(&self.boxes, self.base.spare.take());
        let invalid = self.report.invalid;
        self.has_base = false;
        let (boxes, config) = (&self.boxes, &self.config);
        let added = Some(&mut self.events.added);
        let found = self.base.find_into(added, boxes, &summary, config, &rule, &mut self.report);
        self.base.spare = summary.into_spare();
        found?;
        self.report.invalid = invalid;
        // A search by another strategy leaves no base grid to keep.
        self.has_base = self.config.strategy != Strategy::Pbig || self.config.backend == Backend::Brute;
        self.base_plan = self.report.plan.clone();
        (self.base_checks, self.strain) = (self.report.checks.made, 0);
        self.near.met = self.base.found.overlaps;
        Ok(Route::All)
    }

    /// Kept pairs that no longer hold, into `events.removed`, in no order; they are no longer kept.
    pub(super) fn find_removed(&mut self, route: Route) {
        if route == Route::Near {
            return;
        }
        let many = self.many_changed() || (route == Route::All && self.may_edit());
        let state = state!(self);
        let removed = &mut self.events.removed;
        #[cfg(feature = "gpu")]
        if route == Route::Gpu {
            let ending = Ending(state);
            return if many {
                self.pairs.end_many(&ending, removed)
            } else {
                self.pairs.end_few(&self.ending, &ending, removed)
            };
        }
        if route == Route::Edits {
            self.pairs.end_found(removed);
        } else if many {
            self.pairs.end_many(&state, removed);
        } else {
            self.pairs.end_few(&self.changed, &state, removed);
        }
    }

    /// Keeps the added pairs, and forgets the changes.
    pub(super) fn store(&mut self, route: Route) {
        if route != Route::Near {
            self.pairs.insert(&self.events.added);
        }
        self.forget_changes();
        self.changed.clear();
        self.refiltered.clear();
        #[cfg(feature = "gpu")]
        for id in self.ending.drain(..) {
            self.flags[id as usize] &= !flag::ENDING;
        }
        self.updates += 1;
    }

    /// What boxes are is what they were. Box by box where all have changed, too: memmove, of all of them at once, takes ten
    /// times as long on some processors (Zen, where what it copies to is not aligned).
    fn forget_changes(&mut self) {
        self.near.movers.begin(self.changed.len(), &mut self.flags);
        let Self { boxes, before, flags, changed, .. } = self;
        const NEWS: u8 = flag::CHANGED | flag::REFILTERED;
        if changed.len() < RANGES_FROM || changed.len() * 4 < boxes.len() {
            for &id in changed.iter() {
                before[id as usize] = boxes[id as usize];
                let flags = &mut flags[id as usize];
                *flags = *flags & !NEWS | flag::MOVED;
            }
            return;
        }
        let boxes = before.chunks_mut(RANGE).zip(boxes.chunks(RANGE));
        share::for_each(has_threads(), boxes.zip(flags.chunks_mut(RANGE)), |((before, boxes), flags)| {
            for ((before, aabb), flags) in before.iter_mut().zip(boxes).zip(flags) {
                if *flags & flag::CHANGED != 0 {
                    *before = *aabb;
                    *flags &= !NEWS;
                }
            }
        });
    }

    pub(super) fn sort_events(&mut self) {
        let (added, removed, ids) = (&mut self.events.added, &mut self.events.removed, self.boxes.len());
        let [one, other] = &mut self.sorting;
        let is_shared = added.len() + removed.len() > PARALLEL_FROM && has_threads();
        let lists = [(added, one), (removed, other)].into_iter();
        share::for_each(is_shared, lists, |(events, scratch)| emit::sort(events, ids, scratch));
    }
}

/// The boxes now and at the last update.
#[derive(Clone, Copy)]
pub(super) struct State<'a> {
    pub(super) boxes: &'a [Aabb],
    pub(super) before: &'a [Aabb],
    pub(super) filters: &'a [ProxyFilter],
    pub(super) flags: &'a [u8],
    pub(super) refiltered: &'a HashMap<u32, Old>,
}

impl State<'_> {
    pub(super) fn flags(&self, a: u32, b: u32) -> u8 {
        self.flags[a as usize] | self.flags[b as usize]
    }

    pub(super) fn filters_allow(&self, a: u32, b: u32) -> bool {
        self.filters[a as usize].allows(&self.filters[b as usize])
    }

    pub(super) fn paired_before(&self, a: u32, b: u32) -> bool {
        if self.flags(a, b) & flag::REFILTERED == 0 {
            return self.before[a as usize].overlaps(&self.before[b as usize]);
        }
        let (a, b) = (self.old(a), self.old(b));
        a.aabb.overlaps(&b.aabb) && a.filter.allows(&b.filter)
    }

    pub(super) fn old(&self, id: u32) -> Old {
        let now = Old { aabb: self.before[id as usize], filter: self.filters[id as usize] };
        self.refiltered.get(&id).copied().unwrap_or(now)
    }
}

impl Judgement for State<'_> {
    #[inline(always)]
    fn prepare(&self, pair: Pair) {
        for id in [pair.a, pair.b] {
            prefetch(&self.boxes[id as usize]);
        }
    }

    /// Absent and invalid boxes are NaN and overlap nothing.
    #[inline(always)]
    fn holds(&self, pair: Pair) -> bool {
        let Pair { a, b } = pair;
        let overlap = self.boxes[a as usize].overlaps(&self.boxes[b as usize]);
        let refiltered = self.flags(a, b) & flag::REFILTERED != 0;
        overlap && (!refiltered || self.filters_allow(a, b))
    }
}

/// Two boxes that overlap now, do they pair now, and did they not at the last update?
impl Accept for State<'_> {
    #[inline(always)]
    fn prepare(&self, ids: [u32; 2]) {
        for id in ids {
            prefetch(&self.filters[id as usize]);
            prefetch(&self.flags[id as usize]);
        }
    }

    #[inline]
    fn pair(&self, pair: Pair) -> bool {
        let Pair { a, b } = pair;
        self.flags(a, b) & flag::CHANGED != 0 && self.filters_allow(a, b) && !self.paired_before(a, b)
    }

    /// Boxes that did not overlap before did not pair.
    #[inline]
    fn fresh(&self, pair: Pair) -> bool {
        let Pair { a, b } = pair;
        let refiltered = self.flags(a, b) & flag::REFILTERED != 0;
        self.filters_allow(a, b) && !(refiltered && self.paired_before(a, b))
    }
}
