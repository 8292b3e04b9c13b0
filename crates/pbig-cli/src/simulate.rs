//! `pbig simulate` and `pbig scenes`: headless rapier worlds.

use crate::backend::{BackendArgs, adapter_line, is_software};
use crate::options::{BODIES, whole};
use pbig_harness::prelude::*;
use pbig_harness::runner::{Run, StepTime};
use pbig_harness::scenes::Scene;
use rapier_pbig::shadow::Checker;
use rapier_pbig::{PbigBroadPhase, PbigConfig};
use rapier3d::prelude::{BroadPhase, DefaultBroadPhase};
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub(crate) struct Args {
    /// The scene; `pbig scenes` lists them.
    #[arg(long, value_name = "NAME")]
    scene: String,
    /// Bodies; each scene has its own default.
    #[arg(long, value_name = "N", value_parser = whole::<usize>(BODIES), allow_negative_numbers = true)]
    bodies: Option<usize>,
    /// Steps of 1/60 s.
    #[arg(long, value_name = "K", default_value = "300", value_parser = whole::<usize>(1..=u64::MAX), allow_negative_numbers = true)]
    steps: usize,
    /// The broad phase that drives the world.
    #[arg(long, default_value = "pbig", value_parser = ["pbig", "stock"])]
    broad_phase: String,
    #[command(flatten)]
    backend: BackendArgs,
    /// Seed of the scene's random numbers.
    #[arg(long, default_value = "1", value_parser = whole::<u64>(0..=u64::MAX), allow_negative_numbers = true)]
    seed: u64,
    /// Run rapier's broad phase and the oracle beside pbig and compare after every call.
    #[arg(long)]
    check: bool,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

pub(crate) fn list() -> Result<(), Failure> {
    let line = |scene: Scene| {
        let Scene { name, about, hard, default_bodies, .. } = scene;
        format!("{name:<11} {about}; hard: {hard} ({default_bodies} bodies)\n")
    };
    print(&Scene::ALL.map(line).concat())
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let scene = Scene::named(&args.scene)?;
    let bodies = args.bodies.unwrap_or(scene.default_bodies);
    refuse_what_stock_ignores(args)?;
    if args.broad_phase == "stock" {
        return finish(args, bodies, Run::new(scene, bodies, args.seed, DefaultBroadPhase::new()), |_| None);
    }
    let run = Run::new(scene, bodies, args.seed, args.backend.for_rapier()?);
    let run = if args.check { run.checked(PbigConfig::DEFAULT.margin, 1) } else { run };
    finish(args, bodies, run, |ours| Some(ours))
}

fn refuse_what_stock_ignores(args: &Args) -> Result<(), Failure> {
    let ignored = if args.check { Some("--check") } else { args.backend.option_of_gpu() };
    match ignored {
        Some(option) if args.broad_phase == "stock" => Err(Failure::Input(format!(
            "{option} is for pbig, not for rapier's own broad phase: leave out {option} or --broad-phase stock"
        ))),
        _ => Ok(()),
    }
}

/// Runs the scene and prints the results. `ours` returns the broad phase, if it is pbig's.
fn finish<B: BroadPhase>(
    args: &Args,
    bodies: usize,
    mut run: Run<B>,
    ours: fn(&B) -> Option<&PbigBroadPhase>,
) -> Result<(), Failure> {
    let bar = progress(args.steps, "steps");
    let mut fallback = None;
    for _ in 0..args.steps {
        run.steps(1, || bar.inc(1));
        fallback = fallback.or_else(|| fallback_of(ours(&run.broad_phase.inner)).map(str::to_owned));
        if run.broad_phase.first_difference().is_some() {
            break;
        }
    }
    bar.finish_and_clear();
    if let Some(ours) = ours(&run.broad_phase.inner) {
        args.backend.check_use(ours.device_name(), fallback.as_deref())?;
    }
    let frames = run.write_failure(&args.scene, Path::new("."));
    let file = frames.as_ref().and_then(|frames| frames.as_ref().ok());
    report(args, bodies, &run, ours(&run.broad_phase.inner), file)?;
    let (Some(first), Some(frames)) = (run.broad_phase.first_difference(), frames) else { return Ok(()) };
    Err(Failure::Check(match frames {
        Ok(file) => format!("{first}; the frames up to there are in {}", file.display()),
        Err(why) => format!("{first}; the frames could not be written: {why}"),
    }))
}

/// Returns the reason why the CPU did the work of a wanted device in the last step, if it did.
fn fallback_of(ours: Option<&PbigBroadPhase>) -> Option<&str> {
    ours?.stats().report.fallback.as_deref()
}

fn report<B: BroadPhase>(
    args: &Args,
    bodies: usize,
    run: &Run<B>,
    ours: Option<&PbigBroadPhase>,
    file: Option<&PathBuf>,
) -> Result<(), Failure> {
    let (adapter, fallback) = (ours.and_then(PbigBroadPhase::device_name), fallback_of(ours));
    let backend = if ours.is_some() { args.backend.in_use(fallback) } else { "cpu" };
    let spread = |of: fn(&StepTime) -> f64| Spread::of(run.times.iter().map(of));
    let (broad_phase, step) = (spread(|time| time.broad_phase), spread(|time| time.step));
    let (colliders, steps, pairs) = (run.world.colliders.len(), run.times.len(), run.pairs());
    let (added, removed) = (run.broad_phase.added, run.broad_phase.removed);
    let checker = run.broad_phase.checker();
    if args.json {
        let object = serde_json::json!({
            "scene": args.scene,
            "bodies": bodies,
            "colliders": colliders,
            "steps": steps,
            "broad_phase": args.broad_phase,
            "backend": backend,
            "adapter": adapter,
            "is_software": adapter.map(is_software),
            "ms": { "broad_phase": broad_phase, "step": step },
            "pairs": pairs,
            "added": added,
            "removed": removed,
            "updates": ours.map_or(0, |ours| ours.stats().totals.updates),
            "fallback": fallback,
            "check": checker.map(|checker| check_object(checker, file)),
        });
        return print(&object.to_string());
    }
    let note = fallback.map_or(String::new(), |why| format!("\nnote: {why}"));
    print(&format!(
        "{}: {bodies} bodies, {colliders} colliders, {steps} steps with the {} broad phase\n\
         a step: broad phase {broad_phase}, all {step}\n\
         {pairs} pairs at the end; {added} added, {removed} removed{}{note}{}",
        args.scene,
        args.broad_phase,
        checker.map_or(String::new(), |checker| format!("\n{}", check_line(checker))),
        adapter_line(adapter),
    ))
}

fn missing(checker: &Checker) -> usize {
    checker.differences.iter().filter(|difference| difference.fault.is_missing()).count()
}

/// Returns the checker's results; `file` has the frames of a failure.
fn check_object(checker: &Checker, file: Option<&PathBuf>) -> serde_json::Value {
    serde_json::json!({
        "calls": checker.compared,
        "oracle_pairs": checker.oracle_pairs,
        "stock_only": checker.stock_only,
        "missing": missing(checker),
        "differences": checker.differences.iter().map(ToString::to_string).collect::<Vec<_>>(),
        "frames_file": file,
    })
}

fn check_line(checker: &Checker) -> String {
    let Checker { compared, oracle_pairs, stock_only, .. } = checker;
    let of_the_oracle = format!("{} missing pairs of {oracle_pairs} that the oracle found", missing(checker));
    format!("checked {compared} calls: {of_the_oracle}; {stock_only} pairs that only stock reports")
}
