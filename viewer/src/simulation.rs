//! A scene that runs: its world, its broad phase and its times.

use crate::choice::Choice;
use crate::engine::Engine;
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
}

impl Simulation {
    /// Builds a scene.
    pub fn new(setting: Setting, choice: Choice) -> Self {
        let (world, engine) = (setting.build(), Engine::new(choice));
        Self { setting, world, engine, history: History::default(), steps: 0 }
    }

    /// Makes one step of 1/60 s, and notes its times.
    pub fn step(&mut self) {
        let clock = Instant::now();
        self.world.step(&mut self.engine);
        let step_ms = milliseconds(clock.elapsed());
        let broad_phase_ms = milliseconds(self.engine.take_time());
        self.history.push(StepTime { choice: self.engine.choice(), broad_phase_ms, step_ms });
        self.steps += 1;
    }

    /// Builds the same scene again, with the same broad phase.
    pub fn reset(&mut self) {
        *self = Self::new(self.setting, self.engine.choice());
    }

    /// Builds the next scene, with the same broad phase.
    pub fn next_scene(&mut self) {
        *self = Self::new(self.setting.next_scene(), self.engine.choice());
    }

    /// Goes on with another broad phase. The world stays as it is.
    pub fn swap(&mut self, choice: Choice) {
        self.engine.swap(choice, &self.world);
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
        self.world.pairs().count()
    }
}

/// Returns a duration in ms.
fn milliseconds(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

#[cfg(test)]
mod tests {
    use super::*;

    fn column(choice: Choice) -> Simulation {
        let scene = Scene::named("column").unwrap();
        Simulation::new(Setting { scene, bodies: 300, seed: 1 }, choice)
    }

    fn sleeping(simulation: &Simulation) -> usize {
        simulation.world.bodies.iter().filter(|(_, body)| body.is_sleeping()).count()
    }

    /// The pairs whose boxes overlap without a margin, by brute force. Every broad phase must report each of them.
    fn touching(world: &World) -> Vec<(ColliderHandle, ColliderHandle)> {
        let dynamic =
            |collider: &Collider| collider.parent().is_some_and(|body| world.bodies[body].is_dynamic());
        let boxes: Vec<_> =
            world.colliders.iter().map(|(handle, c)| (handle, c.compute_aabb(), dynamic(c))).collect();
        let mut pairs = Vec::new();
        for (i, (a, box_a, dynamic_a)) in boxes.iter().enumerate() {
            for (b, box_b, dynamic_b) in &boxes[i + 1..] {
                if (*dynamic_a || *dynamic_b) && box_a.intersects(box_b) {
                    pairs.push((*a, *b));
                }
            }
        }
        pairs
    }

    fn missing(simulation: &Simulation) -> usize {
        let world = &simulation.world;
        let is_known = |&(a, b): &(_, _)| world.narrow_phase.contact_pair(a, b).is_some();
        touching(world).iter().filter(|pair| !is_known(pair)).count()
    }

    #[test]
    fn the_world_goes_on_through_every_swap_and_no_pair_is_lost() {
        let mut simulation = column(Choice::Stock);
        let (mut choice, mut steps) = (Choice::Stock, 0);
        for _ in 0..7 {
            (0..15).for_each(|_| simulation.step());
            steps += 15;
            assert_eq!((simulation.steps, missing(&simulation)), (steps, 0), "with {choice:?}");
            assert!(!touching(&simulation.world).is_empty());
            choice = choice.next();
            simulation.swap(choice);
            assert_eq!(simulation.engine.choice(), choice);
            simulation.step();
            steps += 1;
            assert_eq!(missing(&simulation), 0, "in the step after the swap to {choice:?}");
        }
    }

    /// A new broad phase that nobody shows the world misses sleeping colliders: so the check above can fail.
    #[test]
    fn without_showing_the_world_pairs_are_lost() {
        let mut simulation = column(Choice::Cpu);
        (0..60).for_each(|_| simulation.step());
        simulation.world.narrow_phase = NarrowPhase::new();
        simulation.engine = Engine::new(Choice::Stock);
        simulation.step();
        assert!(missing(&simulation) > 0);
    }

    #[test]
    fn a_swap_wakes_nobody() {
        let scene = Scene::named("pile").unwrap();
        let mut simulation = Simulation::new(Setting { scene, bodies: 64, seed: 1 }, Choice::Cpu);
        (0..400).for_each(|_| simulation.step());
        let before = sleeping(&simulation);
        assert!(before > 0, "the pile is asleep");
        for choice in [Choice::Stock, Choice::Cpu, Choice::Stock] {
            simulation.swap(choice);
            simulation.step();
            assert_eq!(sleeping(&simulation), before, "after the swap to {choice:?}");
        }
    }

    /// A broad phase that reports nothing.
    struct Blind;

    impl BroadPhase for Blind {
        fn update(
            &mut self,
            _: &IntegrationParameters,
            _: &ColliderSet,
            _: &RigidBodySet,
            _: &[ColliderHandle],
            _: &[ColliderHandle],
            _: &mut Vec<BroadPhasePairEvent>,
        ) {
        }
    }

    #[test]
    fn a_swap_ends_pairs_that_ended_before() {
        for choice in [Choice::Stock, Choice::Cpu] {
            let mut simulation = column(Choice::Cpu);
            simulation.step();
            let (pairs, bodies) = (simulation.pairs(), simulation.world.bodies.len());
            for (i, (_, body)) in simulation.world.bodies.iter_mut().enumerate() {
                body.set_translation(vector![10.0 * i as f32, 1000.0, 0.0], true);
            }
            simulation.world.step(&mut Blind);
            assert!(simulation.pairs() == pairs && pairs > bodies);
            simulation.swap(choice);
            simulation.step();
            // The ground is endless, and pairs with each body.
            assert_eq!(simulation.pairs(), bodies, "{choice:?}");
        }
    }

    #[test]
    fn the_same_setting_gives_the_same_world_after_a_reset() {
        let mut simulation = column(Choice::Cpu);
        let start = simulation.world.pose_bits();
        simulation.step();
        let one_step = simulation.world.pose_bits();
        assert_ne!(start, one_step);
        simulation.reset();
        assert_eq!((simulation.steps, simulation.world.pose_bits()), (0, start));
        simulation.step();
        assert_eq!(simulation.world.pose_bits(), one_step);
    }

    #[test]
    fn every_scene_comes_in_turn() {
        let mut simulation = column(Choice::Cpu);
        let first = simulation.setting.scene.name;
        for _ in Scene::ALL {
            simulation.setting = simulation.setting.next_scene();
        }
        assert_eq!(simulation.setting.scene.name, first);
        simulation.next_scene();
        assert!(simulation.setting.scene.name != first && simulation.steps == 0);
    }

    #[test]
    fn a_thrown_ball_flies() {
        let mut simulation = column(Choice::Cpu);
        let before = simulation.world.bodies.len();
        simulation.throw(Ball { from: [-50.0, 3.0, 0.0], velocity: [60.0, 0.0, 0.0], radius: 1.0 });
        assert_eq!(simulation.world.bodies.len(), before + 1);
        simulation.step();
        let farthest =
            simulation.world.bodies.iter().map(|(_, body)| body.translation().x).fold(f32::MAX, f32::min);
        assert!((farthest + 49.0).abs() < 0.01, "{farthest}");
    }
}
