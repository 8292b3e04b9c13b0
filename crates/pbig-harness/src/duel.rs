//! Both broad phases in one world, frame by frame.

use crate::bench::{Effort, mean_of_medians, timed};
use crate::frames::FrameKind;
use crate::queries::FrameQueries;
use crate::runner::{Timed, milliseconds};
use crate::scenes::Scene;
use crate::world::World;
use rapier_pbig::PbigBroadPhase;
use rapier3d::prelude::*;
use std::time::{Duration, Instant};

/// Maximum duration of a step: a longer one ends the measurement of its scene.
const LONGEST: Duration = Duration::from_secs(5);

/// Both broad phases in one world, in turn. They see the same boxes in every step. The first finds the caches as the rest of the
/// step left them, the second as the first left them. The world gets our events.
struct Both {
    ours: Timed<PbigBroadPhase>,
    stock: Timed<DefaultBroadPhase>,
    ours_first: bool,
    discarded: Vec<BroadPhasePairEvent>,
}

impl BroadPhase for Both {
    fn update(
        &mut self,
        params: &IntegrationParameters,
        colliders: &ColliderSet,
        bodies: &RigidBodySet,
        modified: &[ColliderHandle],
        removed: &[ColliderHandle],
        events: &mut Vec<BroadPhasePairEvent>,
    ) {
        let Self { ours, stock, ours_first, discarded } = self;
        discarded.clear();
        let mut turns: [(&mut dyn BroadPhase, _); 2] = [(ours, events), (stock, discarded)];
        turns.rotate_left(usize::from(!*ours_first));
        for (side, events) in turns {
            side.update(params, colliders, bodies, modified, removed, events);
        }
    }
}

/// A scene in which ours drives the world, and stock is called beside it.
pub struct Duel {
    /// The world.
    pub world: World,
    both: Both,
    /// Ours and stock's milliseconds, by step, with those of scene queries; in even steps ours is called first.
    pub times: Vec<[f64; 2]>,
    /// Hits of all queries so far, of ours and of stock.
    pub hits: [u64; 2],
    queries: Option<[FrameQueries; 2]>,
    too_long: bool,
}

impl Duel {
    /// Runs a scene for as many steps as the effort allows, with scene queries after each.
    pub fn run(scene: Scene, bodies: usize, kind: FrameKind, effort: Effort) -> Self {
        let (ours, stock) = (Timed::new(PbigBroadPhase::new()), Timed::new(DefaultBroadPhase::new()));
        let both = Both { ours, stock, ours_first: false, discarded: vec![] };
        let world = scene.build(bodies, 1);
        let queries =
            FrameQueries::new(kind, &world).zip(FrameQueries::new(kind, &world)).map(<[_; 2]>::from);
        let mut duel = Self { world, both, times: vec![], hits: [0; 2], queries, too_long: false };
        let start = Instant::now();
        while !duel.is_done(effort, start.elapsed()) {
            duel.step();
        }
        duel
    }

    fn step(&mut self) {
        let both = &mut self.both;
        both.ours_first = self.times.len().is_multiple_of(2);
        let clock = Instant::now();
        self.world.step(both);
        self.too_long = clock.elapsed() > LONGEST;
        let updates = [both.ours.take(), both.stock.take()].map(milliseconds);
        let queries = self.ask();
        self.times.push([0, 1].map(|side| updates[side] + queries[side]));
    }

    /// Asks both sides the queries of a frame, and returns their milliseconds. The side that was updated first is asked first.
    fn ask(&mut self) -> [f64; 2] {
        let Self {
            world,
            both: Both { ours, stock, ours_first, .. },
            queries,
            hits: [our_hits, stock_hits],
            ..
        } = self;
        let Some([to_ours, to_stock]) = queries else { return [0.0; 2] };
        let mut ours = || timed(|| *our_hits += to_ours.ask(world, &ours.inner)).1;
        let mut stock = || timed(|| *stock_hits += to_stock.ask(world, &stock.inner)).1;
        if *ours_first {
            return [ours(), stock()];
        }
        let stock = stock();
        [ours(), stock]
    }

    fn is_done(&self, effort: Effort, elapsed: Duration) -> bool {
        let counted = self.times.len().saturating_sub(effort.warm_up);
        counted >= effort.rounds
            || (counted >= 6 && elapsed > effort.budget)
            || (counted >= 2 && self.too_long)
    }

    /// Returns the pairs that ours has now.
    pub fn pairs(&self) -> u64 {
        self.both.ours.inner.pair_count() as u64
    }

    /// Returns the median of ours and of stock from a step on: the mean of the medians of even and odd steps.
    pub fn medians(&self, from: usize) -> [f64; 2] {
        [0, 1].map(|side| {
            let of = |parity: usize| -> Vec<f64> {
                let steps = self.times.iter().enumerate().skip(from);
                steps.filter(|(step, _)| step % 2 == parity).map(|(_, ms)| ms[side]).collect()
            };
            mean_of_medians([of(0), of(1)].iter().map(Vec::as_slice))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_sides_answer_the_queries_that_there_are() {
        let effort = Effort { warm_up: 0, rounds: 8, budget: Duration::MAX };
        let hits = |kind| {
            let duel = Duel::run(Scene::named("column").expect("the scene exists"), 60, kind, effort);
            assert_eq!(duel.times.len(), 8);
            duel.hits
        };
        assert_eq!(hits(FrameKind::None), [0; 2]);
        assert!(hits(FrameKind::Rays100).into_iter().all(|hits| hits > 0));
    }
}
