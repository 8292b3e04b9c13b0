//! An update by edits: boxes that have changed are put into other cells of the base grid and looked up there. While they are
//! put there, other threads walk the kept pairs for those that have ended, which may take longer: the one that edits then helps.
//! (1% of 100,000 boxes: 0.51 ms; the walk afterwards, and a search by one thread: 0.63.)

use super::BroadPhase;
use super::update::{Route, State, state};
use crate::cpu::edit::Changed;
use crate::cpu::find::Others;
use crate::cpu::judge::Accept;
use crate::cpu::map::Map;
use crate::cpu::record::Tracked;
use crate::plan::{Chosen, Looks, Plan};
use crate::report::{lap, stage};
use crate::search::single_entry_checks;
use crate::share::has_threads;
use crate::{Error, Pair, Updates, shared_from};
use std::time::{Duration, Instant};

/// Tests that take as long as to sort a box.
const TESTS_OF_A_BOX: u64 = 64;

/// What a walk takes for a pair, and an edit for a box, in ns: rather less than in most worlds.
const WALK: usize = 1;
const EDIT: usize = 100;

/// What either has to take, in ns, for other threads to be woken.
const SHARED_FROM: usize = shared_from(50_000);

impl BroadPhase {
    pub(super) fn edit_or_rebuild(&mut self) -> Result<Route, Error> {
        let pays = self.rebuild_pays();
        if pays || !self.may_edit() || !self.has_base {
            // One that a list has left to be done says nothing of updates without any.
            self.near.worth.failed |= !pays && self.may_edit();
            return self.search_all();
        }
        let is_shared = self.is_walk_shared();
        if !self.is_strained() && self.edit_and_walk(is_shared) {
            return self.search_changed(is_shared);
        }
        let clock = Instant::now();
        let route = self.search_all()?;
        self.rebuild.followed_edits(self.present_count as usize, clock.elapsed());
        Ok(route)
    }

    /// Whether all are to be searched anew although edits could do it.
    fn rebuild_pays(&mut self) -> bool {
        match self.config.study.updates {
            Updates::Auto | Updates::Near => {
                self.rebuild.pays(self.changed.len(), self.present_count as usize)
            }
            Updates::Edits => false,
            Updates::Anew => true,
        }
    }

    /// Whether edits have cost as much as it takes to build the base.
    fn is_strained(&self) -> bool {
        self.config.study.updates != Updates::Edits && self.strain > self.rebuild_cost()
    }

    /// Puts the changed boxes where they are now, and looks for the pairs that they have lost; whether enough of the base's
    /// order is left to search it.
    fn edit_and_walk(&mut self, is_shared: bool) -> bool {
        let mut clock = Instant::now();
        let walks = !self.many_changed();
        self.base.map.arrange(&mut self.changed, self.boxes.len());
        let (state, ids, update) = (state!(self), &self.changed, self.updates + 1);
        let State { boxes, before, filters, .. } = state;
        let changed = Changed { ids, boxes, before, filters, update };
        self.report.stages.map += lap(&mut clock);
        stage!("diff");
        let mut edit = || edit(&mut self.base.map, &changed, &mut self.others);
        let time = if walks { self.pairs.find_ended(ids, &state, is_shared, edit) } else { edit() };
        self.report.stages.map += time;
        self.report.stages.diff += lap(&mut clock).saturating_sub(time);
        self.base.map.out_of_order() * 8 < self.present_count as usize
    }

    /// Whether there will be a walk, and enough to do.
    fn is_walk_shared(&self) -> bool {
        let walks = !(self.many_changed() || self.pairs.is_linked());
        let least = (WALK * self.pairs.listed()).min(EDIT * self.changed.len());
        walks && least >= SHARED_FROM && has_threads()
    }

    /// Searches the base for the changed boxes.
    fn search_changed(&mut self, are_awake: bool) -> Result<Route, Error> {
        let mut clock = Instant::now();
        stage!("check");
        let (state, limit) = (OfChanged(state!(self)), self.config.limits.max_pairs);
        let update = Some(self.updates + 1);
        let others = Others { records: &self.others, filters: &self.filters, update, are_awake };
        self.base.map.check_others(&others, &state, &mut self.found, limit)?;
        self.found.chunks.iter().for_each(|chunk| self.events.added.extend_from_slice(chunk));
        self.report.stages.check += lap(&mut clock);
        self.report.checks = single_entry_checks(&self.found);
        self.note_strain(self.found.checks);
        let (moved, boxes) = (self.base.map.out_of_order() as u32, self.valid_count());
        let looks = Looks::default();
        self.report.plan = Plan { chosen: Chosen::Edit, moved, boxes, looks, ..self.base_plan.clone() };
        Ok(if self.many_changed() { Route::Few } else { Route::Edits })
    }

    /// Tests beyond what boxes needed when the base was built, twice over: many boxes have come to few cells, or to the
    /// list.
    fn note_strain(&mut self, made: u64) {
        let boxes = u64::from(self.base_plan.boxes.max(1));
        let usual = TESTS_OF_A_BOX + 4 * self.base_checks / boxes;
        self.strain += made.saturating_sub(self.others.len() as u64 * usual);
    }

    /// As many tests as it takes to build the base.
    fn rebuild_cost(&self) -> u64 {
        TESTS_OF_A_BOX * u64::from(self.present_count) + self.base_checks
    }
}

/// Puts changed boxes where they are now, in so much time.
fn edit(map: &mut Map<Tracked>, changed: &Changed<'_>, records: &mut Vec<Tracked>) -> Duration {
    stage!("map");
    let clock = Instant::now();
    map.edit(changed, records);
    clock.elapsed()
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
        self.0.comes_first(query, candidate)
    }

    fn pair(&self, pair: Pair) -> bool {
        self.0.pair(pair)
    }

    fn fresh(&self, pair: Pair) -> bool {
        self.0.fresh(pair)
    }
}
