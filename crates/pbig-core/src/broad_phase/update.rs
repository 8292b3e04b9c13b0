//! An update: choose an engine, run it, keep the pairs, report.

use super::engines::Task;
use super::{BroadPhase, Events};
use crate::holder::Holder;
use crate::outcome::{End, Outcome};
use crate::pairs::Comparison;
use crate::policy::{self, Counts, Work};
use crate::report::Clock;
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
        // An engine writes into the memory of the last events.
        self.swap_events();
        let done = self.update_pairs();
        if done.is_err() {
            self.fail();
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
        self.last_events = self.comparison.added.len() + self.comparison.removed.len();
        self.world.forget_changes();
        self.world.keep_old = self.old_to_keep();
        Ok(())
    }

    fn find_events(&mut self) -> Result<(), Error> {
        if self.device.is_wanted(&self.config, Work::Update, &mut self.report) {
            let outcome = self.run(None);
            if self.take(outcome)? {
                return Ok(());
            }
        }
        let engine = self.choose_engine();
        let outcome = self.run(Some(engine));
        if engine != Engine::Rebuild {
            self.given_up.note(outcome.end == End::GivenUp, self.world.changed.len());
        }
        if !self.take(outcome)? {
            let outcome = self.run(Some(Engine::Rebuild));
            let is_done = self.take(outcome)?;
            debug_assert!(is_done, "a rebuild never gives up");
        }
        Ok(())
    }

    fn choose_engine(&mut self) -> Engine {
        if self.config.backend == Backend::Brute {
            return Engine::Rebuild;
        }
        let counts = Counts {
            boxes: self.world.present.len(),
            changed: self.world.changed.len(),
            knows_old: self.world.knows_old(),
            holder: self.holder,
            spilled: self.store.grid.spilled(),
            events: self.last_events,
        };
        let engine = policy::choose_engine(&counts, self.config.engine);
        match self.config.engine {
            Some(_) => engine,
            None => self.given_up.instead_of(engine, counts.changed),
        }
    }

    /// Runs an engine; the device, if none is given.
    fn run(&mut self, engine: Option<Engine>) -> Outcome {
        let Self { world, config, holder, store, kept, comparison: events, .. } = self;
        let mut task = Task { world, config, holder: *holder, store, kept, events };
        match engine {
            Some(engine) => self.engines.run(engine, &mut task),
            None => self.engines.run_on(&mut self.device, &mut task),
        }
    }

    /// Adds an outcome to the report, and applies the events to the kept pairs. Returns false if the engine gave up.
    fn take(&mut self, outcome: Outcome) -> Result<bool, Error> {
        let has_replaced_kept = outcome.has_replaced_kept;
        self.holder = outcome.holder;
        let is_done = self.report.add(outcome, &self.config)?;
        if is_done && !has_replaced_kept {
            self.apply_events()?;
        }
        Ok(is_done)
    }

    /// Keeps the added pairs of an engine, and forgets the ended ones.
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
        self.report.stages.diff = clock.lap();
        Ok(())
    }

    /// Makes the next update begin from the boxes and the kept pairs alone.
    fn fail(&mut self) {
        self.holder = Holder::Nothing;
        self.comparison.clear();
    }

    /// Gives back a piece of the memory that a peak has left.
    fn settle(&mut self) {
        let Comparison { added, removed, dropped, .. } = &*self.comparison;
        let (pairs, events) = (self.kept.len(), added.len() + removed.len() + dropped.len());
        self.engines.settle(pairs);
        self.comparison.settle(events);
        self.kept.settle(events);
        self.store.settle(self.holder);
    }

    /// Returns the number of old states to keep until the next update.
    pub(super) fn old_to_keep(&self) -> usize {
        policy::old_states_to_keep(self.len(), self.config.engine)
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
