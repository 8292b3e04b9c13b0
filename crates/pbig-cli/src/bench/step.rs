//! `pbig bench step`: steps of every scene in two worlds, one with rapier's own broad phase and one with pbig's, step by step in turn.

use pbig_harness::prelude::*;
use pbig_harness::runner::{Run, StepTime, Summary};
use pbig_harness::scenes::Scene;
use rapier_pbig::PbigBroadPhase;
use rapier3d::prelude::{BroadPhase, DefaultBroadPhase};
use std::time::{Duration, Instant};

/// Bodies, and worlds that differ in their seed: in one small world a single long step decides the 99th percentile.
const SIZES: [(usize, u64); 3] = [(1000, 4), (10_000, 1), (100_000, 1)];

/// The columns have the names of those for rapier 0.36.1. Each world's first step is left out: in it everything is new.
const COLUMNS: &str = "scene | bodies | threads | steps | stock_broad_mean_ms | pbig_broad_mean_ms | stock_broad_p99_ms | \
    pbig_broad_p99_ms | stock_step_mean_ms | pbig_step_mean_ms | stock_step_p99_ms | pbig_step_p99_ms | stock_pairs | pbig_pairs";

/// Times, and pairs at the end, of all worlds together: with rapier's own broad phase, and with pbig's.
#[derive(Default)]
struct Both {
    times: [Vec<StepTime>; 2],
    pairs: [usize; 2],
}

/// Measures every scene.
pub(super) fn run(quick: bool) -> BenchReport {
    let (sizes, steps, limit) = if quick { (&[(20, 1)][..], 20, 1) } else { (&SIZES[..], 300, 15) };
    let mut table = Table::new("step", COLUMNS);
    let cases = sizes.iter().flat_map(|size| Scene::ALL.map(|scene| (scene, *size)));
    for (scene, (bodies, seeds)) in tracked(cases, "scenes") {
        let mut both = Both::default();
        for seed in 1..=seeds {
            let mut stock = Run::new(scene, bodies, seed, DefaultBroadPhase::new());
            let mut ours = Run::new(scene, bodies, seed, PbigBroadPhase::new());
            race(&mut stock, &mut ours, steps, Duration::from_secs(limit));
            both.add(0, &stock);
            both.add(1, &ours);
        }
        table.row(both.row(scene, bodies));
    }
    BenchReport::new("step", vec![table])
}

/// Runs steps of both worlds, until the time after the first step is over. Each goes first in every other step, as the first one
/// warms the caches.
fn race(one: &mut Run<impl BroadPhase>, other: &mut Run<impl BroadPhase>, steps: usize, limit: Duration) {
    one.step();
    other.step();
    let clock = Instant::now();
    for _ in 0..steps.div_ceil(2) {
        other.step();
        one.step();
        one.step();
        other.step();
        if clock.elapsed() > limit {
            break;
        }
    }
}

impl Both {
    fn add<B: BroadPhase>(&mut self, side: usize, run: &Run<B>) {
        self.times[side].extend(&run.times[1..]);
        self.pairs[side] += run.pairs();
    }

    /// Returns a row of [`COLUMNS`].
    fn row(&self, scene: Scene, bodies: usize) -> Vec<Value> {
        let (threads, steps) = (rayon::current_num_threads(), self.times[0].len());
        let (broad, whole) = (self.figures(|time| time.broad_phase), self.figures(|time| time.step));
        cells![scene.name, bodies, threads, steps, ..broad, ..whole, ..self.pairs]
    }

    /// Returns means and 99th percentiles, each of both sides.
    fn figures(&self, of: impl Fn(&StepTime) -> f64) -> [f64; 4] {
        let [stock, ours] = self.times.each_ref().map(|times| Summary::of(times.iter().map(&of)));
        [stock.mean, ours.mean, stock.p99, ours.p99]
    }
}
