//! A scene run with one broad phase, checked or not: what `pbig simulate` does.

use crate::files::write_frames;
use crate::runner::{Run, Spread, StepTime};
use crate::scenes::Scene;
use crate::shadow::{Difference, Fault, Shadow};
use rapier3d::prelude::BroadPhase;
use std::path::{Path, PathBuf};

/// What to simulate.
#[derive(Clone, Copy)]
pub struct Task {
    /// The scene.
    pub scene: Scene,
    /// How many bodies.
    pub bodies: usize,
    /// How many steps.
    pub steps: usize,
    /// For the random numbers of the scene.
    pub seed: u64,
}

/// What came of it.
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

/// What the shadow checker saw.
pub struct Check {
    /// Calls compared.
    pub calls: usize,
    /// Pairs of the oracle, in all calls.
    pub oracle_pairs: u64,
    /// Pairs that only stock reported, shown to be without contact.
    pub stock_only: u64,
    /// What was wrong.
    pub differences: Vec<Difference>,
    /// The boxes of the calls up to the failure, for `pbig replay`.
    pub frames_file: Option<PathBuf>,
}

impl Check {
    /// Pairs that should have been there and were not.
    pub fn missing(&self) -> usize {
        let missing = |d: &&Difference| matches!(d.fault, Fault::Missing | Fault::MissingContact);
        self.differences.iter().filter(missing).count()
    }
}

impl Outcome {
    /// Whether a check was made and failed.
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

/// As [`run`], with rapier's own broad phase and the oracle beside the given one; stops at the first difference, after writing the failing frames into `folder`.
///
/// # Errors
/// A message that names the file, when the frames cannot be written.
pub fn run_checked<B: BroadPhase>(
    task: Task,
    broad_phase: B,
    relative_margin: f32,
    folder: &Path,
    mut progress: impl FnMut(usize),
) -> Result<(Outcome, B), String> {
    let shadow = Shadow::new(broad_phase, relative_margin);
    let mut run = Run::new(task.scene, task.bodies, task.seed, shadow);
    for step in 0..task.steps {
        run.step();
        progress(step);
        if !run.broad_phase.inner.differences.is_empty() {
            break;
        }
    }
    let shadow = &run.broad_phase.inner;
    let failed = !shadow.differences.is_empty();
    let file = folder.join(format!("pbig-{}-{}-failed.npy", task.scene.name, run.times.len()));
    if failed {
        write_frames(&file, &shadow.frames)?;
    }
    let check = Check {
        calls: shadow.checked,
        oracle_pairs: shadow.oracle_pairs,
        stock_only: shadow.stock_only,
        differences: shadow.differences.clone(),
        frames_file: failed.then_some(file),
    };
    Ok((outcome(&run, Some(check)), run.broad_phase.inner.inner))
}
