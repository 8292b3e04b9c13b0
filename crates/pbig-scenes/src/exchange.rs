//! A broad phase that changes between rapier's own and pbig's while a world runs, with a clock around it.

use crate::stock::StockBroadPhase;
use crate::world::World;
use rapier_pbig::PbigBroadPhase;
use rapier3d::prelude::*;

enum Inner {
    Stock(Box<StockBroadPhase>),
    Pbig(Box<PbigBroadPhase>),
}

/// The broad phase in use, the time spent in it, and its events.
pub struct Exchange {
    inner: Inner,
    now_ms: fn() -> f64,
    spent_ms: f64,
    added: u64,
    deleted: u64,
}

impl Exchange {
    /// Takes a broad phase for a world that has not stepped yet: pbig's, or rapier's own for `None`. `now_ms` is a clock, in
    /// milliseconds.
    pub fn new(pbig: Option<PbigBroadPhase>, now_ms: fn() -> f64) -> Self {
        let inner = pbig.map_or_else(|| Inner::Stock(Box::default()), |pbig| Inner::Pbig(Box::new(pbig)));
        Self { inner, now_ms, spent_ms: 0.0, added: 0, deleted: 0 }
    }

    /// Changes the broad phase of a running world. The narrow phase keeps its pairs, and sleeping bodies stay asleep.
    pub fn change(&mut self, pbig: Option<PbigBroadPhase>, world: &World) {
        self.inner = match pbig {
            None => Inner::Stock(Box::new(StockBroadPhase::adopt(world))),
            Some(mut pbig) => {
                pbig.adopt(&world.narrow_phase);
                Inner::Pbig(Box::new(pbig))
            }
        };
    }

    pub fn pbig(&self) -> Option<&PbigBroadPhase> {
        match &self.inner {
            Inner::Stock(_) => None,
            Inner::Pbig(pbig) => Some(pbig),
        }
    }

    /// Returns the milliseconds spent in updates since the last call.
    pub fn take_spent_ms(&mut self) -> f64 {
        std::mem::take(&mut self.spent_ms)
    }

    /// Returns the numbers of `AddPair` and `DeletePair` events so far, across all changes.
    pub fn events(&self) -> [u64; 2] {
        [self.added, self.deleted]
    }
}

impl BroadPhase for Exchange {
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
        let inner: &mut dyn BroadPhase = match &mut self.inner {
            Inner::Stock(stock) => &mut **stock,
            Inner::Pbig(pbig) => &mut **pbig,
        };
        let start_ms = (self.now_ms)();
        inner.update(params, colliders, bodies, modified, removed, events);
        self.spent_ms += (self.now_ms)() - start_ms;
        let is_added = |event: &&BroadPhasePairEvent| matches!(event, BroadPhasePairEvent::AddPair(_));
        let added = events[before..].iter().filter(is_added).count();
        self.added += added as u64;
        self.deleted += (events.len() - before - added) as u64;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenes::Scene;

    #[test]
    fn each_change_sends_only_the_pairs_that_differ() {
        let mut world = Scene::named("column").expect("the scene exists").build(300, 1);
        let pbig = || Some(PbigBroadPhase::new());
        let mut exchange = Exchange::new(pbig(), || 0.0);
        for next in [None, pbig(), None, pbig()] {
            (0..15).for_each(|_| world.step(&mut exchange));
            let before = exchange.added;
            exchange.change(next, &world);
            world.step(&mut exchange);
            let pairs = world.pairs().count() as u64;
            assert_eq!(exchange.added - exchange.deleted, pairs);
            assert!(exchange.added - before < pairs, "{pairs} pairs are not announced again");
        }
    }

    /// Bodies sleep on as in a world whose broad phase stays.
    #[test]
    fn a_change_wakes_no_body() {
        let build = || Scene::named("sleeping").expect("the scene exists").build(150, 1);
        let sleepers = |world: &World| -> Vec<_> {
            let asleep = world.bodies.iter().filter(|(_, body)| body.is_sleeping());
            asleep.map(|(handle, _)| handle).collect()
        };
        let (mut changed, mut exchange) = (build(), Exchange::new(Some(PbigBroadPhase::new()), || 0.0));
        let (mut other, mut stock) = (build(), StockBroadPhase::default());
        for step in 0..25 {
            match step {
                10 | 20 => exchange.change(None, &changed),
                15 => exchange.change(Some(PbigBroadPhase::new()), &changed),
                _ => {}
            }
            changed.step(&mut exchange);
            other.step(&mut stock);
            let [left, expected] = [&changed, &other].map(sleepers);
            assert!(step < 10 || expected.len() > 100, "step {step}: too few sleep: {}", expected.len());
            assert!(step < 10 || left == expected, "step {step}: {} of {}", left.len(), expected.len());
        }
    }
}
