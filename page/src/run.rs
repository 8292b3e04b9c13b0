//! A scene that runs, step by step.

use crate::broad_phase::{Choice, ExchangeableBroadPhase};
use crate::clock::now_ms;
use pbig_scenes::scenes::Scene;
use pbig_scenes::world::World;
use rapier3d::parry::bounding_volume::BoundingVolume;
use rapier3d::prelude::{Aabb, Collider, ColliderPair};

/// Milliseconds of one step.
#[derive(Clone, Copy, Debug, Default)]
pub struct StepTime {
    /// Time in the broad phase, over all its calls.
    pub broad_phase_ms: f64,
    /// Time of the whole step, the broad phase included.
    pub step_ms: f64,
}

/// A world and its broad phase.
pub struct Run {
    /// The world.
    pub world: World,
    broad_phase: ExchangeableBroadPhase,
    steps: u32,
}

impl Run {
    /// Builds a scene with about this many bodies.
    ///
    /// # Errors
    /// A text that lists the scenes if none has this name.
    pub fn new(scene: &str, bodies: usize, seed: u64, choice: Choice) -> Result<Self, String> {
        let world = Scene::named(scene)?.build(bodies, seed);
        Ok(Self { world, broad_phase: ExchangeableBroadPhase::new(choice), steps: 0 })
    }

    /// Advances the world by one step of rapier's length, 1/60 s.
    ///
    /// # Errors
    /// The text of pbig's error. Rapier has none.
    pub fn step(&mut self) -> Result<StepTime, String> {
        let start_ms = now_ms();
        self.world.step(&mut self.broad_phase);
        let step_ms = now_ms() - start_ms;
        self.steps += 1;
        let time = StepTime { broad_phase_ms: self.broad_phase.take_spent_ms(), step_ms };
        let error = self.broad_phase.pbig().and_then(|pbig| pbig.last_error());
        error.map_or(Ok(time), |error| Err(format!("step {}: {error}", self.steps)))
    }

    /// Changes the broad phase; the world goes on.
    pub fn change_broad_phase(&mut self, choice: Choice) {
        self.broad_phase.change(choice, &self.world);
    }

    /// Returns the number of steps so far.
    pub fn steps(&self) -> u32 {
        self.steps
    }

    /// Returns the number of pairs of the narrow phase, which are those that the broad phase reported.
    pub fn pair_count(&self) -> usize {
        let narrow_phase = &self.world.narrow_phase;
        let contacts = narrow_phase.contact_graph().raw_graph().raw_edges().len();
        contacts + narrow_phase.intersection_graph().raw_graph().raw_edges().len()
    }

    /// Returns pbig's algorithm in the last update and the reason for it; empty with rapier's own broad phase.
    pub fn plan(&self) -> String {
        self.broad_phase.pbig().map(|pbig| pbig.stats().report.plan.to_string()).unwrap_or_default()
    }

    /// Returns the broad phase's pairs as sorted pairs of collider indices, the lower index first. For stock, whose own list
    /// is private, these are the narrow phase's.
    pub fn pairs(&self) -> Vec<[u32; 2]> {
        let mut pairs: Vec<_> = match self.broad_phase.pbig() {
            Some(pbig) => pbig.pairs().map(indices).collect(),
            None => self.world.pairs().map(indices).collect(),
        };
        pairs.sort_unstable();
        pairs
    }

    /// Returns the centre and the half extents, in metres, of a box around the colliders that can move; of all colliders if
    /// none can.
    pub fn moving_box(&self) -> [f32; 6] {
        let World { bodies, colliders, .. } = &self.world;
        let can_move = |it: &Collider| {
            it.parent().and_then(|body| bodies.get(body)).is_some_and(|body| !body.is_fixed())
        };
        let is_bounded = |it: &Aabb| it.half_extents().max() < MAX_HALF_EXTENT;
        let around =
            |boxes: &mut dyn Iterator<Item = Aabb>| boxes.filter(is_bounded).reduce(|a, b| a.merged(&b));
        let all = || colliders.iter().map(|(_, it)| it);
        let moving = around(&mut all().filter(|it| can_move(it)).map(Collider::compute_aabb));
        let found = moving.or_else(|| around(&mut all().map(Collider::compute_aabb)));
        let (centre, half) =
            found.map_or_else(Default::default, |it| (it.center().coords, it.half_extents()));
        [centre.x, centre.y, centre.z, half.x, half.y, half.z]
    }
}

/// Half extents, in metres, above which an AABB is that of a half-space.
const MAX_HALF_EXTENT: f32 = 1e6;

fn indices(pair: ColliderPair) -> [u32; 2] {
    let mut both = [pair.collider1, pair.collider2].map(|handle| handle.into_raw_parts().0);
    both.sort_unstable();
    both
}
