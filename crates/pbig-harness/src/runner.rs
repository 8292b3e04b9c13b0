//! Runs a scene step by step. Measures the broad phase and the whole step, and checks the pairs if asked to.

use crate::scenes::Scene;
use crate::world::World;
pub use pbig_scenes::times::{StepTime, Summary};
use rapier_pbig::shadow::{Call, Checker, Difference, ReplayError, Shadow, Watcher, write_frames};
use rapier3d::prelude::*;
use std::fmt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Any broad phase with a clock around it, and perhaps a checker beside it.
pub struct Timed<B> {
    pub inner: B,
    /// Time inside since the last [`Timed::take`].
    time: Duration,
    /// Time that the checker has taken in the present step.
    checking: Duration,
    pub added: u64,
    pub removed: u64,
    /// The checker, beside stock and the oracle.
    pub watcher: Option<Watcher>,
}

impl<B> Timed<B> {
    /// Starts at zero, without a checker.
    pub fn new(inner: B) -> Self {
        let (time, checking) = Default::default();
        Self { inner, time, checking, added: 0, removed: 0, watcher: None }
    }

    /// Adds a checker, which compares in one of `every` calls that modify something. `relative_margin` as in [`Watcher::new`].
    pub fn checked(self, relative_margin: f32, every: usize) -> Self {
        let checker = Checker::default().with(Shadow::Stock).with(Shadow::Oracle).every(every);
        Self { watcher: Some(Watcher::new(relative_margin, checker)), ..self }
    }

    /// Returns the checker's counts and differences.
    pub fn checker(&self) -> Option<&Checker> {
        self.watcher.as_ref().map(|watcher| &watcher.checker)
    }

    pub fn first_difference(&self) -> Option<&Difference> {
        self.checker()?.differences.first()
    }

    /// The time since the last call.
    pub fn take(&mut self) -> Duration {
        std::mem::take(&mut self.time)
    }
}

impl<B: BroadPhase> BroadPhase for Timed<B> {
    fn update(
        &mut self,
        params: &IntegrationParameters,
        colliders: &ColliderSet,
        bodies: &RigidBodySet,
        modified: &[ColliderHandle],
        removed: &[ColliderHandle],
        events: &mut Vec<BroadPhasePairEvent>,
    ) {
        let before = events.len();
        let clock = Instant::now();
        self.inner.update(params, colliders, bodies, modified, removed, events);
        self.time += clock.elapsed();
        let is_added = |event: &&BroadPhasePairEvent| matches!(event, BroadPhasePairEvent::AddPair(_));
        let added = events[before..].iter().filter(is_added).count();
        self.added += added as u64;
        self.removed += (events.len() - before - added) as u64;
        if let Some(watcher) = &mut self.watcher {
            let clock = Instant::now();
            watcher.watch(&Call { params, colliders, bodies, modified, removed }, &events[before..]);
            self.checking += clock.elapsed();
        }
    }
}

/// A scene being run with one broad phase.
pub struct Run<B> {
    pub world: World,
    pub broad_phase: Timed<B>,
    pub times: Vec<StepTime>,
}

impl<B: BroadPhase> Run<B> {
    pub fn new(scene: Scene, bodies: usize, seed: u64, broad_phase: B) -> Self {
        let world = scene.build(bodies, seed);
        Self { world, broad_phase: Timed::new(broad_phase), times: Vec::new() }
    }

    /// Adds a checker, see [`Timed::checked`].
    pub fn checked(self, relative_margin: f32, every: usize) -> Self {
        Self { broad_phase: self.broad_phase.checked(relative_margin, every), ..self }
    }

    /// Makes this number of steps, or fewer if one has a difference. Calls `progress` after each.
    pub fn steps(&mut self, steps: usize, mut progress: impl FnMut()) {
        for _ in 0..steps {
            self.step();
            progress();
            if self.broad_phase.first_difference().is_some() {
                break;
            }
        }
    }

    pub fn step(&mut self) {
        let clock = Instant::now();
        self.world.step(&mut self.broad_phase);
        let step = milliseconds(clock.elapsed() - std::mem::take(&mut self.broad_phase.checking));
        let broad_phase = milliseconds(self.broad_phase.take());
        self.times.push(StepTime { broad_phase, step, ..StepTime::default() });
    }

    /// Pairs that the narrow phase knows: edges of contacts and of intersections.
    pub fn pairs(&self) -> usize {
        self.world.pairs().count()
    }

    /// Writes the boxes of the calls up to the first difference into a folder, for `pbig replay`. Returns the file, or why it
    /// cannot be written; none without a difference.
    pub fn write_failure(&self, scene: &str, folder: &Path) -> Option<Result<PathBuf, ReplayError>> {
        self.broad_phase.first_difference()?;
        let file = folder.join(format!("pbig-{scene}-{}-failed.npy", self.times.len()));
        Some(write_frames(&file, &self.broad_phase.checker()?.frames).map(|()| file))
    }
}

pub fn milliseconds(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

/// Smallest, median and largest of some times.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Spread {
    pub min: f64,
    /// The median; of an even count, the upper of the two in the middle.
    pub median: f64,
    pub max: f64,
}

impl Spread {
    /// Summarizes any number of times; zeros for none.
    pub fn of(times: impl IntoIterator<Item = f64>) -> Self {
        let mut times: Vec<f64> = times.into_iter().collect();
        times.sort_unstable_by(f64::total_cmp);
        match times[..] {
            [] => Self::default(),
            [min, ..] => Self { min, median: times[times.len() / 2], max: times[times.len() - 1] },
        }
    }
}

impl fmt::Display for Spread {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.3} ms (median; {:.3} to {:.3})", self.median, self.min, self.max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spread_by_hand() {
        assert_eq!(Spread::of([3.0, 1.0, 2.0]), Spread { min: 1.0, median: 2.0, max: 3.0 });
        assert_eq!(Spread::of([]), Spread::default());
    }
}
