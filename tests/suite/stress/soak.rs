//! Churn for ever: boxes come, move, change their filters and go. Memory stays what it is, and nothing drifts away from
//! the oracle. `PBIG_SOAK` is the number of updates, a few thousand without.

use crate::follower::Follower;
use pbig_core::{Aabb, Backend, BroadPhase, Config, Engine, ProxyFilter, Report};
use pbig_gpu::GpuFinder;
use pbig_harness::counting::held;
use pbig_tests::{Way, gpu, needs_gpu, on_threads, set, shifted};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use std::collections::BTreeMap;
use std::io::Write;

fn given() -> Option<usize> {
    let given = std::env::var("PBIG_SOAK").ok();
    given.map(|n| n.parse().expect("PBIG_SOAK is a number of updates"))
}

fn updates() -> usize {
    given().unwrap_or(2000)
}

/// A world of boxes, half of which are there, in a space with about a pair a box.
struct Churn {
    world: Follower,
    rng: StdRng,
    home: Vec<Aabb>,
    odd: Vec<Aabb>,
    /// The number of boxes from one changed box to the next.
    one_in: usize,
    tally: SoakCounts,
}

impl Churn {
    fn new(way: impl Into<Way>, ids: usize) -> Self {
        let world = Follower::new(way, ids);
        let rng = StdRng::seed_from_u64(6);
        let (home, odd) = (set("unit", ids, 4), set("degenerate", 100, 4));
        Self { world, rng, home, odd, one_in: 30, tally: SoakCounts::default() }
    }

    fn aabb(&mut self, id: u32) -> Aabb {
        let by = std::array::from_fn(|_| self.rng.random_range(-0.6..0.6));
        let odd = self.rng.random_ratio(1, 100);
        if odd { self.odd[self.rng.random_range(0..100)] } else { shifted(&self.home[id as usize], by) }
    }

    /// A share of the boxes, and now and then all of them.
    fn change(&mut self, update: usize) {
        let ids = self.home.len();
        let all = update.is_multiple_of(97);
        for i in 0..if all { ids } else { 1 + ids / self.one_in } {
            let id = if all { i as u32 } else { self.rng.random_range(0..ids as u32) };
            let body = if self.rng.random_ratio(1, 3) { id % 20 } else { ProxyFilter::NO_BODY };
            match self.rng.random_range(0..4) {
                0 | 1 if self.world.has(id) => self.world.remove(id),
                _ => {
                    let aabb = self.aabb(id);
                    self.world.set(id, aabb, ProxyFilter { body, ..ProxyFilter::ALL });
                }
            }
        }
    }

    /// Runs a number of updates, and compares `sampled` of them with the oracle. In the first fifth memory may grow to what it takes; in a
    /// short run in the first half.
    fn run(&mut self, updates: usize, sampled: usize) {
        let (every, tenth) = ((updates / sampled).max(1), (updates / 10).max(1));
        for update in 0..updates {
            self.change(update);
            if update.is_multiple_of(every) {
                self.world.update(&format!("update {update}"));
                self.tally.equal += 1;
            } else {
                self.world.update_unchecked();
            }
            self.tally.count(
                self.world.broad_phase.report(),
                update < updates / if given().is_some() { 5 } else { 2 },
            );
            if (update + 1).is_multiple_of(tenth) && given().is_some() {
                self.tally.tell(self.home.len());
            }
        }
    }
}

/// Counts so far.
#[derive(Default)]
struct SoakCounts {
    updates: usize,
    /// Updates that were compared with the oracle, and equal.
    equal: usize,
    /// By who found the pairs: a device, or else what the plan names.
    ways: BTreeMap<&'static str, usize>,
    /// Bytes held by the threads of this pool and on the device: now, and the most while it may grow.
    bytes: [i64; 2],
    early: [i64; 2],
}

impl SoakCounts {
    fn count(&mut self, report: &Report, is_early: bool) {
        let way = report.plan.algorithm.name();
        *self.ways.entry(way).or_default() += 1;
        self.bytes = [held_by_all(), report.device.as_ref().map_or(0, |device| device.device_bytes as i64)];
        for (early, bytes) in self.early.iter_mut().zip(self.bytes) {
            *early = if is_early { bytes.max(*early) } else { *early };
            let update = self.updates;
            // In a short run a list may double late without a leak.
            let most = if given().is_none() { *early * 3 / 2 + 100_000 } else { *early * 5 / 4 };
            assert!(bytes <= most, "update {update}: {bytes} bytes are held, at first {early}");
        }
        self.updates += 1;
    }

    /// To standard output as it is, where nobody keeps it until the test ends: a run that is cut off has then said how far
    /// it came.
    fn tell(&self, ids: usize) {
        let Self { updates, equal, ways, bytes, early } = self;
        let mut out = std::io::stdout().lock();
        let done = format!("{ids} ids, {updates} updates, {equal} samples equal, {ways:?}");
        let memory = format!("held and on the device: {bytes:?} bytes, at first at most {early:?}");
        writeln!(out, "{done}; {memory}").and_then(|()| out.flush()).expect("standard output is open");
    }

    /// Asserts that the ways that a soak is named after did this percentage of the updates.
    fn assert_mostly(&self, names: &[&str], percent: usize) {
        let done: usize = names.iter().filter_map(|name| self.ways.get(name)).sum();
        let all = self.updates;
        assert!(done * 100 >= all * percent, "{done} of {all} by {names:?}: {:?}", self.ways);
    }
}

/// Returns the bytes that all threads hold. One thread may free memory of another, so only the sum counts.
fn held_by_all() -> i64 {
    if rayon::current_num_threads() == 1 {
        return held();
    }
    rayon::broadcast(|_| held()).into_iter().sum()
}

/// On one thread.
fn soak(churn: impl FnOnce() -> Churn + Send, updates: usize) -> SoakCounts {
    soak_on(1, churn, updates, (updates / 20).min(5000))
}

fn soak_on(
    threads: usize,
    churn: impl FnOnce() -> Churn + Send,
    updates: usize,
    sampled: usize,
) -> SoakCounts {
    on_threads(threads, || {
        let mut churn = churn();
        churn.run(updates, sampled);
        churn.tally
    })
}

fn cpu(engine: Option<Engine>) -> Config {
    Config { backend: Backend::Cpu, engine, margin: 0.05, ..Config::DEFAULT }
}

#[test]
fn soak_of_a_small_world() {
    let tally = soak(|| Churn::new(cpu(None), 400), updates());
    tally.assert_mostly(&["brute", "look-up"], 90);
}

#[test]
fn soak_of_a_world_with_look_ups() {
    let churn = || Churn { one_in: 50, ..Churn::new(cpu(None), 10_000) };
    soak(churn, updates()).assert_mostly(&["look-up"], 95);
}

#[test]
fn soak_of_a_small_world_in_the_grid() {
    let tally = soak(|| Churn::new(cpu(Some(Engine::Grid)), 120), updates());
    tally.assert_mostly(&["grid"], 90);
}

/// Tests enough boxes for threads to share the work: a thirtieth of the updates, each of which changes thousands.
#[test]
fn soak_on_threads() {
    let churn = || Churn { one_in: 8, ..Churn::new(cpu(None), 20_000) };
    let updates = (updates() / 30).max(40);
    let tally = soak_on(3, churn, updates, (updates / 20).clamp(4, 500));
    tally.assert_mostly(&["look-up", "grid"], 95);
}

/// A software adapter takes milliseconds for an update: a hundredth of them.
#[test]
fn soak_on_a_gpu() {
    needs_gpu!();
    let way = gpu().with(|it| it.margin = 0.05);
    // A device of its own: threads that share one free each other's memory.
    let broad_phase = || {
        let device = GpuFinder::new().expect("an adapter").with_options(way.gpu);
        BroadPhase::with_device(way.config, Box::new(device)).expect("a margin")
    };
    let churn = || Churn { world: Follower::of(broad_phase(), 400), ..Churn::new(cpu(None), 400) };
    let tally = soak(churn, (updates() / 100).max(200));
    tally.assert_mostly(&["device"], 99);
    assert!(tally.bytes[1] > 0, "nothing is held on the device");
}
