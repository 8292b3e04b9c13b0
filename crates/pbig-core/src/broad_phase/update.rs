//! An update: what was added, what has ended, and the kept pairs brought up to date.

#[cfg(feature = "gpu")]
use super::device::Ending;
use super::{BroadPhase, Old, flag};
use crate::cpu::codes::prefetch;
use crate::cpu::crowding::Set;
use crate::cpu::edit::Changed;
use crate::cpu::emit;
use crate::cpu::find::Others;
use crate::cpu::judge::Accept;
use crate::diff::{Judgement, PairStore};
use crate::plan::{Chosen, LazySummary, Plan};
use crate::report::{Checks, lap, stage};
use crate::search::Rule;
use crate::{Aabb, Backend, Error, Pair, ProxyFilter, Strategy};
use std::collections::HashMap;
use std::time::Instant;

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
#[cfg(feature = "gpu")]
pub(super) use state;

/// Events from which both lists are sorted at once.
const PARALLEL_FROM: usize = 4096;

impl BroadPhase {
    /// Pairs that overlap now and did not, into `events.added`, in no order; true when a device has found them, and
    /// told which boxes have lost pairs.
    pub(super) fn find_added(&mut self) -> Result<bool, Error> {
        #[cfg(feature = "gpu")]
        let on_gpu = self.find_changes_on_gpu()?;
        #[cfg(not(feature = "gpu"))]
        let on_gpu = self.base.miss_gpu(&self.config, &mut self.report);
        if !on_gpu {
            self.find_added_on_cpu()?;
        }
        Ok(on_gpu)
    }

    fn find_added_on_cpu(&mut self) -> Result<(), Error> {
        let whole = self.many_changed()
            || self.config.strategy == Strategy::Pbig
            || self.config.backend == Backend::Brute
            || !self.has_base;
        if whole {
            return self.search_all();
        }
        self.edit_base();
        // Boxes that left their cells and came to rest go back into the base when looking at them again and
        // again has cost as much as building it.
        self.sorted_again += self.moved.len();
        let present = self.present_count as usize;
        if self.moved.len() * 8 >= present || self.sorted_again > 2 * present {
            self.search_all()
        } else {
            self.search_changed()
        }
    }

    /// Whether so many boxes have changed that to look at all costs less than to tell them apart.
    pub(super) fn many_changed(&self) -> bool {
        self.changed.len() * 8 >= self.present_count as usize
    }

    pub(super) fn check_room(&self) -> Result<(), Error> {
        let kept = (self.pairs.len() + self.events.added.len()) as u64;
        if kept > PairStore::MOST {
            return Err(Error::TooManyPairs { limit: PairStore::MOST });
        }
        Ok(())
    }

    /// Builds the base anew from all boxes and searches it.
    fn search_all(&mut self) -> Result<(), Error> {
        let state = state!(self);
        let filters = Some(&self.filters[..]);
        let rule = Rule { accept: &state, filters, filters_suffice: false, before: &self.before };
        let summary = LazySummary::new(&self.boxes, None, self.base.spare.take());
        let invalid = self.report.invalid;
        self.has_base = false;
        let report = &mut self.report;
        let found = self.base.find_without_gpu(&self.boxes, &summary, &self.config, &rule, report);
        self.base.spare = summary.into_spare();
        found?;
        self.report.invalid = invalid;
        self.forget_moved();
        // A search by another strategy leaves no base grid to keep.
        self.has_base = self.report.plan.chosen != Chosen::Pbig;
        self.base.found.chunks.iter().for_each(|chunk| self.events.added.extend_from_slice(chunk));
        Ok(())
    }

    /// No box has left its cell since the base was built.
    pub(super) fn forget_moved(&mut self) {
        for id in self.moved.drain(..) {
            self.flags[id as usize] &= !flag::LOOSE;
        }
        self.sorted_again = 0;
    }

    /// Writes the changed boxes to their places in the base; those that have left their cells become loose.
    fn edit_base(&mut self) {
        let mut clock = Instant::now();
        stage!("map");
        let update = self.present_update();
        let (ids, boxes, before, filters) = (&self.changed, &self.boxes, &self.before, &self.filters);
        let changed = Changed { ids, boxes, before, filters, update };
        let (flags, moved, mut back) = (&mut self.flags, &mut self.moved, false);
        self.base.map.edit(&changed, &mut self.others, |id, is_home| {
            let flags = &mut flags[id as usize];
            let was_loose = *flags & flag::LOOSE != 0;
            back |= was_loose && is_home;
            *flags = *flags & !flag::LOOSE | if is_home { 0 } else { flag::LOOSE };
            if !is_home && !was_loose {
                moved.push(id);
            }
        });
        if back {
            moved.retain(|&id| flags[id as usize] & flag::LOOSE != 0);
        }
        self.report.stages.map += lap(&mut clock);
    }

    fn present_update(&self) -> u64 {
        self.updates + 1
    }

    /// Searches the base and the loose boxes for the changed ones.
    fn search_changed(&mut self) -> Result<(), Error> {
        // The last ones may have come home.
        let plan = if self.moved.is_empty() { Plan::default() } else { self.build_loose() };
        let mut clock = Instant::now();
        stage!("check");
        let update = self.present_update();
        let (state, limit, added) =
            (OfChanged(state!(self)), self.config.limits.max_pairs, &mut self.events.added);
        let others = Others { records: &self.others, filters: &self.filters, update: Some(update) };
        let (mut made, mut overlaps) = self.base.map.check_others(&others, &state, added, limit)?;
        if !self.moved.is_empty() {
            let others = Others { update: None, ..others };
            let (more, of_them) = self.loose.check_others(&others, &state, added, limit)?;
            (made, overlaps) = (made + more, overlaps + of_them);
        }
        self.report.stages.check += lap(&mut clock);
        self.report.checks = Checks { made, unnecessary: made - overlaps, redundant: 0 };
        let moved = self.moved.len() as u32;
        self.report.plan = Plan { chosen: Chosen::Edit, moved, boxes: self.valid_count(), ..plan };
        Ok(())
    }

    /// Sorts the loose boxes.
    fn build_loose(&mut self) -> Plan {
        let summary = LazySummary::new(&self.boxes, Some(&self.moved), self.base.spare.take());
        let set = Set {
            boxes: &self.boxes,
            filters: Some(&self.filters),
            ids: Some(&self.moved),
            summary: &summary,
            before: &self.before,
        };
        let plan = self.loose.plan_and_build(&set, &self.config, &mut self.report.stages);
        self.base.spare = summary.into_spare();
        plan
    }

    /// Kept pairs that no longer hold, into `events.removed`, in no order; they are no longer kept.
    #[cfg_attr(not(feature = "gpu"), expect(unused_variables, reason = "nobody tells"))]
    pub(super) fn find_removed(&mut self, is_told: bool) {
        let many = self.many_changed();
        let state = state!(self);
        let removed = &mut self.events.removed;
        #[cfg(feature = "gpu")]
        if is_told {
            let ending = Ending(state);
            return if many {
                self.pairs.end_many(&ending, removed)
            } else {
                self.pairs.end_few(&self.ending, &ending, removed)
            };
        }
        if many {
            self.pairs.end_many(&state, removed);
        } else {
            self.pairs.end_few(&self.changed, &state, removed);
        }
    }

    /// Keeps the added pairs, and forgets the changes.
    pub(super) fn store(&mut self) {
        self.pairs.insert(&self.events.added);
        // Box by box where all have changed, too: memmove, of all of them at once, takes ten times as long on some
        // processors (Zen, where what it copies to is not aligned).
        for &id in &self.changed {
            self.before[id as usize] = self.boxes[id as usize];
            self.flags[id as usize] &= !(flag::CHANGED | flag::REFILTERED);
        }
        self.changed.clear();
        self.refiltered.clear();
        #[cfg(feature = "gpu")]
        for id in self.ending.drain(..) {
            self.flags[id as usize] &= !flag::ENDING;
        }
        self.updates += 1;
    }

    pub(super) fn sort_events(&mut self) {
        let (added, removed, ids) = (&mut self.events.added, &mut self.events.removed, self.boxes.len());
        let [one, other] = &mut self.sorting;
        if added.len() + removed.len() > PARALLEL_FROM {
            rayon::join(|| emit::sort(added, ids, one), || emit::sort(removed, ids, other));
        } else {
            emit::sort(added, ids, one);
            emit::sort(removed, ids, other);
        }
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

    fn filters_allow(&self, a: u32, b: u32) -> bool {
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

    #[inline(always)]
    fn concerns(&self, pair: Pair) -> bool {
        self.flags(pair.a, pair.b) & flag::CHANGED != 0
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
        self.concerns(pair) && self.filters_allow(a, b) && !self.paired_before(a, b)
    }

    /// Boxes that did not overlap before did not pair.
    #[inline]
    fn fresh(&self, pair: Pair) -> bool {
        let Pair { a, b } = pair;
        let refiltered = self.flags(a, b) & flag::REFILTERED != 0;
        self.filters_allow(a, b) && !(refiltered && self.paired_before(a, b))
    }
}

/// The same of two boxes of which the first has changed. Of two that have, it is asked from both sides.
struct OfChanged<'a>(State<'a>);

impl Accept for OfChanged<'_> {
    #[inline(always)]
    fn prepare(&self, ids: [u32; 2]) {
        Accept::prepare(&self.0, ids);
    }

    #[inline(always)]
    fn meets(&self, query: u32, candidate: u32) -> bool {
        query < candidate || self.0.flags[candidate as usize] & flag::CHANGED == 0
    }

    fn pair(&self, pair: Pair) -> bool {
        self.0.pair(pair)
    }

    fn fresh(&self, pair: Pair) -> bool {
        self.0.fresh(pair)
    }
}
