//! Runs a scene step by step and measures the broad phase, the whole step, and the scene queries after it.

use crate::build::world_of;
use crate::queries::FrameQueries;
use pbig_scenes::frames::FrameKind;
use pbig_scenes::scenes::Scene;
pub use pbig_scenes::times::{StepTime, Summary};
use rapier::prelude::{BroadPhaseBvh, PhysicsWorld};
use std::time::Instant;

/// A scene being run with one broad phase.
pub struct Run {
    pub world: PhysicsWorld,
    /// One for each step so far.
    pub times: Vec<StepTime>,
    /// Hits of all queries so far.
    pub hits: u64,
    queries: Option<FrameQueries>,
}

impl Run {
    pub fn new(scene: Scene, bodies: usize, seed: u64, broad_phase: BroadPhaseBvh) -> Self {
        let world = world_of(&scene.plan(bodies, seed), broad_phase);
        Self { world, times: Vec::new(), hits: 0, queries: None }
    }

    /// Adds scene queries to each frame.
    pub fn with_queries(self, kind: FrameKind) -> Self {
        Self { queries: FrameQueries::new(kind, &self.world), ..self }
    }

    /// One frame, measured: a step, then the scene queries if there are any.
    pub fn step(&mut self) {
        let clock = Instant::now();
        self.world.step();
        let step = clock.elapsed().as_secs_f64() * 1e3;
        let counters = &self.world.physics_pipeline.counters.cd;
        let broad_phase = counters.broad_phase_time.time_ms() + counters.final_broad_phase_time.time_ms();
        let queries = self.ask();
        self.times.push(StepTime { broad_phase, step, queries, frame: step + queries });
    }

    /// Asks the queries of a frame, and returns their milliseconds.
    fn ask(&mut self) -> f64 {
        let Some(queries) = &mut self.queries else { return 0.0 };
        let clock = Instant::now();
        self.hits += queries.ask(&self.world);
        clock.elapsed().as_secs_f64() * 1e3
    }

    /// Returns the pairs that the narrow phase has.
    pub fn pairs(&self) -> usize {
        let narrow_phase = &self.world.narrow_phase;
        narrow_phase.contact_pairs().count() + narrow_phase.intersection_pairs().count()
    }
}
