//! An update: look up or search, keep the pairs, report.

use super::tree::Tree;
use super::{BroadPhase, Events, Task};
use crate::pairs::Differences;
use crate::policy::{self, GivenUp};
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
        let Self { device, look_up, search, given_up, world, config, kept, comparison, report, .. } = self;
        let mut task = Task { world, tree, config, kept, comparison, report };
        if device.is_wanted(config.backend, None, task.report) && search.run(&mut task, Some(device))? {
            return Ok(());
        }
        if task.chooses_look_ups(given_up) {
            let is_done = look_up.run(&mut task);
            given_up.note(!is_done, world.changed.len());
            if is_done {
                return Ok(());
            }
        }
        let is_done = search.run(&mut task, None)?;
        debug_assert!(is_done, "a search on the CPU never gives up");
        Ok(())
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

impl Task<'_> {
    /// Chooses whether the changed boxes are looked up. A search that is made because look-ups were given up counts as one of those to
    /// come without them.
    fn chooses_look_ups(&mut self, given_up: &mut GivenUp) -> bool {
        let world = self.world;
        match self.config.engine {
            _ if self.config.backend == Backend::Brute => return false,
            Some(engine) => return engine == Engine::LookUp,
            None => {}
        }
        let (boxes, changed) = (world.present.len(), world.changed.len());
        if !policy::may_look_up(boxes, changed) || given_up.forbids(changed) {
            return false;
        }
        let arrived = (world.noted.arrived as usize).min(changed);
        policy::may_place(boxes, arrived) || policy::may_place(boxes, self.tree.arrivals(world))
    }
}
