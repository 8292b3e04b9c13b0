//! The update of few changed boxes: each is looked up in the tree where it is, and what it overlaps is compared with its kept pairs.

use super::Task;
use super::listed::Listed;
use crate::broad_phase::world::World;
use crate::grid::{BLOCK, Budget, Simd, dispatch};
use crate::holder::Holder;
use crate::index::BoxIndex;
use crate::memory::ShrinkingVec;
use crate::outcome::{End, Outcome};
use crate::pairs::{Kept, differences, equal};
use crate::parallel::{available_threads, piece_range, run_with};
use crate::policy;
use crate::report::{Clock, stage};
use crate::{Algorithm, Checks, Pair, Plan};

/// The buffers of the engine.
#[derive(Clone, Debug, Default)]
pub(super) struct LookUp {
    listed: Listed,
    /// Changed boxes in the order of the tree: place and id.
    order: Vec<u64>,
    threads: Vec<Thread>,
}

impl LookUp {
    /// Brings the tree up to date, and leaves the events of an update in the task. Gives up if it takes too much work.
    pub(super) fn run(&mut self, task: &mut Task<'_>) -> Outcome {
        stage!("tree");
        let mut clock = Clock::start();
        let world = task.world;
        let mut outcome = Outcome { holder: Holder::Tree, ..Outcome::default() };
        let refit = self.bring_up_to_date(task);
        outcome.stages.map = clock.lap();
        let max_work = task.unless_forced(policy::look_up_to_nodes(world.present.len()));
        let budget = Budget::new(max_work);
        self.look_up(task, &budget);
        outcome.stages.check = clock.lap();
        let sum = |of: fn(&Thread) -> u64| self.threads.iter().map(of).sum::<u64>();
        let (nodes, met) = (sum(|thread| thread.nodes), sum(|thread| thread.met));
        let made = nodes * BLOCK as u64;
        outcome.checks = Checks { made, unnecessary: made - met, redundant: 0 };
        outcome.work = refit + made + nodes + met;
        outcome.plan = Plan { algorithm: Algorithm::Tree, boxes: world.valid, ..Plan::default() };
        outcome.end = if budget.is_over() { End::GivenUp } else { End::Done };
        outcome
    }

    /// Refits the tree along the changed boxes, or sorts it. Returns the work, in boxes.
    fn bring_up_to_date(&mut self, task: &mut Task<'_>) -> u64 {
        let (world, tree) = (task.world, &mut task.store.tree);
        let is_current = task.holder == Holder::Tree;
        if !(is_current && tree.follow(&world.boxes, &world.changed, &mut self.order)) {
            self.listed.take(world);
            tree.sort(&self.listed.boxes);
            tree.rename(&self.listed.ids);
            tree.in_order(&world.changed, &mut self.order);
            return (world.changed.len() + self.listed.ids.len()) as u64;
        }
        world.changed.len() as u64
    }

    /// Looks the changed boxes up, and leaves the events. Some are missing if the budget does not suffice.
    fn look_up(&mut self, task: &mut Task<'_>, budget: &Budget) {
        let Task { world, kept, store, events, .. } = task;
        let changed = self.order.len();
        let workers = if changed < policy::PARALLEL_FROM_EDITS { 1 } else { available_threads() };
        self.threads.resize_with(workers.max(self.threads.len()), Thread::default);
        self.threads.iter_mut().for_each(Thread::clear);
        kept.make_backward();
        let (world, kept, tree, order) = (*world, &**kept, &store.tree, &self.order[..]);
        let pieces = if workers == 1 { 1 } else { 8 * workers };
        run_with(&mut self.threads[..workers], pieces, |thread, piece| {
            let ids = &order[piece_range(changed, piece, pieces)];
            if !budget.is_over() {
                dispatch!(Thread::look_up, thread, (world, kept, tree), ids, budget);
            }
        });
        events.clear();
        for thread in &mut self.threads {
            events.added.extend_from_slice(&thread.added);
            events.removed.extend_from_slice(&thread.removed);
            events.dropped.extend_from_slice(&thread.dropped);
        }
        events.sort(world.ids());
    }
}

/// The findings and buffers of one thread.
#[derive(Clone, Debug, Default)]
struct Thread {
    /// Ids that the box at hand overlaps, and had as partners.
    now: Vec<u32>,
    was: Vec<u32>,
    added: ShrinkingVec<Pair>,
    removed: ShrinkingVec<Pair>,
    dropped: ShrinkingVec<Pair>,
    nodes: u64,
    met: u64,
}

impl Thread {
    fn clear(&mut self) {
        self.added.clear();
        self.removed.clear();
        self.dropped.clear();
        (self.nodes, self.met) = (0, 0);
    }

    /// Looks up boxes, given as the lower halves of some words.
    #[inline(always)]
    fn look_up(
        simd: impl Simd,
        thread: &mut Self,
        (world, kept, tree): (&World, &Kept, &BoxIndex),
        ids: &[u64],
        budget: &Budget,
    ) {
        for words in ids.chunks(64) {
            let before = thread.nodes + thread.met;
            for &word in words {
                let id = word as u32;
                thread.now.clear();
                thread.nodes += tree.overlaps(simd, &world.boxes[id as usize], |other| thread.now.push(other));
                thread.met += thread.now.len() as u64;
                thread.compare(simd, world, kept, id);
            }
            budget.charge(thread.nodes + thread.met - before);
            if budget.is_over() {
                return;
            }
        }
    }

    /// Compares what a box overlaps with its kept pairs. Most boxes keep theirs.
    #[inline(always)]
    fn compare(&mut self, simd: impl Simd, world: &World, kept: &Kept, id: u32) {
        let (lower, later) = kept.rows_of(id);
        crate::pairs::sort_few(simd, &mut self.now);
        let at = self.now.partition_point(|other| *other < id);
        let is_met = self.now.get(at) == Some(&id);
        let behind = at + usize::from(is_met);
        let is_same = equal(lower, &self.now[..at]) && equal(later, &self.now[behind..]);
        if !is_same || world.is_filtered || world.has_removed() {
            self.compare_all(world, (lower, later), id);
        }
    }

    /// Notes the differences. The changed box with the lower id reports a pair of two changed boxes.
    #[inline(never)]
    fn compare_all(&mut self, world: &World, (lower, later): (&[u32], &[u32]), id: u32) {
        let Self { now, was, added, removed, dropped, .. } = self;
        let is_own = |other: u32| other > id || other < id && world.change_of(other).is_none();
        was.clear();
        was.extend(lower.iter().chain(later).copied().filter(|other| is_own(*other)));
        let filter = &world.filters[id as usize];
        let allows = |other: u32| !world.is_filtered || filter.allows(&world.filters[other as usize]);
        now.retain(|other| is_own(*other) && allows(*other));
        if world.has_removed() {
            let ended = |other: u32| world.was_removed(id) || world.was_removed(other);
            dropped.extend(was.iter().filter(|other| ended(**other)).map(|&other| Pair::new(id, other)));
            was.retain(|&other| !ended(other));
        }
        differences(id, was, now, added, removed);
    }
}
