//! Churn for ever: boxes come, move, change their filters and go. Memory stays what it is, and nothing drifts away from
//! the oracle. `PBIG_SOAK` is the number of updates, a few thousand without.

use super::memory;
use crate::incremental::Follower;
use pbig_core::plan::Chosen;
use pbig_core::{Aabb, Backend, Coding, Config, ProxyFilter, Strategy};
use pbig_harness::boxes::BoxSet;
use pbig_tests::gpu;
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

fn updates() -> usize {
    let given = std::env::var("PBIG_SOAK").ok();
    given.map_or(2000, |n| n.parse().expect("PBIG_SOAK is a number of updates"))
}

/// A world of boxes, half of which are there, in a space with about a pair a box.
struct Churn {
    world: Follower,
    rng: StdRng,
    home: Vec<Aabb>,
    odd: Vec<Aabb>,
    /// Whether all boxes move smoothly around their homes, so that near pairs are kept.
    swings: bool,
    /// Updates by near pairs.
    near: usize,
}

impl Churn {
    fn new(config: Config, ids: usize, swings: bool) -> Self {
        let set = |name: &str, n| BoxSet::named(name).expect("the set exists").boxes(n, 4);
        let world = Follower::new(config, ids);
        let rng = StdRng::seed_from_u64(6);
        Self { world, rng, home: set("unit", ids), odd: set("degenerate", 100), swings, near: 0 }
    }

    fn aabb(&mut self, id: u32) -> Aabb {
        let by = std::array::from_fn(|_| self.rng.random_range(-0.6..0.6));
        let odd = self.rng.random_ratio(1, 100);
        if odd {
            self.odd[self.rng.random_range(0..100)]
        } else {
            super::shifted(&self.home[id as usize], by)
        }
    }

    /// All but one, which in every third update comes or goes.
    fn swing(&mut self, update: usize) {
        let visitor = update.is_multiple_of(3).then_some((update / 3 % self.home.len()) as u32);
        for id in 0..self.home.len() as u32 {
            let phase = update as f32 * 0.01 * (1 + id % 7) as f32;
            let by = [phase.sin(), (1.3 * phase).sin(), (1.7 * phase).sin()].map(|x| 0.5 * x);
            let is_visitor = visitor == Some(id);
            if is_visitor && self.world.has(id) {
                self.world.remove(id);
            } else if is_visitor || self.world.has(id) {
                let aabb = super::shifted(&self.home[id as usize], by);
                self.world.set(id, aabb, ProxyFilter { body: id % 20, ..ProxyFilter::ALL });
            }
        }
    }

    /// One in thirty boxes, and now and then all of them.
    fn change(&mut self, update: usize) {
        if self.swings && !update.is_multiple_of(50) {
            return self.swing(update);
        }
        let ids = self.home.len();
        let all = update.is_multiple_of(97);
        for i in 0..if all { ids } else { 1 + ids / 30 } {
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

    /// So many updates, `sampled` of them compared with the oracle. In the first fifth memory may grow to what it takes.
    fn run(&mut self, updates: usize, sampled: usize) {
        let (mut early, mut early_on_device) = (0, 0);
        for update in 0..updates {
            self.change(update);
            if update.is_multiple_of((updates / sampled).max(1)) {
                self.world.update(&format!("update {update}"));
            } else {
                self.world.update_unchecked();
            }
            let report = self.world.broad_phase.report();
            self.near += usize::from(report.plan.chosen == Chosen::Near);
            let (held, on_device) = (memory::held(), report.gpu.as_ref().map_or(0, |gpu| gpu.device_bytes));
            assert_eq!(report.fallback, None, "update {update}");
            if update < updates / 5 {
                (early, early_on_device) = (held.max(early), on_device.max(early_on_device));
                continue;
            }
            assert!(
                held <= early * 5 / 4,
                "update {update}: {held} bytes are held, at first at most {early}"
            );
            assert!(on_device <= early_on_device * 5 / 4, "update {update}: {on_device} on the device");
        }
        println!(
            "{updates} updates of {} ids, {} by near pairs: {early} bytes, {early_on_device} on the device",
            self.home.len(),
            self.near
        );
    }
}

/// On one thread, whose memory is counted.
fn soak(config: Config, ids: usize, updates: usize) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool");
    pool.install(|| Churn::new(config, ids, false).run(updates, (updates / 20).min(5000)));
}

fn cpu(strategy: Strategy) -> Config {
    Config { backend: Backend::Cpu, strategy, margin: 0.05, ..Config::DEFAULT }
}

#[test]
fn soak_of_a_small_world_in_the_bitmap() {
    soak(cpu(Strategy::Auto), 400, updates());
}

#[test]
fn soak_of_a_world_in_the_grid_with_edits() {
    soak(cpu(Strategy::Auto), 3000, updates());
}

#[test]
fn soak_of_a_small_world_in_the_grid() {
    soak(cpu(Strategy::Grid), 120, updates());
}

#[test]
fn soak_of_a_world_of_near_pairs() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool");
    let config = Config { margin: 0.0, ..cpu(Strategy::Grid) };
    let mut churn = Churn::new(config, 300, true);
    pool.install(|| churn.run(updates(), (updates() / 20).min(5000)));
    assert!(churn.near > updates() / 20, "{} updates by near pairs", churn.near);
}

/// A software adapter takes milliseconds for an update: a hundredth of them.
#[test]
fn soak_on_a_gpu() {
    let config = Config { margin: 0.05, ..gpu(Coding::Auto) };
    soak(config, 400, (updates() / 100).max(200));
}
