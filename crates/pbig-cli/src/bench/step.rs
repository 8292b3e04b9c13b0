//! `pbig bench step`: steps of every scene, with scene queries if asked for, in two worlds: one with rapier's own broad phase
//! and one with pbig's, frame by frame in turn.

use pbig_harness::frames::FrameKind;
use pbig_harness::prelude::*;
use pbig_harness::queries::Answer;
use pbig_harness::runner::{Run, StepTime, Summary};
use pbig_harness::scenes::Scene;
use rapier_pbig::PbigBroadPhase;
use rapier3d::prelude::{BroadPhase, DefaultBroadPhase};
use std::time::{Duration, Instant};

/// Bodies, and worlds that differ in their seed: in one small world a single long step decides the 99th percentile.
const SIZES: [(usize, u64); 3] = [(1000, 4), (10_000, 1), (100_000, 1)];

/// The columns have the names of those for rapier 0.36.1. Each world's first step is left out: in it everything is new.
const COLUMNS: &str = "scene | bodies | threads | steps | stock_broad_mean_ms | pbig_broad_mean_ms | stock_broad_p99_ms | \
    pbig_broad_p99_ms | stock_step_mean_ms | pbig_step_mean_ms | stock_step_p99_ms | pbig_step_p99_ms | stock_pairs | \
    pbig_pairs | queries | stock_frame_mean_ms | pbig_frame_mean_ms | stock_frame_median_ms | pbig_frame_median_ms | \
    stock_frame_p99_ms | pbig_frame_p99_ms | stock_queries_mean_ms | pbig_queries_mean_ms | stock_over_pbig_frame_mean | \
    stock_hits | pbig_hits";

/// Times, pairs at the end and hits, of all worlds together: with rapier's own broad phase, and with pbig's.
#[derive(Default)]
struct Both {
    times: [Vec<StepTime>; 2],
    pairs: [usize; 2],
    hits: [u64; 2],
}

/// Measures every scene with each kind of scene queries; without a kind, without queries.
pub(super) fn run(quick: bool, kinds: &[FrameKind]) -> BenchReport {
    let kinds = if kinds.is_empty() { &[FrameKind::None] } else { kinds };
    let (sizes, steps, limit) = if quick { (&[(20, 1)][..], 20, 1) } else { (&SIZES[..], 300, 15) };
    let mut table = Table::new("step", COLUMNS);
    let cases = sizes.iter().flat_map(|size| Scene::ALL.map(|scene| (scene, *size)));
    let cases = cases.flat_map(|(scene, size)| kinds.iter().map(move |kind| (scene, size, *kind)));
    for (scene, (bodies, seeds), kind) in tracked(cases, "scenes") {
        let mut both = Both::default();
        for seed in 1..=seeds {
            let mut stock = Run::new(scene, bodies, seed, DefaultBroadPhase::new()).with_queries(kind);
            let mut ours = Run::new(scene, bodies, seed, PbigBroadPhase::new()).with_queries(kind);
            race(&mut stock, &mut ours, steps, Duration::from_secs(limit));
            both.add(0, &stock);
            both.add(1, &ours);
        }
        table.row(both.row(scene, bodies, kind));
    }
    BenchReport::new("step", vec![table])
}

/// Runs frames of both worlds, until the time after the first frame is over. Each goes first in every other frame, as the first one
/// warms the caches.
fn race<A, B>(one: &mut Run<A>, other: &mut Run<B>, steps: usize, limit: Duration)
where
    A: BroadPhase + Answer,
    B: BroadPhase + Answer,
{
    one.frame();
    other.frame();
    let clock = Instant::now();
    for _ in 0..steps.div_ceil(2) {
        other.frame();
        one.frame();
        one.frame();
        other.frame();
        if clock.elapsed() > limit {
            break;
        }
    }
}

impl Both {
    fn add<B: BroadPhase>(&mut self, side: usize, run: &Run<B>) {
        self.times[side].extend(&run.times[1..]);
        self.pairs[side] += run.pairs();
        self.hits[side] += run.hits;
    }

    /// Returns a row of [`COLUMNS`].
    fn row(&self, scene: Scene, bodies: usize, kind: FrameKind) -> Vec<Value> {
        let (threads, steps) = (rayon::current_num_threads(), self.times[0].len());
        let [means, medians, p99] = self.figures(|time| time.frame);
        let [queries, ..] = self.figures(|time| time.queries);
        let mean_and_p99 = |[mean, _, p99]: [[f64; 2]; 3]| [mean, p99].concat();
        let broad = mean_and_p99(self.figures(|time| time.broad_phase));
        let whole = mean_and_p99(self.figures(|time| time.step));
        let mut row = cells![scene.name, bodies, threads, steps, ..broad, ..whole, ..self.pairs, kind.name()];
        row.extend(cells![..means, ..medians, ..p99, ..queries, means[0] / means[1], ..self.hits]);
        row
    }

    /// Returns means, medians and 99th percentiles, each of both sides.
    fn figures(&self, of: impl Fn(&StepTime) -> f64) -> [[f64; 2]; 3] {
        let sides = self.times.each_ref().map(|times| Summary::of(times.iter().map(&of)));
        [sides.map(|it| it.mean), sides.map(|it| it.median), sides.map(|it| it.p99)]
    }
}
