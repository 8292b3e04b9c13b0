//! Whole steps of rapier 0.36.1 with its own broad phase and with pbig, in turn: `cargo run --release --bin bench_step -- --help`.

use clap::Parser;
use pbig_harness_036::run::{Run, StepTime, Summary};
use pbig_harness_036::scenes::Scene;
use rapier3d::prelude::BroadPhaseBvh;
use std::fs::File;
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// Whole steps of rapier 0.36.1, with its own broad phase ("stock") and with pbig, step by step in turn.
#[derive(Parser)]
struct Args {
    /// Bodies, several separated by commas.
    #[arg(long, value_delimiter = ',', default_value = "1000,10000")]
    bodies: Vec<usize>,
    /// Scenes, several separated by commas; all by default.
    #[arg(long, value_delimiter = ',', value_parser = Scene::named)]
    scenes: Vec<Scene>,
    /// Steps of 1/60 s.
    #[arg(long, default_value_t = 300)]
    steps: usize,
    /// Seconds for each scene after its first step, which is not counted.
    #[arg(long, default_value_t = 60)]
    seconds: u64,
    /// Where to write all rows (CSV).
    #[arg(long)]
    write: Option<PathBuf>,
}

/// The heading of the CSV file. With fewer than 100 steps p99 is the worst step.
const HEADING: &str = "scene,bodies,threads,steps,stock_broad_mean_ms,pbig_broad_mean_ms,stock_broad_median_ms,\
pbig_broad_median_ms,stock_broad_p99_ms,pbig_broad_p99_ms,stock_step_mean_ms,pbig_step_mean_ms,stock_step_median_ms,\
pbig_step_median_ms,stock_step_p99_ms,pbig_step_p99_ms,stock_pairs,pbig_pairs";

/// The threads that rapier uses.
const THREADS: &str = if cfg!(feature = "parallel") { "2" } else { "1" };

fn main() -> ExitCode {
    let mut args = Args::parse();
    if args.scenes.is_empty() {
        args.scenes = Scene::ALL.to_vec();
    }
    println!(
        "scene        bodies  steps   broad phase, ms: stock   pbig      x   p99 x   step, ms: stock   pbig      x median x"
    );
    let mut rows = vec![HEADING.to_string()];
    for &bodies in &args.bodies {
        for &scene in &args.scenes {
            rows.push(measure(scene, bodies, &args));
        }
    }
    match args.write.map(|file| File::create(&file).and_then(|mut out| writeln!(out, "{}", rows.join("\n"))))
    {
        Some(Err(error)) => {
            eprintln!("the rows cannot be written: {error}");
            ExitCode::FAILURE
        }
        _ => ExitCode::SUCCESS,
    }
}

fn measure(scene: Scene, bodies: usize, args: &Args) -> String {
    let mut stock = Run::new(scene, bodies, 1, BroadPhaseBvh::new());
    let mut ours = Run::new(scene, bodies, 1, rapier_pbig::broad_phase());
    // In the first step everything is new. It is not counted.
    stock.step();
    ours.step();
    let (clock, limit) = (Instant::now(), Duration::from_secs(args.seconds));
    for step in 0..args.steps {
        // Each goes first in every other step.
        let [first, second] = if step % 2 == 0 { [&mut stock, &mut ours] } else { [&mut ours, &mut stock] };
        first.step();
        second.step();
        if clock.elapsed() > limit {
            break;
        }
    }
    let of = |run: &Run, time: fn(&StepTime) -> f64| Summary::of(run.times[1..].iter().map(time));
    let [stock_broad, ours_broad] = [&stock, &ours].map(|run| of(run, |time| time.broad_phase));
    let [stock_step, ours_step] = [&stock, &ours].map(|run| of(run, |time| time.step));
    println!(
        "{:<12} {bodies:>6} {:>6} {:>24.3} {:>6.3} {:>5.2}x {:>6.2}x {:>17.3} {:>6.3} {:>5.2}x {:>7.2}x",
        scene.name,
        ours.times.len() - 1,
        stock_broad.mean,
        ours_broad.mean,
        stock_broad.mean / ours_broad.mean,
        stock_broad.p99 / ours_broad.p99,
        stock_step.mean,
        ours_step.mean,
        stock_step.mean / ours_step.mean,
        stock_step.median / ours_step.median,
    );
    let sides = |[a, b]: [Summary; 2]| {
        [a.mean, b.mean, a.median, b.median, a.p99, b.p99].map(|ms| format!("{ms:.4}")).join(",")
    };
    let (broad, step) = (sides([stock_broad, ours_broad]), sides([stock_step, ours_step]));
    let (steps, pairs) = (ours.times.len() - 1, format!("{},{}", stock.pairs(), ours.pairs()));
    format!("{},{bodies},{THREADS},{steps},{broad},{step},{pairs}", scene.name)
}
