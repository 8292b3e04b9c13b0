//! The engine for few changed boxes: they are looked up where they were and where they are, in a grid that is edited.
//!
//! A pair has ended if it overlapped before and does not now, and is new if it did not overlap before and does now. Nothing else is
//! looked at, so an update takes time in proportion to the changed boxes.

use super::task::Task;
use crate::broad_phase::world::{Old, World};
use crate::grid::{Budget, Candidates, EditedGrid, Meet, Place, Record};
use crate::holder::Holder;
use crate::outcome::{End, Outcome};
use crate::pairs::Comparison;
use crate::parallel::{SharedSlice, available_threads, piece_range, run_with};
use crate::policy;
use crate::report::{Checks, Clock, StageTimes, stage};
use crate::{Aabb, Pair, ProxyFilter};

/// The buffers of the engine.
#[derive(Clone, Debug, Default)]
pub(crate) struct Edit {
    /// Changed boxes as they were, in the order of cells.
    before: Vec<Record>,
    /// Changed boxes as they are, in the same order.
    after: Vec<Record>,
    /// The place of each changed box.
    places: Vec<Place>,
    threads: Vec<Thread>,
    /// Key and number of each changed box.
    order: Vec<u64>,
    /// Work of the last run.
    work: u64,
}

/// Limits of a run: pairs to be listed, and work to be done.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EditLimits {
    pub(crate) pairs: u64,
    pub(crate) work: u64,
}

/// The findings and buffers of one thread.
#[derive(Clone, Debug, Default)]
struct Thread {
    candidates: Candidates,
    added: Vec<Pair>,
    removed: Vec<Pair>,
    dropped: Vec<Pair>,
}

impl Edit {
    /// Edits the grid, and leaves the events of an update in the task. Gives up if it takes too much work.
    pub(super) fn run(&mut self, task: &mut Task<'_>) -> Outcome {
        stage!("edit");
        let mut clock = Clock::start();
        let world = task.world;
        let most = policy::edit_up_to_work(world.present.len(), task.kept.len(), task.store.work);
        let limits = EditLimits { pairs: task.config.limits.pairs(), work: task.unless_forced(most) };
        let is_done = self.find(world, &mut task.store.grid, task.events, limits);
        let check = clock.lap();
        let (end, holder) = if is_done { (End::Done, Holder::Grid) } else { (End::GivenUp, Holder::Nothing) };
        Outcome {
            end,
            holder,
            checks: self.checks(),
            work: self.work.min(limits.work),
            plan: task.store.grid.describe(world.valid()),
            stages: StageTimes { check, ..StageTimes::default() },
            ..Outcome::default()
        }
    }

    /// Brings `grid` up to date with the changes of the world, and leaves the events in `events`, sorted: all, or more new
    /// pairs than the limit. Returns false if the work is beyond its limit, and leaves grid and events unusable.
    pub(crate) fn find(
        &mut self,
        world: &World,
        grid: &mut EditedGrid,
        events: &mut Comparison,
        limits: EditLimits,
    ) -> bool {
        let budget = Budget::new(limits.work);
        self.work = 0;
        if grid.work_with_oversize(world.changed.len()) > limits.work {
            return false;
        }
        self.list(world, grid);
        let threads = if self.before.len() < policy::PARALLEL_FROM_EDITS { 1 } else { available_threads() };
        self.threads.resize_with(threads.max(self.threads.len()), Thread::default);
        self.threads.iter_mut().for_each(Thread::clear);
        self.find_ended(world, grid, &budget, threads);
        if !budget.is_over() {
            grid.move_all(&self.after, &self.places);
            self.find_new(world, grid, &budget, (threads, limits.pairs));
            self.gather(events, world.ids());
        }
        self.work = budget.spent();
        !budget.is_over()
    }

    /// Returns the work of the last run.
    #[cfg(test)]
    pub(crate) fn work(&self) -> u64 {
        self.work
    }

    /// Returns the tests of the last run.
    fn checks(&self) -> Checks {
        let sum = |of: fn(&Candidates) -> u64| {
            self.threads.iter().map(|thread| of(&thread.candidates)).sum::<u64>()
        };
        let (made, met) = (sum(|candidates| candidates.tests), sum(|candidates| candidates.met));
        Checks { made, unnecessary: made - met, redundant: 0 }
    }

    /// Lists changed boxes in the order of their old cells: neighbours share cache lines.
    fn list(&mut self, world: &World, grid: &EditedGrid) {
        let Self { before, after, order, .. } = self;
        // In the order of their changes at first.
        after.clear();
        let old = |(&id, old): (&u32, &Old)| Record::new(old.aabb, id, 0);
        after.extend(world.changed.iter().zip(&world.old).map(old));
        grid.keys(after);
        order.clear();
        order.extend(after.iter().enumerate().map(|(i, record)| u64::from(record.key) << 32 | i as u64));
        order.sort_unstable();
        before.clear();
        before.extend(order.iter().map(|&word| after[word as u32 as usize]));
        for (to, record) in after.iter_mut().zip(&*before) {
            *to = Record::new(world.boxes[record.id as usize], record.id, 0);
        }
        grid.keys(after);
    }

    fn find_ended(&mut self, world: &World, grid: &EditedGrid, budget: &Budget, threads: usize) {
        let Self { before, after, places, threads: all, .. } = self;
        places.clear();
        places.resize(before.len(), Place::Nowhere);
        let places = SharedSlice::new(places);
        let (before, after) = (&*before, &*after);
        run_with(&mut all[..threads], threads, |thread, piece| {
            let range = piece_range(before.len(), piece, threads);
            let Thread { candidates, removed, dropped, .. } = thread;
            // SAFETY: each piece has its own range.
            let places = unsafe { places.part(range.clone()) };
            let (before, after) = (&before[range.clone()], &after[range]);
            let mut ended = Ended { world, before, after, places, removed, dropped };
            grid.look_up(before, candidates, budget, &mut ended);
        });
    }

    fn find_new(
        &mut self,
        world: &World,
        grid: &EditedGrid,
        budget: &Budget,
        (threads, max_pairs): (usize, u64),
    ) {
        let Self { before, after, threads: all, .. } = self;
        let (before, after) = (&*before, &*after);
        run_with(&mut all[..threads], threads, |thread, piece| {
            let range = piece_range(after.len(), piece, threads);
            let Thread { candidates, added, .. } = thread;
            let (before, after) = (&before[range.clone()], &after[range]);
            grid.look_up(after, candidates, budget, &mut New { world, before, after, added, max_pairs });
        });
    }

    fn gather(&mut self, events: &mut Comparison, ids: usize) {
        events.clear();
        for thread in &self.threads {
            events.added.extend_from_slice(&thread.added);
            events.removed.extend_from_slice(&thread.removed);
            events.dropped.extend_from_slice(&thread.dropped);
        }
        events.sort(ids);
    }
}

impl Thread {
    fn clear(&mut self) {
        self.added.clear();
        self.removed.clear();
        self.dropped.clear();
        self.candidates.clear_counts();
    }
}

/// A box at one time, with all that decides about its pairs.
#[derive(Clone, Copy)]
struct State<'a> {
    aabb: &'a Aabb,
    filter: &'a ProxyFilter,
}

impl State<'_> {
    fn pairs_with(&self, other: &Self) -> bool {
        self.aabb.overlaps(other.aabb) && self.filter.allows(other.filter)
    }
}

impl World {
    /// Returns a stored box as it was.
    fn state_before(&self, id: u32) -> State<'_> {
        match self.change_of(id) {
            Some(at) => {
                let Old { aabb, filter } = &self.old[at];
                State { aabb, filter }
            }
            None => self.state_now(id),
        }
    }

    fn state_now(&self, id: u32) -> State<'_> {
        State { aabb: &self.boxes[id as usize], filter: &self.filters[id as usize] }
    }

    /// Returns true if this box does not report the pair: the other box is itself, or has changed and has the lower id.
    fn is_met_twice(&self, id: u32, other: u32) -> bool {
        other < id && self.change_of(other).is_some() || other == id
    }

    fn existed(&self, id: u32, other: u32) -> bool {
        !self.was_removed(id) && !self.was_removed(other)
    }
}

/// Meets what changed boxes overlapped.
struct Ended<'a> {
    world: &'a World,
    before: &'a [Record],
    after: &'a [Record],
    places: &'a mut [Place],
    removed: &'a mut Vec<Pair>,
    dropped: &'a mut Vec<Pair>,
}

impl Meet for Ended<'_> {
    #[inline(always)]
    fn meet(&mut self, i: usize, stored: &Record, place: Place) {
        let (world, id, other) = (self.world, self.before[i].id, stored.id);
        if id == other {
            self.places[i] = place;
        }
        if world.is_met_twice(id, other) {
            return;
        }
        let still_overlaps = match world.change_of(other) {
            None => self.after[i].overlaps(stored),
            Some(_) => self.after[i].aabb.overlaps(&world.boxes[other as usize]),
        };
        let refiltered = world.is_filtered;
        if still_overlaps && !refiltered && world.existed(id, other) {
            return;
        }
        let allowed = |one: State<'_>, other: State<'_>| one.filter.allows(other.filter);
        if refiltered && !allowed(world.state_before(id), world.state_before(other)) {
            return;
        }
        if !world.existed(id, other) {
            self.dropped.push(Pair::new(id, other));
        } else if !(still_overlaps && allowed(world.state_now(id), world.state_now(other))) {
            self.removed.push(Pair::new(id, other));
        }
    }
}

/// Meets what changed boxes overlap now.
struct New<'a> {
    world: &'a World,
    before: &'a [Record],
    after: &'a [Record],
    added: &'a mut Vec<Pair>,
    /// Beyond, the update fails, and no more pairs are listed.
    max_pairs: u64,
}

impl Meet for New<'_> {
    #[inline(always)]
    fn meet(&mut self, i: usize, stored: &Record, _: Place) {
        let (world, id, other) = (self.world, self.after[i].id, stored.id);
        if world.is_met_twice(id, other) {
            return;
        }
        if world.is_filtered && !world.state_now(id).filter.allows(world.state_now(other).filter) {
            return;
        }
        let overlapped = || match world.change_of(other) {
            None => self.before[i].overlaps(stored),
            Some(_) => self.before[i].aabb.overlaps(world.state_before(other).aabb),
        };
        let paired = || world.state_before(id).pairs_with(&world.state_before(other));
        let existed = world.existed(id, other) && overlapped() && (!world.is_filtered || paired());
        if !existed && self.added.len() as u64 <= self.max_pairs {
            self.added.push(Pair::new(id, other));
        }
    }
}
