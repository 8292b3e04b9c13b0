//! An update: look up or search, keep the pairs, report.

use super::tree::Tree;
use super::{BroadPhase, Events, Task};
use crate::pairs::Differences;
use crate::policy;
use crate::report::{Clock, Report};
use crate::{Backend, Engine, Error, Plan};

impl BroadPhase {
    /// Finds what has changed since the last update. Takes next to no time when nothing has.
    ///
    /// # Errors
    /// [`Error::TooManyPairs`]; the changes are kept, and the next update sees them again.
    pub fn update(&mut self) -> Result<&Events, Error> {
        self.events.added.clear();
        self.events.removed.clear();
        self.begin_report();
        // The memory of the last events takes the new ones.
        self.swap_events();
        let done = self.update_pairs();
        if done.is_err() {
            self.comparison.clear();
        }
        self.settle();
        self.swap_events();
        self.report.pairs = self.kept.len() as u64;
        done.map(|()| &self.events)
    }

    fn swap_events(&mut self) {
        std::mem::swap(&mut *self.comparison.events.added, &mut self.events.added);
        std::mem::swap(&mut *self.comparison.events.removed, &mut self.events.removed);
    }

    /// Leaves the events, and forgets the changes.
    fn update_pairs(&mut self) -> Result<(), Error> {
        self.comparison.clear();
        if self.world.changed.is_empty() {
            return Ok(());
        }
        self.kept.reserve_ids(self.world.ids());
        let mut tree = std::mem::take(&mut self.world.tree);
        let done = self.find_events(&mut tree).and_then(|()| self.apply_events());
        if done.is_ok() {
            tree.end_update(&self.world);
            self.world.forget_changes();
        }
        self.world.tree = tree;
        self.last = self.report.plan.algorithm;
        done
    }

    fn find_events(&mut self, tree: &mut Tree) -> Result<(), Error> {
        if self.device.is_wanted(self.config.backend, None, &mut self.report) && self.search(tree, true)? {
            return Ok(());
        }
        let changed = self.world.changed.len();
        if self.chooses_look_ups(tree, changed) {
            let is_done = self.look_up(tree);
            self.given_up.note(!is_done, changed);
            if is_done {
                return Ok(());
            }
        }
        let is_done = self.search(tree, false)?;
        debug_assert!(is_done, "a search on the CPU never gives up");
        Ok(())
    }

    /// Looks the changed boxes up. Returns false if that takes too much work.
    fn look_up(&mut self, tree: &mut Tree) -> bool {
        let Self { look_up, world, config, kept, comparison, report, .. } = self;
        look_up.run(&mut Task { world, tree, config, kept, comparison, report })
    }

    /// Searches all boxes, on the device or the CPU. Returns false if the device could not do it.
    fn search(&mut self, tree: &mut Tree, is_on_device: bool) -> Result<bool, Error> {
        let Self { device, search, world, config, kept, comparison, report, .. } = self;
        let mut task = Task { world, tree, config, kept, comparison, report };
        search.run(&mut task, is_on_device.then_some(device))
    }

    /// Chooses whether the changed boxes are looked up. A search that is made because look-ups were given up counts as one of those to come.
    fn chooses_look_ups(&mut self, tree: &mut Tree, changed: usize) -> bool {
        match self.config.engine {
            _ if self.config.backend == Backend::Brute => return false,
            Some(engine) => return engine == Engine::LookUp,
            None => {}
        }
        let boxes = self.world.present.len();
        if !policy::may_look_up(boxes, changed) || self.given_up.forbids(changed) {
            return false;
        }
        let arrived = (self.world.noted.arrived as usize).min(changed);
        policy::may_place(boxes, arrived) || policy::may_place(boxes, tree.arrivals(&self.world))
    }

    /// Keeps the added pairs, and forgets the ended ones, unless the search has replaced the kept pairs.
    fn apply_events(&mut self) -> Result<(), Error> {
        if self.comparison.is_kept {
            return Ok(());
        }
        let mut clock = Clock::start();
        let Differences { added, removed } = &self.comparison.events;
        let limit = self.config.limits.pairs();
        if (self.kept.len() + added.len() - removed.len()) as u64 > limit {
            return Err(Error::TooManyPairs { limit });
        }
        self.kept.apply(added, removed);
        self.report.stages.diff += clock.lap();
        Ok(())
    }

    /// Gives back a piece of the memory that a peak has left.
    fn settle(&mut self) {
        let Differences { added, removed } = &self.comparison.events;
        let (pairs, events) = (self.kept.len(), added.len() + removed.len());
        self.look_up.settle();
        self.search.settle(pairs);
        self.comparison.settle(events);
        self.kept.settle(events);
    }

    fn begin_report(&mut self) {
        let (boxes, valid) = (self.world.present.len() as u64, self.world.noted.valid);
        // A backend that was asked for stays unavailable until a call on it succeeds.
        let fallback = self.report.fallback.take().filter(|_| self.config.backend == Backend::Device);
        self.report = Report {
            boxes,
            invalid: boxes - u64::from(valid),
            changed: self.world.changed.len() as u64,
            plan: Plan { boxes: valid, ..Plan::default() },
            fallback,
            ..Report::default()
        };
    }
}
