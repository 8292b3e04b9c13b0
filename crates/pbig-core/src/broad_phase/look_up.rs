//! The update of few changed boxes: each is looked up in the tree, and what it overlaps is compared with its kept pairs.

use super::Task;
use super::world::World;
use crate::bvh::{BoxIndex, overlapping};
use crate::pairs::{Differences, Kept, differences, equal, sort_few};
use crate::parallel::{available_threads, piece_range, run_with};
use crate::policy;
use crate::report::stage;
use crate::search::Budget;
use crate::simd::{BLOCK, Simd, dispatch};
use crate::{Algorithm, Checks, Engine, Pair, Plan};

/// Work of a thread that it does not tell the others yet.
const UNTOLD: u64 = 1024;

#[derive(Clone, Debug, Default)]
pub(super) struct LookUp {
    /// Changed boxes in the order of the tree: place and id.
    order: Vec<u64>,
    threads: Vec<Thread>,
}

impl LookUp {
    /// Brings the tree up to date, and leaves the events of an update in the task. Returns false if it takes too much work.
    pub(super) fn run(&mut self, task: &mut Task<'_>) -> bool {
        let world = task.world;
        let (index, read) = stage!(task.report, map, {
            let (index, read) = task.tree.refresh_for_look_ups(world);
            index.in_order(&world.changed, &mut self.order);
            task.kept.make_backward();
            drop_pairs_of_removed(&world.removed, task.kept, &mut task.comparison.events.removed);
            (index, read)
        });
        let is_forced = task.config.engine == Some(Engine::LookUp);
        let most = if is_forced { u64::MAX } else { policy::look_up_to_nodes(world.present.len()) };
        let budget = Budget::new(most);
        stage!(task.report, check, {
            self.look_up((world, task.kept, index), &budget);
            self.gather(&mut task.comparison.events);
        });
        let sum = |of: fn(&Thread) -> u64| self.threads.iter().map(of).sum::<u64>();
        let (mut nodes, mut met) = (sum(|thread| thread.nodes), sum(|thread| thread.met));
        if budget.is_over() {
            // Threads have stopped anywhere.
            (nodes, met) = (most, 0);
        }
        let (report, made) = (&mut *task.report, nodes * BLOCK as u64);
        report.checks = Checks { made, unnecessary: made - met, redundant: 0 };
        report.work += read as u64 + made + nodes + met;
        report.set_plan(Plan { algorithm: Algorithm::LookUp, boxes: world.noted.valid, ..Plan::default() });
        task.tree.note_look_ups(nodes, budget.is_over());
        !budget.is_over()
    }

    /// Joins what the threads have found, in the order of pairs.
    fn gather(&self, events: &mut Differences) {
        events.gather(self.threads.iter().map(|thread| &thread.found));
        let word = |pair: &Pair| u64::from(pair.a) << 32 | u64::from(pair.b);
        events.added.sort_unstable_by_key(word);
        events.removed.sort_unstable_by_key(word);
    }

    /// Looks the changed boxes up. Some are left out if the budget does not suffice.
    fn look_up(&mut self, (world, kept, index): (&World, &Kept, &BoxIndex), budget: &Budget) {
        let changed = self.order.len();
        let workers = if changed < policy::PARALLEL_FROM_CHANGES { 1 } else { available_threads() };
        self.threads.resize_with(workers.max(self.threads.len()), Thread::default);
        self.threads.iter_mut().for_each(Thread::clear);
        let pieces = if workers == 1 { 1 } else { 8 * workers };
        let order = &self.order[..];
        run_with(&mut self.threads[..workers], pieces, |thread, piece| {
            let ids = &order[piece_range(changed, piece, pieces)];
            if !budget.is_over() {
                dispatch!(Thread::look_up, thread, (world, kept, index), ids, budget);
            }
        });
    }

    pub(super) fn settle(&mut self) {
        self.threads.iter_mut().for_each(|thread| thread.found.settle_and_clear());
    }
}

/// Drops the kept pairs of removed boxes, which end without an event. Lists them in a buffer.
fn drop_pairs_of_removed(removed: &[u32], kept: &mut Kept, dropped: &mut Vec<Pair>) {
    let partners = |id: u32| {
        let (lower, later) = kept.rows_of(id);
        lower.iter().chain(later).map(move |&other| Pair::new(id, other))
    };
    dropped.clear();
    dropped.extend(removed.iter().flat_map(|id| partners(*id)));
    dropped.sort_unstable();
    dropped.dedup();
    kept.apply(&[], dropped);
}

/// The findings and buffers of one thread.
#[derive(Clone, Debug, Default)]
struct Thread {
    /// Ids that the box at hand overlaps, and those that it had as partners.
    now: Vec<u32>,
    was: Vec<u32>,
    found: Differences,
    nodes: u64,
    met: u64,
}

impl Thread {
    fn clear(&mut self) {
        self.found.clear();
        (self.nodes, self.met) = (0, 0);
    }

    /// Looks up boxes, given as the lower halves of some words.
    #[inline(always)]
    fn look_up(
        simd: impl Simd,
        thread: &mut Self,
        (world, kept, index): (&World, &Kept, &BoxIndex),
        ids: &[u64],
        budget: &Budget,
    ) {
        let mut told = thread.nodes + thread.met;
        for &word in ids {
            let id = word as u32;
            thread.now.clear();
            let aabb = &world.boxes[id as usize];
            thread.nodes += overlapping(simd, index, aabb, |other| thread.now.push(other));
            thread.met += thread.now.len() as u64;
            thread.compare(simd, world, kept, id);
            let work = thread.nodes + thread.met;
            if work > told + UNTOLD {
                budget.charge(work - told);
                told = work;
                if budget.is_over() {
                    return;
                }
            }
        }
        budget.charge(thread.nodes + thread.met - told);
    }

    /// Compares what a box overlaps with its kept pairs. Most boxes keep theirs.
    #[inline(always)]
    fn compare(&mut self, simd: impl Simd, world: &World, kept: &Kept, id: u32) {
        let (lower, later) = kept.rows_of(id);
        if world.noted.is_filtered {
            let filter = &world.filters[id as usize];
            self.now.retain(|other| filter.allows(&world.filters[*other as usize]));
        }
        sort_few(simd, &mut self.now);
        let at = self.now.partition_point(|other| *other < id);
        let behind = at + usize::from(self.now.get(at) == Some(&id));
        let is_same = equal(lower, &self.now[..at]) && equal(later, &self.now[behind..]);
        if !is_same {
            self.compare_all(world, (lower, later), id);
        }
    }

    /// Notes the differences. The changed box with the lower id reports a pair of two changed boxes.
    #[inline(never)]
    fn compare_all(&mut self, world: &World, (lower, later): (&[u32], &[u32]), id: u32) {
        let Self { now, was, found, .. } = self;
        let is_own = |other: u32| other > id || other < id && !world.has_changed(other);
        now.retain(|other| is_own(*other));
        was.clear();
        was.extend(lower.iter().chain(later).copied().filter(|other| is_own(*other)));
        differences(id, was, now, found);
    }
}
