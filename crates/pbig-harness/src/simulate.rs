//! A scene run with one broad phase, checked or not: what `pbig simulate` does.

use crate::runner::{Run, Spread, StepTime, Timed, milliseconds};
use crate::scenes::Scene;
use crate::shadow::{Difference, Shadowed};
use rapier_pbig::shadow::write_frames;
use rapier3d::prelude::BroadPhase;
use std::path::{Path, PathBuf};

/// The simulation to run.
#[derive(Clone, Copy)]
pub struct Task {
    /// The scene.
    pub scene: Scene,
    /// Number of bodies.
    pub bodies: usize,
    /// Number of steps.
    pub steps: usize,
    /// For the random numbers of the scene.
    pub seed: u64,
}

/// The results of a simulation.
pub struct Outcome {
    /// Steps that were made; fewer than asked for when a check failed.
    pub steps: usize,
    /// Milliseconds in the broad phase, step by step.
    pub broad_phase: Spread,
    /// Milliseconds of whole steps.
    pub step: Spread,
    /// Colliders at the end.
    pub colliders: usize,
    /// Pairs that the narrow phase has at the end.
    pub pairs: usize,
    /// `AddPair` events.
    pub added: u64,
    /// `DeletePair` events.
    pub removed: u64,
    /// The check, if one was made.
    pub check: Option<Check>,
}

/// The results of the shadow checker.
pub struct Check {
    /// Calls compared.
    pub calls: usize,
    /// Pairs of the oracle, in all calls.
    pub oracle_pairs: u64,
    /// Pairs that only stock reported, in all calls: excluded by a filter, or not in contact.
    pub stock_only: u64,
    /// The faults that it found.
    pub differences: Vec<Difference>,
    /// After a failure, where the boxes of the calls up to it are, for `pbig replay`; or why they could
    /// not be written.
    pub frames_file: Option<Result<PathBuf, String>>,
}

impl Check {
    /// Pairs that should have been there and were not.
    pub fn missing(&self) -> usize {
        self.differences.iter().filter(|d| d.fault.is_missing()).count()
    }
}

impl Outcome {
    /// Returns true if a check was made and failed.
    pub fn failed(&self) -> bool {
        self.check.as_ref().is_some_and(|check| !check.differences.is_empty())
    }
}

fn outcome<B: BroadPhase>(run: &Run<B>, check: Option<Check>) -> Outcome {
    let spread = |of: fn(&StepTime) -> f64| Spread::of(run.times.iter().map(of));
    Outcome {
        steps: run.times.len(),
        broad_phase: spread(|t| t.broad_phase),
        step: spread(|t| t.step),
        colliders: run.world.colliders.len(),
        pairs: run.pairs(),
        added: run.broad_phase.added,
        removed: run.broad_phase.removed,
        check,
    }
}

/// Runs the scene and gives the broad phase back; `progress` is told after each step.
pub fn run<B: BroadPhase>(task: Task, broad_phase: B, mut progress: impl FnMut(usize)) -> (Outcome, B) {
    let mut run = Run::new(task.scene, task.bodies, task.seed, broad_phase);
    for step in 0..task.steps {
        run.step();
        progress(step);
    }
    (outcome(&run, None), run.broad_phase.inner)
}

/// As [`run`], with rapier's own broad phase and the oracle beside the given one; stops at the first
/// difference, after writing the failing frames into `folder`. Times are without the checks.
pub fn run_checked<B: BroadPhase>(
    task: Task,
    broad_phase: B,
    relative_margin: f32,
    folder: &Path,
    mut progress: impl FnMut(usize),
) -> (Outcome, B) {
    let shadow = Shadowed::new(Timed::new(broad_phase), relative_margin);
    let mut run = Run::new(task.scene, task.bodies, task.seed, shadow);
    for step in 0..task.steps {
        run.step();
        leave_out_checks(&mut run);
        progress(step);
        if run.broad_phase.inner.first_difference().is_some() {
            break;
        }
    }
    let check = check(task, &run.broad_phase.inner, run.times.len(), folder);
    (outcome(&run, Some(check)), run.broad_phase.inner.inner.inner)
}

/// The last step's times as they would be without the shadow.
fn leave_out_checks<B: BroadPhase>(run: &mut Run<Shadowed<Timed<B>>>) {
    let own = milliseconds(run.broad_phase.inner.inner.take());
    if let Some(last) = run.times.last_mut() {
        last.step -= last.broad_phase - own;
        last.broad_phase = own;
    }
}

fn check<B>(task: Task, shadow: &Shadowed<B>, steps: usize, folder: &Path) -> Check {
    let checker = shadow.checker();
    let file = folder.join(format!("pbig-{}-{steps}-failed.npy", task.scene.name));
    let failed = !checker.differences.is_empty();
    Check {
        calls: checker.compared,
        oracle_pairs: checker.oracle_pairs,
        stock_only: checker.stock_only,
        differences: checker.differences.clone(),
        frames_file: failed.then(|| {
            let written = write_frames(&file, &checker.frames);
            written.map(|()| file).map_err(|error| error.to_string())
        }),
    }
}
