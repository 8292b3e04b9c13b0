//! An update: choose an engine, run it, keep the pairs, report.

use super::edit::EditLimits;
use super::{BroadPhase, Events};
use crate::all_pairs::{AllPairs, Held, Request};
use crate::pairs::Grouping;
use crate::policy::{self, Counts};
use crate::report::{Clock, stage};
use crate::{Algorithm, Backend, Engine, Error, Plan};

impl BroadPhase {
    /// Finds what has changed since the last update. Takes next to no time when nothing has.
    ///
    /// # Errors
    /// [`Error::TooManyPairs`]; the changes are kept, and the next update sees them again.
    pub fn update(&mut self) -> Result<&Events, Error> {
        self.events.added.clear();
        self.events.removed.clear();
        self.begin_report();
        if !self.world.changed.is_empty() {
            self.kept.reserve_ids(self.world.ids());
            let done = self.find_events();
            if let Err(error) = done {
                self.fail();
                return Err(error);
            }
            self.finish();
        }
        self.report.pairs = self.kept.len() as u64;
        Ok(&self.events)
    }

    fn find_events(&mut self) -> Result<(), Error> {
        if self.find_on_device()? {
            return self.apply_events();
        }
        let no_device = self.report.plan.no_device;
        let found = self.find_on_cpu();
        self.report.plan.no_device = no_device;
        found
    }

    fn find_on_cpu(&mut self) -> Result<(), Error> {
        let changed = self.world.changed.len();
        let mut engine = self.engine();
        if self.config.engine.is_none() {
            engine = self.given_up.instead_of(engine, changed);
        }
        let is_done = match engine {
            Engine::Sweep => self.run_sweep(),
            Engine::Edit => self.run_edit(),
            Engine::Tree => self.run_in_tree(),
            Engine::Rebuild => return self.rebuild(),
        };
        self.given_up.note(!is_done, changed);
        if is_done { self.apply_events() } else { self.rebuild() }
    }

    fn engine(&self) -> Engine {
        if self.config.backend == Backend::Brute {
            return Engine::Rebuild;
        }
        let counts = Counts {
            boxes: self.world.present() as usize,
            ids: self.world.ids(),
            changed: self.world.changed.len(),
            knows_old: self.world.knows_old(),
            held: self.store.held,
            spilled: self.store.grid.spilled(),
            events: self.last_events,
        };
        policy::choose_engine(&counts, self.config.engine)
    }

    /// Returns true: unlike other engines, a sweep is never given up.
    fn run_sweep(&mut self) -> bool {
        stage!("check");
        let mut clock = Clock::start();
        self.report.checks = self.sweep.run(&self.world, &self.kept, &mut self.comparison);
        self.report.stages.check = clock.lap();
        self.report.work = self.report.checks.made;
        self.report.plan.algorithm = Algorithm::Sweep;
        self.store.held = Held::Nowhere;
        true
    }

    /// Returns false if it took too much work, and was given up.
    fn run_edit(&mut self) -> bool {
        stage!("edit");
        let mut clock = Clock::start();
        let limits = EditLimits {
            pairs: self.config.limits.pairs(),
            work: self.unless_forced(policy::edit_up_to_work(self.len(), self.kept.len(), self.rebuild_work)),
        };
        let done = self.edit.run(&self.world, &mut self.store.grid, &mut self.comparison, limits);
        self.report.stages.check = clock.lap();
        self.report.work += self.edit.work().min(limits.work);
        self.report.checks = self.edit.checks();
        self.report.plan = Plan::of_grid(Algorithm::Edit, &self.store.grid);
        self.report.plan.boxes = self.world.valid();
        self.sweep.expire();
        done
    }

    /// Returns the maximum work of an engine. An engine that the caller chose has no limit.
    fn unless_forced(&self, limit: u64) -> u64 {
        self.config.engine.map_or(limit, |_| u64::MAX)
    }

    /// Looks up changed boxes in a tree, which is brought up to date first. Returns false if it took too much work, and was
    /// given up.
    fn run_in_tree(&mut self) -> bool {
        stage!("tree");
        let mut clock = Clock::start();
        let max_nodes = self.unless_forced(policy::look_up_to_nodes(self.world.ids()));
        let Self { world, store, .. } = self;
        let changed = (store.held == Held::InTree).then_some(&world.changed[..]);
        self.report.work = store.tree.keep_sorted(&world.boxes, changed);
        store.held = Held::InTree;
        self.report.stages.map = clock.lap();
        let tree = (&store.tree, max_nodes);
        let (checks, nodes) = self.sweep.run_in_tree(world, &self.kept, tree, &mut self.comparison);
        self.report.checks = checks;
        self.report.work += checks.made + nodes;
        self.report.stages.check = clock.lap();
        self.report.plan.algorithm = Algorithm::Tree;
        self.sweep.expire();
        nodes <= max_nodes
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
        self.kept.drop_pairs(&events.dropped);
        self.kept.apply(&events.added, &events.removed);
        self.report.stages.diff = clock.lap();
        Ok(())
    }

    /// Searches all boxes, and compares the pairs with the kept ones.
    fn rebuild(&mut self) -> Result<(), Error> {
        let world = &self.world;
        let grouping = Grouping::new(world.ids());
        let filters = world.is_filtered.then_some(&world.filters[..]);
        let request =
            Request { boxes: &world.boxes, filters, config: &self.config, grouping: Some(grouping) };
        let invalid = self.report.invalid;
        self.sweep.expire();
        self.all_pairs.find(&request, &mut self.store, &mut self.report)?;
        self.rebuild_work = self.report.checks.made;
        self.report.invalid = invalid;
        stage!("diff");
        let mut clock = Clock::start();
        self.all_pairs.gather(grouping, &mut self.groups);
        let was_removed = |id: u32| world.was_removed(id);
        let is_removed: Option<&(dyn Fn(u32) -> bool + Sync)> =
            if world.has_removed() { Some(&was_removed) } else { None };
        let workers = AllPairs::workers(world.ids());
        self.comparison.run(&mut self.groups, &mut self.kept, is_removed, workers);
        self.report.stages.diff = clock.lap();
        Ok(())
    }

    /// Makes the next update begin from the boxes and the kept pairs alone.
    fn fail(&mut self) {
        self.store.held = Held::Nowhere;
        self.sweep.expire();
        self.report.pairs = self.kept.len() as u64;
    }

    /// Hands the events over, and forgets the changes.
    fn finish(&mut self) {
        std::mem::swap(&mut self.events.added, &mut self.comparison.added);
        std::mem::swap(&mut self.events.removed, &mut self.comparison.removed);
        self.last_events = self.events.added.len() + self.events.removed.len();
        self.world.forget_changes();
        self.device.end_update(self.report.device.is_some());
        self.world.keep_old = self.old_to_keep();
    }

    /// Returns the number of old states to keep until the next update.
    pub(super) fn old_to_keep(&self) -> usize {
        if self.device.has_device() {
            return usize::MAX;
        }
        policy::old_states_to_keep(self.len(), self.config.engine)
    }

    /// Begins an empty report.
    fn begin_report(&mut self) {
        let present = u64::from(self.world.present());
        let report = &mut self.report;
        (report.stages, report.checks, report.work) = Default::default();
        report.boxes = present;
        report.invalid = present - u64::from(self.world.valid());
        report.changed = self.world.changed.len() as u64;
        report.plan = Plan { boxes: self.world.valid(), ..Plan::default() };
        report.device = None;
        // A backend that was asked for stays unavailable until a call on it succeeds.
        if self.config.backend != Backend::Device {
            report.fallback = None;
        }
    }
}
