//! A scene that runs: its world, its broad phase and its times.

use crate::choice::Choice;
use crate::history::{History, MeasuredStep};
use pbig_scenes::exchange::Exchange;
use pbig_scenes::scenes::Scene;
use pbig_scenes::world::World;
use rapier_pbig::PbigBroadPhase;
use rapier3d::prelude::*;
use std::sync::LazyLock;
use std::time::Instant;

/// The scene, and how to build it.
#[derive(Clone, Copy)]
pub struct Setting {
    pub scene: Scene,
    pub bodies: usize,
    pub seed: u64,
}

impl Setting {
    pub fn build(&self) -> World {
        self.scene.build(self.bodies, self.seed)
    }

    /// Returns the same setting with the next scene of the list; after the last scene comes the first.
    pub fn next_scene(&self) -> Self {
        let at = Scene::ALL.iter().position(|scene| scene.name == self.scene.name).unwrap_or(0);
        Self { scene: Scene::ALL[(at + 1) % Scene::ALL.len()], ..*self }
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Ball {
    pub from: [f32; 3],
    /// The velocity at the start, in length units a second.
    pub velocity: [f32; 3],
    pub radius: f32,
}

/// The density of a thrown ball; scenes use 1. A heavy ball is not stopped by the first object.
const BALL_DENSITY: f32 = 8.0;

pub struct Simulation {
    /// The scene, and how to build it again.
    pub setting: Setting,
    pub world: World,
    pub choice: Choice,
    pub broad_phase: Exchange,
    pub history: History,
    pub steps: u64,
    /// True until the first step after a swap.
    is_swapped: bool,
}

impl Simulation {
    pub fn new(setting: Setting, choice: Choice) -> Self {
        let (world, broad_phase) = (setting.build(), Exchange::new(choice.pbig(), now_ms));
        let history = History::default();
        Self { setting, world, choice, broad_phase, history, steps: 0, is_swapped: false }
    }

    /// Makes one step of 1/60 s, and notes its times. Those of the first step after a swap are left out: a new broad phase sets
    /// up its tree, grid or device there.
    pub fn step(&mut self) {
        let start_ms = now_ms();
        self.world.step(&mut self.broad_phase);
        let step_ms = now_ms() - start_ms;
        let broad_phase_ms = self.broad_phase.take_spent_ms();
        self.steps += 1;
        if !std::mem::take(&mut self.is_swapped) {
            let (choice, swaps) = (self.choice, self.history.swaps());
            self.history.push(MeasuredStep { choice, swaps, broad_phase_ms, step_ms });
        }
    }

    pub fn reset(&mut self) {
        *self = Self::new(self.setting, self.choice);
    }

    /// Builds the next scene, with the same broad phase.
    pub fn next_scene(&mut self) {
        *self = Self::new(self.setting.next_scene(), self.choice);
    }

    /// Goes on with another broad phase. The world stays as it is. Does nothing if this one is in use.
    pub fn swap(&mut self, choice: Choice) {
        if choice == self.choice {
            return;
        }
        self.choice = choice;
        self.broad_phase.change(choice.pbig(), &self.world);
        self.history.count_swap();
        self.is_swapped = true;
    }

    /// Checks that the last step found its pairs.
    ///
    /// # Errors
    /// The number of the step, and the broad phase's reason.
    pub fn check(&self) -> Result<(), String> {
        let error = self.broad_phase.pbig().and_then(PbigBroadPhase::last_error);
        error.map_or(Ok(()), |error| Err(format!("step {}: {error}", self.steps)))
    }

    pub fn throw(&mut self, ball: Ball) {
        let body = RigidBodyBuilder::dynamic()
            .translation(ball.from.into())
            .linvel(ball.velocity.into())
            .ccd_enabled(true);
        self.world.add(body, ColliderBuilder::ball(ball.radius).density(BALL_DENSITY));
    }
}

/// Returns the milliseconds since its first call.
fn now_ms() -> f64 {
    static START: LazyLock<Instant> = LazyLock::new(Instant::now);
    START.elapsed().as_secs_f64() * 1e3
}

/// Returns pbig with a limit on the number of pairs, above which updates fail.
#[cfg(test)]
pub(crate) fn with_max_pairs(max_pairs: u64) -> Exchange {
    let config = rapier_pbig::PbigConfig { max_pairs, ..rapier_pbig::PbigConfig::DEFAULT };
    Exchange::new(PbigBroadPhase::with_config(config).ok(), now_ms)
}

#[cfg(test)]
mod tests;
