//! The broad phase in use, with its times and counts. Another one can take its place between two steps.

use crate::choice::Choice;
use pbig_scenes::stock::StockBroadPhase;
use pbig_scenes::world::World;
use rapier_pbig::{Backend, Error, GpuFinder, PbigBroadPhase, PbigConfig};
use rapier3d::prelude::*;
use std::time::{Duration, Instant};

/// pbig, for this version of rapier.
pub type Pbig = PbigBroadPhase;

/// The broad phase that a world is stepped with.
pub struct Engine {
    choice: Choice,
    kind: Kind,
    /// Time inside since the last [`Engine::take_time`].
    time: Duration,
    added: u64,
    deleted: u64,
}

enum Kind {
    Stock(Box<StockBroadPhase>),
    Pbig(Box<Pbig>),
}

impl Kind {
    fn pbig(config: PbigConfig) -> Self {
        let mut pbig = Pbig::with_config(config).expect("the default margin is a length");
        if config.backend == Backend::Device {
            pbig.set_device(Box::new(GpuFinder::shared()));
        }
        Self::Pbig(Box::new(pbig))
    }
}

impl Engine {
    /// Creates a broad phase for a world that has not been stepped.
    pub fn new(choice: Choice) -> Self {
        let kind = match choice.backend() {
            None => Kind::Stock(Box::default()),
            Some(backend) => Kind::pbig(PbigConfig { backend, ..PbigConfig::DEFAULT }),
        };
        Self { choice, kind, time: Duration::ZERO, added: 0, deleted: 0 }
    }

    /// Replaces the broad phase of a world that runs. The narrow phase keeps its pairs, so contacts stay warm.
    pub fn swap(&mut self, choice: Choice, world: &World) {
        let mut next = Self::new(choice);
        match &mut next.kind {
            Kind::Stock(stock) => **stock = StockBroadPhase::adopt(world),
            Kind::Pbig(pbig) => pbig.adopt(&world.narrow_phase),
        }
        (next.added, next.deleted) = (self.added, self.deleted);
        *self = next;
    }

    /// Makes one step of the world.
    pub fn step(&mut self, world: &mut World) {
        world.step(self);
    }

    /// Returns the broad phase that was asked for.
    pub fn choice(&self) -> Choice {
        self.choice
    }

    /// Returns pbig, unless stock is in use.
    pub fn pbig(&self) -> Option<&Pbig> {
        match &self.kind {
            Kind::Stock(_) => None,
            Kind::Pbig(pbig) => Some(pbig),
        }
    }

    /// Returns the error of the last update. Stock has none.
    pub fn last_error(&self) -> Option<&Error> {
        self.pbig().and_then(Pbig::last_error)
    }

    /// Returns the numbers of `AddPair` and `DeletePair` events since the engine was created, across all swaps. The viewer on
    /// rapier 0.36 returns `None` for stock, whose events rapier keeps private there.
    pub fn events(&self) -> Option<[u64; 2]> {
        Some([self.added, self.deleted])
    }

    /// Returns the time inside the broad phase since the last call.
    pub fn take_time(&mut self) -> Duration {
        std::mem::take(&mut self.time)
    }
}

impl BroadPhase for Engine {
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
        let broad_phase: &mut dyn BroadPhase = match &mut self.kind {
            Kind::Stock(stock) => &mut **stock,
            Kind::Pbig(pbig) => &mut **pbig,
        };
        let clock = Instant::now();
        broad_phase.update(params, colliders, bodies, modified, removed, events);
        self.time += clock.elapsed();
        let is_added = |event: &&BroadPhasePairEvent| matches!(event, BroadPhasePairEvent::AddPair(_));
        let added = events[before..].iter().filter(is_added).count();
        self.added += added as u64;
        self.deleted += (events.len() - before - added) as u64;
    }
}

#[cfg(test)]
impl Engine {
    /// Creates pbig with a limit on the number of pairs, above which updates fail.
    pub(crate) fn with_max_pairs(max_pairs: u64) -> Self {
        let kind = Kind::pbig(PbigConfig { max_pairs, ..PbigConfig::DEFAULT });
        Self { kind, ..Self::new(Choice::Auto) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pbig_scenes::scenes::Scene;

    #[test]
    fn each_swap_sends_only_the_pairs_that_differ() {
        let mut world = Scene::named("column").unwrap().build(300, 1);
        let mut engine = Engine::new(Choice::Cpu);
        for choice in [Choice::Stock, Choice::Cpu, Choice::Stock, Choice::Brute, Choice::Cpu] {
            (0..15).for_each(|_| engine.step(&mut world));
            let before = engine.added;
            engine.swap(choice, &world);
            engine.step(&mut world);
            let pairs = world.pairs().count() as u64;
            assert_eq!(engine.added - engine.deleted, pairs, "after the swap to {choice:?}");
            assert!(engine.added - before < pairs, "{pairs} pairs are not announced again");
        }
    }
}
