//! The broad phase in use, with its times. Another one can take its place between two steps.

use crate::choice::Choice;
use pbig_scenes::world::World;
use rapier_pbig::{Backend, Error, GpuFinder, PbigConfig, PbigFinder};
use rapier3d::prelude::BroadPhaseBvh;
use std::time::Duration;

/// pbig, for this version of rapier.
pub type Pbig = PbigFinder;

/// The broad phase that a world is stepped with. It always is rapier's, in which pbig may be installed.
pub struct Engine {
    choice: Choice,
    broad_phase: BroadPhaseBvh,
    /// Time inside since the last [`Engine::take_time`].
    time: Duration,
}

impl Engine {
    /// Creates a broad phase for a world that has not been stepped.
    pub fn new(choice: Choice) -> Self {
        let mut engine = Self { choice, broad_phase: BroadPhaseBvh::new(), time: Duration::ZERO };
        engine.install(choice);
        engine
    }

    /// Replaces the broad phase of a world that runs. The new one takes over boxes and pairs, so contacts stay warm.
    pub fn swap(&mut self, choice: Choice, _: &World) {
        self.choice = choice;
        self.install(choice);
        self.time = Duration::ZERO;
    }

    fn install(&mut self, choice: Choice) {
        match choice.backend() {
            None => rapier_pbig::uninstall(&mut self.broad_phase),
            Some(backend) => self.install_pbig(PbigConfig { backend, ..PbigConfig::DEFAULT }),
        }
    }

    fn install_pbig(&mut self, config: PbigConfig) {
        let pbig = match config.backend {
            Backend::Device => PbigFinder::with_gpu(config, GpuFinder::shared()),
            _ => PbigFinder::with_config(config),
        };
        let pbig = pbig.expect("the default margin is a length");
        rapier_pbig::install_finder(&mut self.broad_phase, pbig);
    }

    /// Makes one step of the world. The time inside the broad phase is rapier's own count.
    pub fn step(&mut self, world: &mut World) {
        world.step(&mut self.broad_phase);
        let counters = &world.pipeline.counters.cd;
        self.time += counters.broad_phase_time.time() + counters.final_broad_phase_time.time();
    }

    /// Returns the broad phase that was asked for.
    pub fn choice(&self) -> Choice {
        self.choice
    }

    /// Returns pbig, unless stock is in use.
    pub fn pbig(&self) -> Option<&Pbig> {
        rapier_pbig::finder(&self.broad_phase)
    }

    /// Returns the error of the last update. Stock has none.
    pub fn last_error(&self) -> Option<&Error> {
        self.pbig().and_then(Pbig::last_error)
    }

    /// Returns the numbers of `AddPair` and `DeletePair` events that pbig has sent since the last swap. With stock it returns
    /// `None`: rapier hands stock's events to its narrow phase inside a step, and does not expose them.
    pub fn events(&self) -> Option<[u64; 2]> {
        self.pbig().map(|pbig| [pbig.stats().totals.added, pbig.stats().totals.deleted])
    }

    /// Returns the time inside the broad phase since the last call.
    pub fn take_time(&mut self) -> Duration {
        std::mem::take(&mut self.time)
    }
}

#[cfg(test)]
impl Engine {
    /// Creates pbig with a limit on the number of pairs, above which updates fail.
    pub(crate) fn with_max_pairs(max_pairs: u64) -> Self {
        let mut engine = Self::new(Choice::Auto);
        engine.install_pbig(PbigConfig { max_pairs, ..PbigConfig::DEFAULT });
        engine
    }

    /// Makes one step of the world, and returns its collision events.
    pub(crate) fn step_with_events(&mut self, world: &mut World) -> Vec<rapier3d::prelude::CollisionEvent> {
        world.step_with_events(&mut self.broad_phase)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pbig_scenes::scenes::Scene;

    fn pairs(world: &World) -> u64 {
        (world.narrow_phase.contact_pairs().count() + world.narrow_phase.intersection_pairs().count()) as u64
    }

    /// Pbig's events turn the pairs at the swap into the pairs after any later step.
    #[test]
    fn each_swap_sends_only_the_pairs_that_differ() {
        let mut world = Scene::named("column").unwrap().build(300, 1);
        let mut engine = Engine::new(Choice::Stock);
        (0..15).for_each(|_| engine.step(&mut world));
        for choice in [Choice::Cpu, Choice::Brute, Choice::Cpu, Choice::Stock, Choice::Cpu] {
            let held = pairs(&world);
            engine.swap(choice, &world);
            for step in 1..=15 {
                engine.step(&mut world);
                let Some([added, deleted]) = engine.events() else { continue };
                assert_eq!(held + added - deleted, pairs(&world), "{choice:?}, step {step}");
                assert!(step > 1 || added < held, "{held} pairs are not announced again, but {added}");
            }
            let expected = choice != Choice::Stock;
            assert_eq!(engine.events().is_some_and(|[added, _]| added > 0), expected, "{choice:?}");
        }
    }
}
