//! Thousands of objects fall in rapier 0.36.1, once with its own broad phase and once with pbig's, step by step in turn, so that
//! both see the same noise of the machine.
//!
//! `cargo run --release --example falling_objects -- --help`

use clap::Parser;
use indicatif::ProgressBar;
use pbig_chart::{Chart, Line, Plot};
use pbig_harness_036::run::{Run, StepTime, Summary};
use pbig_scenes::scenes::Scene;
use rapier::prelude::BroadPhaseBvh;
use rapier_pbig::PbigFinder;
use rapier_pbig::shadow::{self, Checker, Shadow};
use std::io::IsTerminal;
use std::path::PathBuf;
use std::process::ExitCode;

/// Objects fall in rapier 0.36.1, with its own broad phase and with pbig's.
#[derive(Parser)]
struct Args {
    /// Number of objects.
    #[arg(long, default_value_t = 10_000, value_parser = clap::value_parser!(u32).range(1..))]
    bodies: u32,
    /// Steps of 1/60 s.
    #[arg(long, default_value_t = 300, value_parser = clap::value_parser!(u32).range(1..))]
    steps: u32,
    /// Which scene; a wrong name lists the right ones.
    #[arg(long, default_value = "column", value_parser = Scene::named)]
    scene: Scene,
    /// Seed of the scene's random numbers.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// File for the chart (SVG).
    #[arg(long, default_value = "out/falling_objects_036.svg")]
    chart: PathBuf,
}

/// Steps from one comparison with the oracle to the next; events are followed in all of them.
const CHECK_EVERY: usize = 20;

fn main() -> ExitCode {
    let args = Args::parse();
    let [stock, ours] = measure(&args);
    let checker = check(&args);
    println!("{} with {} bodies, {} steps, rapier 0.36.1\n", args.scene.name, args.bodies, args.steps);
    print_table(&stock, &ours, &checker);
    let drawn = write_chart(&args, &stock.times, &ours.times);
    match &drawn {
        Ok(()) => println!("chart: {}", args.chart.display()),
        Err(error) => eprintln!("{error}"),
    }
    print_where_to_watch(&args);
    for difference in checker.differences.iter().take(3) {
        eprintln!("{difference}");
    }
    if checker.differences.is_empty() && drawn.is_ok() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

fn new_run(args: &Args, broad_phase: BroadPhaseBvh) -> Run {
    Run::new(args.scene, args.bodies as usize, args.seed, broad_phase)
}

fn progress(args: &Args) -> ProgressBar {
    if std::io::stderr().is_terminal() { ProgressBar::new(args.steps.into()) } else { ProgressBar::hidden() }
}

/// Both worlds in turn; each goes first in every other step.
fn measure(args: &Args) -> [Run; 2] {
    let mut runs = [BroadPhaseBvh::new(), rapier_pbig::broad_phase()].map(|new| new_run(args, new));
    let bar = progress(args);
    for step in 0..args.steps {
        runs.iter_mut().for_each(Run::step);
        runs.reverse();
        bar.set_position(step.into());
    }
    bar.finish_and_clear();
    if args.steps % 2 == 1 {
        runs.reverse();
    }
    runs
}

/// A third run, apart from the measured ones because the oracle is slow.
fn check(args: &Args) -> Checker {
    let mut broad_phase = BroadPhaseBvh::new();
    let finder = PbigFinder::default().with_shadow(Shadow::Oracle).every(CHECK_EVERY);
    rapier_pbig::install_finder(&mut broad_phase, finder);
    let (mut run, bar) = (new_run(args, broad_phase), progress(args));
    for _ in 0..args.steps {
        run.step();
        bar.inc(1);
    }
    bar.finish_and_clear();
    shadow::checker(&run.broad_phase).expect("it was installed").clone()
}

fn print_table(stock: &Run, ours: &Run, checker: &Checker) {
    println!("                                 stock        pbig   stock/pbig");
    let row = |name: &str, of: fn(&StepTime) -> f64| {
        let [stock, ours] = [stock, ours].map(|run| Summary::of(run.times.iter().map(of)).median);
        println!("{name:<26} {stock:>11.3} {ours:>11.3} {:>11.2}x", stock / ours);
    };
    row("broad phase, ms a step", |time| time.broad_phase);
    row("whole step, ms", |time| time.step);
    println!("{:<26} {:>11} {:>11}", "pairs at the end", stock.pairs(), ours.pairs());
    let missing = checker.differences.iter().filter(|difference| difference.fault.is_missing()).count();
    let against = format!("(against the oracle, {} comparisons)", checker.compared);
    println!("{:<26} {:>11} {missing:>11}   {against}", "missing pairs", "");
    println!("\nTimes are medians over the steps. The two worlds drift apart, so pairs differ in number.");
}

/// Names the programs that show the same objects as they fall.
fn print_where_to_watch(args: &Args) {
    let Args { scene, bodies, seed, .. } = args;
    println!("\nWatch it, on rapier 0.27: cargo run --release --manifest-path viewer/Cargo.toml -- \\");
    println!("              --scene {} --bodies {bodies} --seed {seed}", scene.name);
    println!("In a browser: scripts/page.sh");
}

fn write_chart(args: &Args, stock: &[StepTime], ours: &[StepTime]) -> Result<(), String> {
    let folder = args.chart.parent().filter(|folder| !folder.as_os_str().is_empty());
    if let Some(folder) = folder {
        std::fs::create_dir_all(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    }
    let plot = |title, of: fn(&StepTime) -> f64| {
        let line = |name, times: &[StepTime]| Line::steps(name, times.iter().map(of));
        Plot::steps(title, vec![line("stock", stock), line("pbig", ours)])
    };
    let plots = vec![plot("broad phase", |time| time.broad_phase), plot("whole step", |time| time.step)];
    Chart { plots, ..Chart::default() }.write(&args.chart)
}
