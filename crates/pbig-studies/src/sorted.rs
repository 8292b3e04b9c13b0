//! Broad phases that report what another one finds, with the events or the two colliders of each in another order.

use rapier3d::prelude::*;

/// Rapier solves contacts in an order that comes from that of the events: what is told here is what the broad phase
/// within tells, so that a run differs from that one's by order alone. As of ours, ends come before additions, each by
/// the lower and then the higher index of its colliders.
pub struct Sorted<B>(pub B);

impl<B: BroadPhase> BroadPhase for Sorted<B> {
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
        events[before..].sort_by_key(key);
    }
}

/// Names the collider with the lower index first in each pair, as rapier's own broad phase does. A run differs from one with
/// the broad phase within only by the order of contacts.
pub struct LowerFirst<B>(pub B);

impl<B: BroadPhase> BroadPhase for LowerFirst<B> {
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
        for event in &mut events[before..] {
            let (BroadPhasePairEvent::AddPair(pair) | BroadPhasePairEvent::DeletePair(pair)) = event;
            if pair.collider2.into_raw_parts() < pair.collider1.into_raw_parts() {
                *pair = pair.swap();
            }
        }
    }
}

/// Returns the sort key of an event: true for an addition, and the indices of the colliders.
fn key(event: &BroadPhasePairEvent) -> (bool, [u32; 2]) {
    let (is_added, pair) = match event {
        BroadPhasePairEvent::DeletePair(pair) => (false, pair),
        BroadPhasePairEvent::AddPair(pair) => (true, pair),
    };
    let mut indices = [pair.collider1, pair.collider2].map(|handle| handle.into_raw_parts().0);
    indices.sort_unstable();
    (is_added, indices)
}

#[cfg(test)]
mod tests {
    use super::*;
    use pbig_harness::scenes::Scene;
    use pbig_harness::world::World;
    use rapier_pbig::PbigBroadPhase;

    /// An event as it is told: whether it is an addition, and the colliders, the first first.
    fn plain(event: &BroadPhasePairEvent) -> (bool, [u32; 2]) {
        let (BroadPhasePairEvent::AddPair(pair) | BroadPhasePairEvent::DeletePair(pair)) = event;
        let indices = [pair.collider1, pair.collider2].map(|handle| handle.into_raw_parts().0);
        (matches!(event, BroadPhasePairEvent::AddPair(_)), indices)
    }

    /// Events of a whole run, update by update, after one that was there before.
    fn told(mut broad_phase: impl BroadPhase, steps: usize) -> Vec<Vec<(bool, [u32; 2])>> {
        let World { params, mut colliders, bodies, .. } =
            Scene::named("column").expect("a scene").build(60, 1);
        let mut update = |step: usize| {
            let handles: Vec<_> = colliders.iter().map(|(handle, _)| handle).collect();
            let mut events = vec![BroadPhasePairEvent::AddPair(ColliderPair::new(handles[9], handles[8]))];
            for (k, handle) in handles.iter().enumerate().filter(|(k, _)| (k + step).is_multiple_of(3)) {
                let shift = if (k + step / 3).is_multiple_of(2) { 0.7 } else { -0.7 };
                let at = *colliders[*handle].position();
                colliders[*handle].set_position(Translation::new(0.0, shift, 0.0) * at);
            }
            broad_phase.update(&params, &colliders, &bodies, &handles, &[], &mut events);
            events.iter().map(plain).collect()
        };
        (0..steps).map(&mut update).collect()
    }

    #[test]
    fn stock_sorted_tells_what_stock_tells_in_the_order_of_ours() {
        let (stock, sorted) =
            (told(DefaultBroadPhase::new(), 20), told(Sorted(DefaultBroadPhase::new()), 20));
        let ours = told(PbigBroadPhase::new(), 20);
        let has = |added: bool| stock.iter().flat_map(|events| &events[1..]).any(|event| event.0 == added);
        assert!(stock.iter().any(|events| !events[1..].is_sorted()) && has(true) && has(false));
        let key = |&(is_added, [a, b]): &(bool, [u32; 2])| (is_added, a.min(b), a.max(b));
        assert!(sorted.iter().chain(&ours).all(|events| events[1..].is_sorted_by_key(key)));
        for (mut stock, sorted) in stock.into_iter().zip(sorted) {
            stock[1..].sort_unstable();
            assert!(stock == sorted, "no event lost, turned or taken from another broad phase");
        }
    }
}
