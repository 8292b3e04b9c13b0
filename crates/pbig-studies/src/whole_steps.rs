//! Whole steps of rapier: each scene in two worlds, one with rapier's own broad phase and one with pbig's, step by step in turn.

use pbig_harness::bench::figures;
use pbig_harness::prelude::*;
use pbig_harness::runner::{Run, StepTime};
use pbig_harness::scenes::Scene;
use rapier_pbig::PbigBroadPhase;
use rapier3d::prelude::{BroadPhase, DefaultBroadPhase};
use std::time::{Duration, Instant};

/// The columns have the names of those for rapier 0.36.1. The first step's times are left out: in it everything is new.
const COLUMNS: &str = "scene | bodies | threads | steps | stock_broad_mean_ms | pbig_broad_mean_ms | stock_broad_p99_ms | \
    pbig_broad_p99_ms | stock_step_mean_ms | pbig_step_mean_ms | stock_step_p99_ms | pbig_step_p99_ms | stock_pairs | pbig_pairs";

/// Measures every scene.
pub fn run(quick: bool) -> Report {
    let (sizes, steps, budget) =
        if quick { (&[20][..], 20, 1) } else { (&[1000, 10_000, 100_000][..], 300, 10) };
    let mut table = Table::new("whole-steps", COLUMNS);
    let cases = sizes.iter().flat_map(|bodies| Scene::ALL.map(|scene| (scene, *bodies)));
    for (scene, bodies) in tracked(cases, "scenes") {
        let mut stock = Run::new(scene, bodies, 1, DefaultBroadPhase::new());
        let mut ours = Run::new(scene, bodies, 1, PbigBroadPhase::new());
        race(&mut stock, &mut ours, steps, Duration::from_secs(budget));
        let (name, threads, steps) = (scene.name, rayon::current_num_threads(), ours.times.len());
        let broad = times(&stock.times, &ours.times, |time| time.broad_phase);
        let whole = times(&stock.times, &ours.times, |time| time.step);
        let pairs = [stock.pairs(), ours.pairs()];
        table.row(cells![name, bodies, threads, steps, ..broad, ..whole, ..pairs]);
    }
    Report::new("whole-steps", vec![table])
}

/// Steps both worlds, until the time is over. Each goes first in every other step, as the first one warms the caches.
fn race<A: BroadPhase, B: BroadPhase>(one: &mut Run<A>, other: &mut Run<B>, steps: usize, budget: Duration) {
    let clock = Instant::now();
    for _ in 0..steps.div_ceil(2) {
        one.step();
        other.step();
        other.step();
        one.step();
        if clock.elapsed() > budget {
            break;
        }
    }
}

/// Returns means and 99th percentiles.
fn times(stock: &[StepTime], ours: &[StepTime], of: impl Fn(&StepTime) -> f64) -> [f64; 4] {
    let [stock, ours] = [stock, ours].map(|times| figures(&times.iter().map(&of).collect::<Vec<_>>()));
    let ([stock_mean, _, stock_p99, ..], [mean, _, p99, ..]) = (stock, ours);
    [stock_mean, mean, stock_p99, p99]
}
