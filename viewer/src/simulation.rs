//! A scene that runs: its world, its broad phase and its times.

use crate::choice::Choice;
use crate::engine::Engine;
use crate::error::Error;
use crate::history::{History, StepTime};
use pbig_scenes::scenes::Scene;
use pbig_scenes::world::World;
use rapier3d::prelude::*;
use std::time::{Duration, Instant};

/// The scene, and how to build it.
#[derive(Clone, Copy)]
pub struct Setting {
    /// The scene.
    pub scene: Scene,
    /// The number of bodies that the scene is built for.
    pub bodies: usize,
    /// The seed of the scene's random numbers.
    pub seed: u64,
}

impl Setting {
    /// Builds the world.
    pub fn build(&self) -> World {
        self.scene.build(self.bodies, self.seed)
    }

    /// Returns the same setting with the next scene of the list; after the last scene comes the first.
    pub fn next_scene(&self) -> Self {
        let at = Scene::ALL.iter().position(|scene| scene.name == self.scene.name).unwrap_or(0);
        Self { scene: Scene::ALL[(at + 1) % Scene::ALL.len()], ..*self }
    }
}

/// A ball to throw.
#[derive(Clone, Copy, Debug)]
pub struct Ball {
    /// The centre at the start.
    pub from: [f32; 3],
    /// The velocity at the start, in length units a second.
    pub velocity: [f32; 3],
    /// The radius.
    pub radius: f32,
}

/// The density of a thrown ball; scenes use 1. A heavy ball is not stopped by the first object.
const BALL_DENSITY: f32 = 8.0;

/// A scene that runs.
pub struct Simulation {
    /// The scene, and how to build it again.
    pub setting: Setting,
    /// Rapier's world.
    pub world: World,
    /// The broad phase.
    pub engine: Engine,
    /// The last steps' times.
    pub history: History,
    /// Steps since the world was built.
    pub steps: u64,
    /// True until the first step after a swap.
    is_swapped: bool,
}

impl Simulation {
    /// Builds a scene.
    pub fn new(setting: Setting, choice: Choice) -> Self {
        let (world, engine) = (setting.build(), Engine::new(choice));
        Self { setting, world, engine, history: History::default(), steps: 0, is_swapped: false }
    }

    /// Makes one step of 1/60 s, and notes its times. Those of the first step after a swap are left out: a new broad phase sets
    /// up its tree, grid or device there.
    pub fn step(&mut self) {
        let clock = Instant::now();
        self.engine.step(&mut self.world);
        let step_ms = milliseconds(clock.elapsed());
        let broad_phase_ms = milliseconds(self.engine.take_time());
        self.steps += 1;
        if !std::mem::take(&mut self.is_swapped) {
            let (choice, swaps) = (self.engine.choice(), self.history.swaps());
            self.history.push(StepTime { choice, swaps, broad_phase_ms, step_ms });
        }
    }

    /// Builds the same scene again, with the same broad phase.
    pub fn reset(&mut self) {
        *self = Self::new(self.setting, self.engine.choice());
    }

    /// Builds the next scene, with the same broad phase.
    pub fn next_scene(&mut self) {
        *self = Self::new(self.setting.next_scene(), self.engine.choice());
    }

    /// Goes on with another broad phase. The world stays as it is. Does nothing if this one is in use.
    pub fn swap(&mut self, choice: Choice) {
        if choice == self.engine.choice() {
            return;
        }
        self.engine.swap(choice, &self.world);
        self.history.count_swap();
        self.is_swapped = true;
    }

    /// Checks that the last step found its pairs.
    ///
    /// # Errors
    /// [`Error::Step`] with the broad phase's reason.
    pub fn check(&self) -> Result<(), Error> {
        let error = self.engine.last_error();
        error.map_or(Ok(()), |error| Err(Error::Step(self.steps, error.to_string())))
    }

    /// Throws a heavy ball into the world.
    pub fn throw(&mut self, ball: Ball) {
        let body = RigidBodyBuilder::dynamic()
            .translation(ball.from.into())
            .linvel(ball.velocity.into())
            .ccd_enabled(true);
        self.world.add(body, ColliderBuilder::ball(ball.radius).density(BALL_DENSITY));
    }

    /// Returns the number of pairs that the narrow phase knows.
    pub fn pairs(&self) -> usize {
        let narrow_phase = &self.world.narrow_phase;
        let contacts = narrow_phase.contact_graph().raw_graph().raw_edges().len();
        contacts + narrow_phase.intersection_graph().raw_graph().raw_edges().len()
    }
}

/// Returns a duration in ms.
fn milliseconds(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

#[cfg(test)]
mod events;
#[cfg(test)]
mod tests;
