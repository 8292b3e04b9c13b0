//! An update: what was added, what has ended, and the kept pairs brought up to date.

use super::{BroadPhase, Home, Old, UNCHANGED};
use crate::cpu::check::Checker;
use crate::cpu::crowding::Set;
use crate::diff::PairStore;
use crate::finder::{Rule, single_entry_checks};
use crate::plan::{Chosen, Plan, Summary};
use crate::report::{lap, stage};
use crate::{Aabb, Backend, Config, Error, Pair, ProxyFilter, Strategy};
use std::time::Instant;

impl BroadPhase {
    /// Pairs that overlap now and did not, into `events.added`.
    pub(super) fn find_added(&mut self) -> Result<(), Error> {
        for old in &self.changed {
            if std::mem::replace(&mut self.home[old.id as usize], Home::Moved) != Home::Moved {
                self.moved.push(old.id);
            }
        }
        let whole = self.config.strategy == Strategy::Pbig
            || self.config.backend == Backend::Brute
            || self.base.expects_gpu(&self.config)
            || !self.has_base;
        // Boxes that moved once and came to rest go back into the base when looking at them again and
        // again has cost as much as building it.
        self.sorted_again += self.moved.len();
        let present = self.present_count as usize;
        if whole || self.moved.len() * 8 >= present || self.sorted_again > 2 * present {
            self.search_all()?;
        } else {
            self.search_moved()?;
        }
        let kept = (self.pairs.len() + self.events.added.len()) as u64;
        if kept > PairStore::MOST {
            return Err(Error::TooManyPairs { limit: PairStore::MOST });
        }
        let mut clock = Instant::now();
        stage!("emit");
        self.events.added.sort_unstable();
        self.report.stages.emit += lap(&mut clock);
        Ok(())
    }

    /// Builds the base anew from all boxes and searches it.
    fn search_all(&mut self) -> Result<(), Error> {
        let state = State {
            boxes: &self.boxes,
            filters: &self.filters,
            changed: &self.changed,
            change_of: &self.change_of,
        };
        let (boxes, invalid) = (self.report.boxes, self.report.invalid);
        let accept = |a: u32, b: u32| state.is_added(a, b);
        let rule = Rule { accept: &accept, filters: Some(&self.filters), filters_suffice: false };
        self.has_base = false;
        // After a search on a GPU there is no base. Where little moves it is worth having: the CPU builds it.
        let few = self.moved.len() * 8 < self.present_count as usize;
        let backend = match self.config.backend {
            Backend::Auto if few => Backend::Cpu,
            backend => backend,
        };
        let config = Config { backend, ..self.config };
        self.base.find(&self.boxes, &config, &rule, &mut self.report)?;
        (self.report.boxes, self.report.invalid) = (boxes, invalid);
        self.moved.clear();
        self.sorted_again = 0;
        // A search by another strategy leaves no base grid to keep.
        self.has_base = self.report.gpu.is_none() && self.report.plan.chosen != Chosen::Pbig;
        let kept = if self.has_base { Home::Base } else { Home::None };
        for (home, aabb) in self.home.iter_mut().zip(&self.boxes) {
            *home = if aabb.is_valid() { kept } else { Home::None };
        }
        self.base.found.chunks.iter().for_each(|chunk| self.events.added.extend_from_slice(chunk));
        Ok(())
    }

    /// Sorts the boxes that moved since the base was built, and searches them and the base.
    fn search_moved(&mut self) -> Result<(), Error> {
        let mut clock = Instant::now();
        let summary = Summary::of(&self.boxes, Some(&self.moved));
        let stages = &mut self.report.stages;
        stages.plan += lap(&mut clock);
        let set = Set {
            boxes: &self.boxes,
            filters: Some(&self.filters),
            ids: Some(&self.moved),
            summary: &summary,
        };
        let plan = self.loose.plan_and_build(&set, &self.config, stages);
        let state = State {
            boxes: &self.boxes,
            filters: &self.filters,
            changed: &self.changed,
            change_of: &self.change_of,
        };
        let max_pairs = self.config.limits.max_pairs;
        let mut clock = Instant::now();
        self.loose.find(&|a, b| state.is_added(a, b), max_pairs, &mut self.found)?;
        self.found.chunks.iter().for_each(|chunk| self.events.added.extend_from_slice(chunk));
        stage!("check");
        // Entries of boxes that have left the base are still in it: their home says so.
        let accept = |a: u32, b: u32| self.home[b as usize] == Home::Base && state.is_added(a, b);
        let mut checker = Checker::new(&accept, &mut self.events.added);
        for old in &self.changed {
            let (aabb, filter) = (self.boxes[old.id as usize], &self.filters[old.id as usize]);
            if aabb.is_valid() {
                self.base.map.check_one(&aabb, filter, old.id, &mut checker);
            }
            if checker.out.len() as u64 > max_pairs {
                return Err(Error::TooManyPairs { limit: max_pairs });
            }
        }
        self.found.checks += checker.checks;
        self.found.overlaps += checker.overlaps;
        self.report.stages.check += lap(&mut clock);
        self.report.checks = single_entry_checks(&self.found);
        let moved = self.moved.len() as u32;
        self.report.plan = Plan { chosen: Chosen::Edit, moved, boxes: self.valid_count(), ..plan };
        Ok(())
    }

    /// Kept pairs that no longer hold, into `events.removed` and, by place, `ended`.
    pub(super) fn find_removed(&mut self) {
        let state = State {
            boxes: &self.boxes,
            filters: &self.filters,
            changed: &self.changed,
            change_of: &self.change_of,
        };
        let (ended, removed) = (&mut self.ended, &mut self.events.removed);
        ended.clear();
        let mut end = |(place, pair): (u32, Pair)| {
            if !state.holds_now(pair.a, pair.b) {
                ended.push(place);
                removed.push(pair);
            }
        };
        if self.changed.len() * 8 >= self.present_count as usize {
            // Most boxes changed: one walk in memory order beats many along links.
            self.pairs.iter().for_each(end);
        } else {
            for old in &self.changed {
                // A pair of two changed boxes is in both their lists: count it at the first.
                let first = |pair: &Pair| pair.a == old.id || self.change_of[pair.a as usize] == UNCHANGED;
                self.pairs.of(old.id).filter(|(_, pair)| first(pair)).for_each(&mut end);
            }
        }
        self.events.removed.sort_unstable();
    }

    /// Brings the kept pairs up to date and forgets the changes.
    pub(super) fn store(&mut self) {
        self.pairs.remove_all(&mut self.ended);
        for &pair in &self.events.added {
            self.pairs.insert(pair);
        }
        for old in self.changed.drain(..) {
            self.change_of[old.id as usize] = UNCHANGED;
        }
    }
}

/// The boxes now and at the last update.
struct State<'a> {
    boxes: &'a [Aabb],
    filters: &'a [ProxyFilter],
    changed: &'a [Old],
    change_of: &'a [u32],
}

impl State<'_> {
    /// Whether two boxes pair now. Absent and invalid boxes are NaN and overlap nothing.
    fn holds_now(&self, a: u32, b: u32) -> bool {
        let (a, b) = (a as usize, b as usize);
        self.boxes[a].overlaps(&self.boxes[b]) && self.filters[a].allows(&self.filters[b])
    }

    /// Whether two boxes that overlap now pair now and did not at the last update.
    #[inline]
    fn is_added(&self, a: u32, b: u32) -> bool {
        let (i, j) = (self.change_of[a as usize], self.change_of[b as usize]);
        if i == UNCHANGED && j == UNCHANGED {
            return false;
        }
        if !self.filters[a as usize].allows(&self.filters[b as usize]) {
            return false;
        }
        let ((box_a, filter_a), (box_b, filter_b)) = (self.before(a, i), self.before(b, j));
        !(box_a.overlaps(box_b) && filter_a.allows(filter_b))
    }

    fn before(&self, id: u32, change: u32) -> (&Aabb, &ProxyFilter) {
        match self.changed.get(change as usize) {
            Some(old) => (&old.aabb, &old.filter),
            None => (&self.boxes[id as usize], &self.filters[id as usize]),
        }
    }
}
