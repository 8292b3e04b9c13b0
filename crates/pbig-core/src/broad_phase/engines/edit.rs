//! The engine for few changed boxes: they are looked up where they were and where they are, in a grid that is edited.
//!
//! A pair has ended if it overlapped before and does not now, and is new if it did not overlap before and does now. Nothing else is
//! looked at, so an update takes time in proportion to the changed boxes.

use super::Task;
use crate::Pair;
use crate::broad_phase::world::{Old, World};
use crate::grid::{Budget, Candidates, EditedGrid, Place, Record};
use crate::holder::Holder;
use crate::memory::ShrinkingVec;
use crate::outcome::{End, Outcome};
use crate::pairs::Comparison;
use crate::parallel::{SharedSlice, available_threads, piece_range, run_with};
use crate::policy;
use crate::report::{Checks, Clock, StageTimes, stage};

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
    added: ShrinkingVec<Pair>,
    removed: ShrinkingVec<Pair>,
    dropped: ShrinkingVec<Pair>,
}

impl Edit {
    /// Gives back memory that the events of the last run did not need.
    pub(super) fn settle(&mut self) {
        for Thread { added, removed, dropped, .. } in &mut self.threads {
            [added, removed, dropped].into_iter().for_each(ShrinkingVec::settle_and_clear);
        }
    }

    /// Edits the grid, and leaves the events of an update in the task. Gives up if it takes too much work.
    pub(super) fn run(&mut self, task: &mut Task<'_>) -> Outcome {
        stage!("edit");
        let mut clock = Clock::start();
        let world = task.world;
        let most = policy::edit_up_to_work(world.present.len(), task.kept.len(), task.store.work);
        let limits = EditLimits { pairs: task.config.limits.pairs(), work: task.unless_forced(most) };
        let (is_done, work) = self.find(world, &mut task.store.grid, task.events, limits);
        let check = clock.lap();
        let (end, holder) = if is_done { (End::Done, Holder::Grid) } else { (End::GivenUp, Holder::Nothing) };
        Outcome {
            end,
            holder,
            checks: self.checks(),
            work: work.min(limits.work),
            plan: task.store.grid.describe(world.valid),
            stages: StageTimes { check, ..StageTimes::default() },
            ..Outcome::default()
        }
    }

    /// Brings `grid` up to date with the changes of the world, and leaves the events in `events`, sorted: all, or more new
    /// pairs than the limit. Returns the work, and false if it is beyond its limit. Then grid and events are unusable.
    pub(crate) fn find(
        &mut self,
        world: &World,
        grid: &mut EditedGrid,
        events: &mut Comparison,
        limits: EditLimits,
    ) -> (bool, u64) {
        let budget = Budget::new(limits.work);
        self.threads.iter_mut().for_each(Thread::clear);
        if grid.work_with_oversize(world.changed.iter().map(|id| &world.boxes[*id as usize])) > limits.work {
            return (false, 0);
        }
        self.list(world, grid);
        let threads = if self.before.len() < policy::PARALLEL_FROM_EDITS { 1 } else { available_threads() };
        self.threads.resize_with(threads.max(self.threads.len()), Thread::default);
        self.find_ended(world, grid, &budget, threads);
        if !budget.is_over() {
            grid.move_all(&self.after, &self.places);
            self.find_new(world, grid, &budget, (threads, limits.pairs));
            self.gather(events, world.ids());
        }
        (!budget.is_over(), budget.spent())
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
        // `after` is in the order of changes, until both lists get the order of cells.
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
            // SAFETY: each piece has its own range.
            let places = unsafe { places.part(range.clone()) };
            let changed = Changed { world, before: &before[range.clone()], after: &after[range] };
            let Thread { candidates, removed, dropped, .. } = thread;
            grid.look_up(
                changed.before,
                candidates,
                budget,
                #[inline(always)]
                |i, stored, place| {
                    if changed.before[i].id == stored.id {
                        places[i] = place;
                    }
                    if let Some((pair, is_dropped)) = changed.ended(i, stored) {
                        let pairs = if is_dropped { &mut *dropped } else { &mut *removed };
                        pairs.push(pair);
                    }
                },
            );
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
            let changed = Changed { world, before: &before[range.clone()], after: &after[range] };
            let Thread { candidates, added, .. } = thread;
            grid.look_up(
                changed.after,
                candidates,
                budget,
                #[inline(always)]
                |i, stored, _| {
                    // Beyond, the update fails.
                    if added.len() as u64 <= max_pairs {
                        added.extend(changed.begun(i, stored));
                    }
                },
            );
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

impl World {
    /// Returns true if the filters of two boxes allow a pair.
    #[inline(always)]
    fn allows(&self, id: u32, other: u32) -> bool {
        !self.is_filtered || self.filters[id as usize].allows(&self.filters[other as usize])
    }

    /// Returns true if the filters of two boxes allowed a pair at the last update.
    #[inline(always)]
    fn allowed(&self, id: u32, other: u32) -> bool {
        let filter =
            |id: u32| self.change_of(id).map_or(&self.filters[id as usize], |at| &self.old[at].filter);
        !self.is_filtered || filter(id).allows(filter(other))
    }

    /// Returns true if this box does not report the pair: the other box is itself, or has changed and has the lower id.
    #[inline(always)]
    fn is_met_twice(&self, id: u32, other: u32) -> bool {
        other < id && self.change_of(other).is_some() || other == id
    }

    #[inline(always)]
    fn existed(&self, id: u32, other: u32) -> bool {
        !self.was_removed(id) && !self.was_removed(other)
    }
}

/// Changed boxes, each as it was and as it is.
#[derive(Clone, Copy)]
struct Changed<'a> {
    world: &'a World,
    before: &'a [Record],
    after: &'a [Record],
}

impl Changed<'_> {
    /// Returns the pair of a changed box with a stored one that it overlapped, if the pair has ended; and true if one of the two was
    /// removed.
    #[inline(always)]
    fn ended(&self, i: usize, stored: &Record) -> Option<(Pair, bool)> {
        let (world, id, other) = (self.world, self.before[i].id, stored.id);
        if world.is_met_twice(id, other) || !world.allowed(id, other) {
            return None;
        }
        let still_overlaps = match world.change_of(other) {
            None => self.after[i].overlaps(stored),
            Some(_) => self.after[i].aabb.overlaps(&world.boxes[other as usize]),
        };
        let is_dropped = !world.existed(id, other);
        let has_ended = is_dropped || !still_overlaps || !world.allows(id, other);
        has_ended.then(|| (Pair::new(id, other), is_dropped))
    }

    /// Returns the pair of a changed box with a stored one that it overlaps, if the pair is new.
    #[inline(always)]
    fn begun(&self, i: usize, stored: &Record) -> Option<Pair> {
        let (world, id, other) = (self.world, self.after[i].id, stored.id);
        if world.is_met_twice(id, other) || !world.allows(id, other) {
            return None;
        }
        let overlapped = || match world.change_of(other) {
            None => self.before[i].overlaps(stored),
            Some(at) => self.before[i].aabb.overlaps(&world.old[at].aabb),
        };
        let was_pair = world.existed(id, other) && overlapped() && world.allowed(id, other);
        (!was_pair).then(|| Pair::new(id, other))
    }
}
