//! The main job: thousands of objects fall, once with rapier's own broad phase and once with pbig's,
//! step by step in turn, so that both see the same noise of the machine.
//!
//! `cargo run --release --example falling_objects -- --help`

use clap::Parser;
use pbig_harness::chart::{Chart, Line, Plot};
use pbig_harness::options::BackendOption;
use pbig_harness::output::progress;
use pbig_harness::runner::{Run, Spread, StepTime};
use pbig_harness::scenes::Scene;
use rapier_pbig::shadow::Checker;
use rapier_pbig::{PbigBroadPhase, PbigConfig};
use rapier3d::prelude::{BroadPhase, DefaultBroadPhase};
use std::path::PathBuf;
use std::process::ExitCode;

/// Objects fall in rapier, with its own broad phase and with pbig's.
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
    /// The backend of pbig.
    #[arg(long, value_enum, default_value_t)]
    backend: BackendOption,
    /// Seed of the scene's random numbers.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// File for the chart (SVG).
    #[arg(long, default_value = "out/falling_objects.svg")]
    chart: PathBuf,
}

/// Steps from one comparison with the oracle to the next; events are followed in all of them.
const CHECK_EVERY: usize = 20;

fn main() -> ExitCode {
    let args = Args::parse();
    let mut stock = Run::new(args.scene, args.bodies as usize, args.seed, DefaultBroadPhase::new());
    let mut ours = Run::new(args.scene, args.bodies as usize, args.seed, args.backend.for_rapier());
    let bar = progress(args.steps as usize, "steps");
    for _ in 0..args.steps {
        stock.step();
        ours.step();
        bar.inc(1);
    }
    bar.finish_and_clear();
    let checker = check(&args, args.backend.for_rapier());
    println!("{} with {} bodies, {} steps\n", args.scene.name, args.bodies, args.steps);
    print_table(&stock, &ours, &checker);
    println!("\n{}", ours.broad_phase.inner.stats().report.plan);
    if let Some(why) = &ours.broad_phase.inner.stats().report.fallback {
        println!("note: {why}");
    }
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

/// Compares a third run with the oracle: it is slow, so it is apart from the measured ones.
fn check(args: &Args, broad_phase: PbigBroadPhase) -> Checker {
    let run = Run::new(args.scene, args.bodies as usize, args.seed, broad_phase);
    let mut run = run.checked(PbigConfig::DEFAULT.margin, CHECK_EVERY);
    let bar = progress(args.steps as usize, "steps");
    for _ in 0..args.steps {
        run.step();
        bar.inc(1);
    }
    bar.finish_and_clear();
    run.broad_phase.checker().expect("it is checked").clone()
}

fn print_table(stock: &Run<DefaultBroadPhase>, ours: &Run<PbigBroadPhase>, checker: &Checker) {
    println!("                                 stock        pbig   stock/pbig");
    let row = |name: &str, of: fn(&StepTime) -> f64| {
        let [stock, ours] = [&stock.times, &ours.times].map(|times| Spread::of(times.iter().map(of)).median);
        println!("{name:<26} {stock:>11.3} {ours:>11.3} {:>11.2}x", stock / ours);
    };
    row("broad phase, ms a step", |t| t.broad_phase);
    row("whole step, ms", |t| t.step);
    println!("{:<26} {:>11} {:>11}", "pairs at the end", stock.pairs(), ours.pairs());
    println!("{:<26} {:>11} {:>11}", "events", events(stock), events(ours));
    let missing = checker.differences.iter().filter(|d| d.fault.is_missing()).count();
    let against = format!("(against the oracle, {} comparisons)", checker.compared);
    println!("{:<26} {:>11} {missing:>11}   {against}", "missing pairs", "");
    println!(
        "\nTimes are medians over the steps. The two worlds drift apart, so pairs and events differ in number.\n\
         Where a scene has pairs that rapier's narrow phase throws away, pbig leaves them out."
    );
}

/// Names the programs that show the same objects as they fall.
fn print_where_to_watch(args: &Args) {
    let Args { scene, bodies, seed, .. } = args;
    println!(
        "\nWatch it: cargo run --release -p pbig-viewer -- --scene {} --bodies {bodies} --seed {seed}",
        scene.name
    );
    println!("In a browser: scripts/page.sh");
}

fn events<B: BroadPhase>(run: &Run<B>) -> u64 {
    run.broad_phase.added + run.broad_phase.removed
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
    let plots = vec![plot("broad phase", |t| t.broad_phase), plot("whole step", |t| t.step)];
    Chart { plots, ..Chart::default() }.write(&args.chart)
}
