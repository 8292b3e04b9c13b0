//! A broad phase that reports what another one finds, with its events in another order. Rapier solves contacts in an order that
//! comes from the order of events.

use rapier_pbig::PbigBroadPhase;
use rapier3d::prelude::*;

/// A broad phase's name and constructor.
pub(super) type NamedBroadPhase = (&'static str, fn() -> Box<dyn BroadPhase>);

/// The broad phases of a run. `stock sorted` sorts events, as pbig does, and so differs from stock by order alone.
pub(super) const KINDS: [NamedBroadPhase; 3] = [
    ("pbig", || Box::new(PbigBroadPhase::new())),
    ("stock", || Box::new(DefaultBroadPhase::new())),
    ("stock sorted", || Box::new(Reordered(DefaultBroadPhase::new(), |events| events.sort_by_key(key)))),
];

/// A broad phase, and what is done to the events of each update.
pub(super) struct Reordered<B>(pub(super) B, pub(super) fn(&mut [BroadPhasePairEvent]));

impl<B: BroadPhase> BroadPhase for Reordered<B> {
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
        self.0.update(params, colliders, bodies, modified, removed, events);
        self.1(&mut events[before..]);
    }
}

/// Returns the order of pbig's events: ends before additions, each by the lower and then the higher index of its colliders.
fn key(event: &BroadPhasePairEvent) -> (bool, u32, u32) {
    let (is_added, [a, b]) = plain(event);
    (is_added, a.min(b), a.max(b))
}

/// Returns true for an addition, and the indices of the colliders.
fn plain(event: &BroadPhasePairEvent) -> (bool, [u32; 2]) {
    let (BroadPhasePairEvent::AddPair(pair) | BroadPhasePairEvent::DeletePair(pair)) = event;
    let indices = [pair.collider1, pair.collider2].map(|handle| handle.into_raw_parts().0);
    (matches!(event, BroadPhasePairEvent::AddPair(_)), indices)
}

#[cfg(test)]
mod tests {
    use super::*;
    use pbig_harness::boxes::{BoxSet, Movers};
    use pbig_harness::field::Field;
    use std::collections::BTreeSet;

    /// Returns the events of some updates.
    fn told(set: &str, mut broad_phase: impl BroadPhase) -> Vec<Vec<BroadPhasePairEvent>> {
        let mut field = Field::new(&BoxSet::named(set).expect("a set").boxes(200, 1));
        let movers = Movers::new(200, 0.3);
        let mut modified = field.colliders.clone();
        let mut update = |round: usize| {
            let mut events = vec![];
            field.call(&mut broad_phase, &modified, &mut events);
            modified = field.shift(&movers.of(round), 0.7);
            events
        };
        (0..9).map(&mut update).collect()
    }

    #[test]
    fn stock_sorted_tells_what_stock_tells_in_the_order_of_pbig() {
        let stock = told("unit", DefaultBroadPhase::new());
        let sorted = told("unit", Reordered(DefaultBroadPhase::new(), |events| events.sort_by_key(key)));
        let is_sorted =
            |all: &[Vec<BroadPhasePairEvent>]| all.iter().all(|events| events.is_sorted_by_key(key));
        assert!(!is_sorted(&stock) && is_sorted(&sorted) && is_sorted(&told("unit", PbigBroadPhase::new())));
        let plain = |events: &Vec<_>| events.iter().map(plain).collect::<BTreeSet<_>>();
        assert!(stock.iter().map(plain).eq(sorted.iter().map(plain)), "no event is lost or turned");
    }
}
