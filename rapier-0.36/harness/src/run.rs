//! Runs a scene step by step and measures the broad phase, the whole step, and the scene queries after it.

use crate::queries::FrameQueries;
use crate::world::World;
use pbig_scenes::frames::FrameKind;
use pbig_scenes::scenes::Scene;
use rapier::prelude::BroadPhaseBvh;
use std::time::Instant;

/// Milliseconds of one frame: of its step by rapier's own counters, and of its queries.
#[derive(Clone, Copy, Debug, Default)]
pub struct StepTime {
    /// The search at the start of a step, and the AABBs that it passes on at its end.
    pub broad_phase: f64,
    /// The whole step.
    pub step: f64,
    /// The scene queries after the step, with the upkeep of an index that the first of them causes.
    pub queries: f64,
    /// The step and the queries.
    pub frame: f64,
}

/// A scene being run with one broad phase.
pub struct Run {
    /// The world.
    pub world: World,
    /// The broad phase.
    pub broad_phase: BroadPhaseBvh,
    /// One for each step so far.
    pub times: Vec<StepTime>,
    /// Hits of all queries so far.
    pub hits: u64,
    queries: Option<FrameQueries>,
}

impl Run {
    /// Builds the scene.
    pub fn new(scene: Scene, bodies: usize, seed: u64, broad_phase: BroadPhaseBvh) -> Self {
        let (world, times) = (World::of(&scene.plan(bodies, seed)), Vec::new());
        Self { world, broad_phase, times, hits: 0, queries: None }
    }

    /// Adds scene queries to each frame.
    pub fn with_queries(self, kind: FrameKind) -> Self {
        Self { queries: FrameQueries::new(kind, &self.world), ..self }
    }

    /// One frame, measured: a step, then the scene queries if there are any.
    pub fn step(&mut self) {
        let clock = Instant::now();
        self.world.step(&mut self.broad_phase);
        let step = clock.elapsed().as_secs_f64() * 1e3;
        let counters = &self.world.pipeline.counters.cd;
        let broad_phase = counters.broad_phase_time.time_ms() + counters.final_broad_phase_time.time_ms();
        let queries = self.ask();
        self.times.push(StepTime { broad_phase, step, queries, frame: step + queries });
    }

    /// Asks the queries of a frame, and returns their milliseconds.
    fn ask(&mut self) -> f64 {
        let Some(queries) = &mut self.queries else { return 0.0 };
        let clock = Instant::now();
        self.hits += queries.ask(&self.world, &self.broad_phase);
        clock.elapsed().as_secs_f64() * 1e3
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
