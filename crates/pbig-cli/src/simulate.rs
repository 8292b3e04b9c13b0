//! `pbig simulate` and `pbig scenes`: headless rapier worlds.

use crate::options::{MOST_BODIES, up_to};
use pbig_harness::options::BackendOption;
use pbig_harness::output::{Failure, print, progress};
use pbig_harness::scenes::Scene;
use pbig_harness::simulate::{Check, Outcome, Task, run as run_scene, run_checked};
use rapier_pbig::{PbigBroadPhase, PbigConfig};
use rapier3d::prelude::DefaultBroadPhase;
use std::path::Path;

#[derive(clap::Args)]
pub(crate) struct Args {
    /// The scene; `pbig scenes` lists them.
    #[arg(long, value_name = "NAME")]
    scene: String,
    /// Bodies; each scene has its own default.
    #[arg(long, value_name = "N", value_parser = up_to(MOST_BODIES), allow_negative_numbers = true)]
    bodies: Option<usize>,
    /// Steps of 1/60 s.
    #[arg(long, value_name = "K", default_value = "300", value_parser = up_to(i64::MAX), allow_negative_numbers = true)]
    steps: usize,
    /// Which broad phase drives the world.
    #[arg(long, default_value = "pbig", value_parser = ["pbig", "stock"])]
    broad_phase: String,
    /// Where pbig works.
    #[arg(long, value_enum, default_value_t)]
    backend: BackendOption,
    /// For the random numbers of the scene.
    #[arg(long, default_value = "1", allow_negative_numbers = true)]
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
    let task = Task { scene, bodies, steps: args.steps, seed: args.seed };
    refuse_what_stock_ignores(args)?;
    let bar = progress(args.steps, "steps");
    let config = PbigConfig { backend: args.backend.backend(), ..PbigConfig::DEFAULT };
    let ours = PbigBroadPhase::with_config(config).expect("the default margin is a length");
    let step = |_| bar.inc(1);
    let (outcome, ours) = if args.broad_phase == "stock" {
        (run_scene(task, DefaultBroadPhase::new(), step).0, None)
    } else {
        let run = if args.check {
            run_checked(task, ours, config.margin, Path::new("."), step)
        } else {
            run_scene(task, ours, step)
        };
        (run.0, Some(run.1))
    };
    bar.finish_and_clear();
    report(args, bodies, &outcome, ours.as_ref())?;
    if outcome.failed() { Err(Failure::Check(failure_line(&outcome))) } else { Ok(()) }
}

fn refuse_what_stock_ignores(args: &Args) -> Result<(), Failure> {
    let what =
        "--check is for pbig, not for rapier's own broad phase: leave out --check or --broad-phase stock";
    if args.check && args.broad_phase == "stock" { Err(Failure::Input(what.into())) } else { Ok(()) }
}

/// The first difference and where the frames are.
fn failure_line(outcome: &Outcome) -> String {
    let check = outcome.check.as_ref();
    let first = check.and_then(|c| c.differences.first()).map_or(String::new(), ToString::to_string);
    match check.and_then(|c| c.frames_file.as_ref()) {
        Some(Ok(file)) => format!("{first}; the frames up to there are in {}", file.display()),
        Some(Err(why)) => format!("{first}; the frames could not be written: {why}"),
        None => first,
    }
}

/// Prints the outcome; `ours` is the broad phase, if it is pbig's.
fn report(
    args: &Args,
    bodies: usize,
    outcome: &Outcome,
    ours: Option<&PbigBroadPhase>,
) -> Result<(), Failure> {
    let fallback = ours.and_then(|ours| ours.stats().report.fallback.as_deref());
    let backend = if ours.is_some() { args.backend.in_use(fallback) } else { "cpu" };
    if args.json {
        let object = serde_json::json!({
            "scene": args.scene,
            "bodies": bodies,
            "colliders": outcome.colliders,
            "steps": outcome.steps,
            "broad_phase": args.broad_phase,
            "backend": backend,
            "adapter": ours.and_then(PbigBroadPhase::adapter),
            "ms": { "broad_phase": outcome.broad_phase, "step": outcome.step },
            "pairs": outcome.pairs,
            "added": outcome.added,
            "removed": outcome.removed,
            "updates": ours.map_or(0, |ours| ours.stats().totals.updates),
            "fallback": fallback,
            "check": outcome.check.as_ref().map(check_object),
        });
        return print(&object.to_string());
    }
    let note = fallback.map_or(String::new(), |why| format!("\nnote: {why}"));
    let Outcome { colliders, steps, broad_phase, step, pairs, added, removed, check } = outcome;
    print(&format!(
        "{}: {bodies} bodies, {colliders} colliders, {steps} steps with the {} broad phase\n\
         a step: broad phase {broad_phase}, all {step}\n\
         {pairs} pairs at the end; {added} added, {removed} removed\n{}{note}",
        args.scene,
        args.broad_phase,
        check.as_ref().map_or(String::new(), check_line),
    ))
}

fn check_object(check: &Check) -> serde_json::Value {
    serde_json::json!({
        "calls": check.calls,
        "oracle_pairs": check.oracle_pairs,
        "stock_only": check.stock_only,
        "missing": check.missing(),
        "differences": check.differences.iter().map(ToString::to_string).collect::<Vec<_>>(),
        "frames_file": check.frames_file.as_ref().and_then(|file| file.as_ref().ok()),
    })
}

fn check_line(check: &Check) -> String {
    format!(
        "checked {} calls: {} missing pairs of {} that the oracle found; {} pairs that only stock reports",
        check.calls,
        check.missing(),
        check.oracle_pairs,
        check.stock_only
    )
}
