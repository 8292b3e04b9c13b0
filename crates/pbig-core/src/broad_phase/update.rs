//! An update: look up or search, keep the pairs, report.

use super::look_up::LookUp;
use super::search::Search;
use super::tree::Tree;
use super::{BroadPhase, Events, Task};
use crate::pairs::Comparison;
use crate::policy::{self, Work};
use crate::report::Clock;
use crate::search::DeviceSlot;
use crate::search::{End, Outcome};
use crate::{Backend, Engine, Error, Plan};

/// The ways to find events, with their buffers.
struct Parts<'a> {
    device: &'a mut DeviceSlot,
    look_up: &'a mut LookUp,
    search: &'a mut Search,
}

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
        self.comparison.added.swap_list(&mut self.events.added);
        self.comparison.removed.swap_list(&mut self.events.removed);
    }

    /// Leaves the events, and forgets the changes.
    fn update_pairs(&mut self) -> Result<(), Error> {
        self.comparison.clear();
        if self.world.changed.is_empty() {
            return Ok(());
        }
        self.kept.reserve_ids(self.world.ids());
        self.find_events()?;
        let mut tree = std::mem::take(&mut self.world.tree);
        tree.end_update(&self.world);
        self.world.tree = tree;
        self.world.forget_changes();
        Ok(())
    }

    fn find_events(&mut self) -> Result<(), Error> {
        let changed = self.world.changed.len();
        if self.device.is_wanted(&self.config, Work::Update, &mut self.report) {
            let outcome = self.run(|parts, task, tree| parts.search.run(task, tree, Some(parts.device)));
            if self.take(outcome)? {
                return Ok(());
            }
        }
        if self.chooses_look_ups(changed) {
            let outcome = self.run(|parts, task, tree| parts.look_up.run(task, tree));
            self.given_up.note(outcome.end == End::GivenUp, changed);
            if self.take(outcome)? {
                return Ok(());
            }
        }
        let outcome = self.run(|parts, task, tree| parts.search.run(task, tree, None));
        let is_done = self.take(outcome)?;
        debug_assert!(is_done, "a search on the CPU never gives up");
        Ok(())
    }

    /// Chooses whether the changed boxes are looked up. A search that is made because look-ups were given up counts as one of those to come.
    fn chooses_look_ups(&mut self, changed: usize) -> bool {
        match self.config.engine {
            _ if self.config.backend == Backend::Brute => return false,
            Some(engine) => return engine == Engine::LookUp,
            None => {}
        }
        let boxes = self.world.present.len();
        if !policy::may_look_up(boxes, changed) || self.given_up.forbids(changed) {
            return false;
        }
        let are_few = policy::may_place(boxes, self.world.arrivals());
        if !are_few && self.jumped.forbids(0) {
            return false;
        }
        self.jumped.note(!are_few, 0);
        true
    }

    /// Runs one of the ways to make an update.
    fn run(&mut self, way: impl FnOnce(Parts<'_>, &mut Task<'_>, &mut Tree) -> Outcome) -> Outcome {
        let mut tree = std::mem::take(&mut self.world.tree);
        let Self { device, look_up, search, world, config, kept, comparison: events, .. } = self;
        let mut task = Task { world, config, kept, events };
        let outcome = way(Parts { device, look_up, search }, &mut task, &mut tree);
        self.world.tree = tree;
        outcome
    }

    /// Adds an outcome to the report, and applies the events to the kept pairs. Returns false if it was given up.
    fn take(&mut self, outcome: Outcome) -> Result<bool, Error> {
        let has_replaced_kept = outcome.has_replaced_kept;
        self.last = outcome.plan.algorithm;
        let is_done = self.report.add(outcome, &self.config)?;
        if is_done && !has_replaced_kept {
            self.apply_events()?;
        }
        Ok(is_done)
    }

    /// Keeps the added pairs, and forgets the ended ones.
    fn apply_events(&mut self) -> Result<(), Error> {
        let mut clock = Clock::start();
        let events = &self.comparison;
        let gone = events.removed.len() + events.dropped.len();
        let limit = self.config.limits.pairs();
        if (self.kept.len() + events.added.len() - gone) as u64 > limit {
            return Err(Error::TooManyPairs { limit });
        }
        self.kept.apply(&[], &events.dropped);
        self.kept.apply(&events.added, &events.removed);
        self.report.stages.diff += clock.lap();
        Ok(())
    }

    /// Gives back a piece of the memory that a peak has left.
    fn settle(&mut self) {
        let Comparison { added, removed, dropped, .. } = &*self.comparison;
        let (pairs, events) = (self.kept.len(), added.len() + removed.len() + dropped.len());
        self.look_up.settle();
        self.search.settle(pairs);
        self.comparison.settle(events);
        self.kept.settle(events);
    }

    /// Begins an empty report.
    fn begin_report(&mut self) {
        let present = self.world.present.len() as u64;
        let report = &mut self.report;
        (report.stages, report.checks, report.work) = Default::default();
        report.boxes = present;
        report.invalid = present - u64::from(self.world.valid);
        report.changed = self.world.changed.len() as u64;
        report.plan = Plan { boxes: self.world.valid, ..Plan::default() };
        report.device = None;
        // A backend that was asked for stays unavailable until a call on it succeeds.
        if self.config.backend != Backend::Device {
            report.fallback = None;
        }
    }
}
