//! Prints frames of rapier 0.36.1 with its own broad phase and with pbig, in turn, as CSV: `cargo run --release --bin bench_step -- --help`.

use clap::Parser;
use pbig_harness_036::run::{Run, StepTime, Summary};
use pbig_scenes::frames::FrameKind;
use pbig_scenes::scenes::Scene;
use rapier::prelude::BroadPhaseBvh;
use std::time::{Duration, Instant};

/// Frames of rapier 0.36.1, with its own broad phase ("stock") and with pbig, in turn: a whole step, and scene queries, as CSV.
#[derive(Parser)]
struct Args {
    /// Bodies, several separated by commas.
    #[arg(long, value_delimiter = ',', default_value = "1000,10000")]
    bodies: Vec<usize>,
    /// Scenes, several separated by commas; all by default.
    #[arg(long, value_delimiter = ',', value_parser = Scene::named)]
    scenes: Vec<Scene>,
    /// Scene queries after each step, several kinds separated by commas: none, ray, rays-10000 or character.
    #[arg(long, value_name = "KIND", value_delimiter = ',', default_value = "none", value_parser = FrameKind::named)]
    queries: Vec<FrameKind>,
    /// Steps of 1/60 s.
    #[arg(long, default_value_t = 300)]
    steps: usize,
    /// Seconds for each row after the first step, which is not counted.
    #[arg(long, default_value_t = 60)]
    seconds: u64,
}

/// The heading of the rows. With fewer than 100 steps p99 is the worst step.
const HEADING: &str = "scene,bodies,threads,steps,stock_broad_mean_ms,pbig_broad_mean_ms,stock_broad_median_ms,\
pbig_broad_median_ms,stock_broad_p99_ms,pbig_broad_p99_ms,stock_step_mean_ms,pbig_step_mean_ms,stock_step_median_ms,\
pbig_step_median_ms,stock_step_p99_ms,pbig_step_p99_ms,stock_pairs,pbig_pairs,queries,stock_frame_mean_ms,\
pbig_frame_mean_ms,stock_frame_median_ms,pbig_frame_median_ms,stock_frame_p99_ms,pbig_frame_p99_ms,\
stock_queries_mean_ms,pbig_queries_mean_ms,stock_over_pbig_frame_mean,stock_hits,pbig_hits";

/// The threads that rapier uses.
const THREADS: &str = if cfg!(feature = "parallel") { "2" } else { "1" };

fn main() {
    let mut args = Args::parse();
    if args.scenes.is_empty() {
        args.scenes = Scene::ALL.to_vec();
    }
    println!("{HEADING}");
    cases(&args).for_each(|case| println!("{}", case.row(&case.measure(&args))));
}

fn cases(args: &Args) -> impl Iterator<Item = Case> {
    args.bodies.iter().flat_map(move |&bodies| {
        let of = move |scene| args.queries.iter().map(move |&queries| Case { scene, bodies, queries });
        args.scenes.iter().copied().flat_map(of)
    })
}

/// The subject of a row.
struct Case {
    scene: Scene,
    bodies: usize,
    queries: FrameKind,
}

/// The measured values of one broad phase.
struct Side {
    broad: Summary,
    step: Summary,
    queries: Summary,
    frame: Summary,
    steps: usize,
    pairs: usize,
    hits: u64,
}

impl Side {
    /// Summarizes all frames but the first, in which everything is new.
    fn of(run: &Run) -> Self {
        let of = |time: fn(&StepTime) -> f64| Summary::of(run.times[1..].iter().map(time));
        Self {
            broad: of(|time| time.broad_phase),
            step: of(|time| time.step),
            queries: of(|time| time.queries),
            frame: of(|time| time.frame),
            steps: run.times.len() - 1,
            pairs: run.pairs(),
            hits: run.hits,
        }
    }
}

impl Case {
    /// Runs stock and pbig.
    fn measure(&self, args: &Args) -> [Side; 2] {
        let [mut stock, mut ours] = [BroadPhaseBvh::new(), rapier_pbig::broad_phase()]
            .map(|one| Run::new(self.scene, self.bodies, 1, one).with_queries(self.queries));
        stock.step();
        ours.step();
        let (clock, limit) = (Instant::now(), Duration::from_secs(args.seconds));
        for step in 0..args.steps {
            // Each goes first in every other step.
            let [first, second] =
                if step % 2 == 0 { [&mut stock, &mut ours] } else { [&mut ours, &mut stock] };
            first.step();
            second.step();
            if clock.elapsed() > limit {
                break;
            }
        }
        [&stock, &ours].map(Side::of)
    }

    /// Returns a row, see [`HEADING`].
    fn row(&self, sides: &[Side; 2]) -> String {
        let [stock, ours] = sides;
        let [broad, step, frame] = [
            columns(sides, |side| three(side.broad)),
            columns(sides, |side| three(side.step)),
            columns(sides, |side| three(side.frame)),
        ];
        let queries = columns(sides, |side| [side.queries.mean]);
        let ratio = stock.frame.mean / ours.frame.mean;
        let (scene, bodies, kind) = (self.scene.name, self.bodies, self.queries.name());
        let (pairs, hits) = ([stock.pairs, ours.pairs], [stock.hits, ours.hits]);
        let start = format!("{scene},{bodies},{THREADS},{},{broad},{step}", ours.steps);
        let end = format!("{frame},{queries},{ratio:.4},{},{}", hits[0], hits[1]);
        format!("{start},{},{},{kind},{end}", pairs[0], pairs[1])
    }
}

fn three(summary: Summary) -> [f64; 3] {
    [summary.mean, summary.median, summary.p99]
}

/// Returns values of stock and pbig side by side.
fn columns<const N: usize>(sides: &[Side; 2], of: fn(&Side) -> [f64; N]) -> String {
    let [stock, ours] = sides.each_ref().map(of);
    let pairs = stock.iter().zip(ours).map(|(stock, ours)| format!("{stock:.4},{ours:.4}"));
    pairs.collect::<Vec<_>>().join(",")
}
