//! Runs a scene step by step and measures the broad phase and the whole step.

use crate::scenes::Scene;
use crate::world::World;
use rapier3d::prelude::BroadPhaseBvh;
use std::time::Instant;

/// Milliseconds of one step, by rapier's own counters.
#[derive(Clone, Copy, Debug, Default)]
pub struct StepTime {
    /// The search at the start of a step, and the AABBs that it passes on at its end.
    pub broad_phase: f64,
    /// The whole step.
    pub step: f64,
}

/// A scene being run with one broad phase.
pub struct Run {
    /// The world.
    pub world: World,
    /// The broad phase.
    pub broad_phase: BroadPhaseBvh,
    /// One for each step so far.
    pub times: Vec<StepTime>,
}

impl Run {
    /// Builds the scene.
    pub fn new(scene: Scene, bodies: usize, seed: u64, broad_phase: BroadPhaseBvh) -> Self {
        Self { world: scene.build(bodies, seed), broad_phase, times: Vec::new() }
    }

    /// One step, measured.
    pub fn step(&mut self) {
        let clock = Instant::now();
        self.world.step(&mut self.broad_phase);
        let step = clock.elapsed().as_secs_f64() * 1e3;
        let counters = &self.world.pipeline.counters.cd;
        let broad_phase = counters.broad_phase_time.time_ms() + counters.final_broad_phase_time.time_ms();
        self.times.push(StepTime { broad_phase, step });
    }

    /// Returns the pairs that the narrow phase has.
    pub fn pairs(&self) -> usize {
        let narrow_phase = &self.world.narrow_phase;
        narrow_phase.contact_pairs().count() + narrow_phase.intersection_pairs().count()
    }
}

/// Mean, median and 99th percentile of some times, in ms; zeros for none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Summary {
    /// The mean.
    pub mean: f64,
    /// The time that half of them exceed.
    pub median: f64,
    /// The time that one in a hundred exceeds.
    pub p99: f64,
}

impl Summary {
    /// Summarizes times.
    pub fn of(times: impl IntoIterator<Item = f64>) -> Self {
        let mut times: Vec<f64> = times.into_iter().collect();
        times.sort_unstable_by(f64::total_cmp);
        let at = |percent: usize| times.get(times.len() * percent / 100).copied().unwrap_or_default();
        let mean = times.iter().sum::<f64>() / times.len().max(1) as f64;
        Self { mean, median: at(50), p99: at(99) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_summary_by_hand() {
        assert_eq!(Summary::of([3.0, 1.0, 2.0]), Summary { mean: 2.0, median: 2.0, p99: 3.0 });
        assert_eq!(Summary::of((0..200).map(f64::from)).p99, 198.0);
        assert_eq!(Summary::of([]), Summary::default());
    }
}
