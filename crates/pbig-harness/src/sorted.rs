//! A broad phase that finds what another one finds and tells it in the order of ours.

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

/// Whether it is an addition, and the indices of the colliders.
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
    use crate::scenes::Scene;
    use crate::world::World;
    use rapier_pbig::PbigBroadPhase;

    /// Events of a whole run, update by update.
    fn told(mut broad_phase: impl BroadPhase, steps: usize) -> Vec<Vec<(bool, [u32; 2])>> {
        let World { params, mut colliders, bodies, .. } =
            Scene::named("column").expect("a scene").build(60, 1);
        let mut update = |step: usize| {
            let mut events = Vec::new();
            let handles: Vec<_> = colliders.iter().map(|(handle, _)| handle).collect();
            for (k, handle) in handles.iter().enumerate().filter(|(k, _)| (k + step).is_multiple_of(3)) {
                let shift = if (k + step / 3).is_multiple_of(2) { 0.7 } else { -0.7 };
                let at = *colliders[*handle].position();
                colliders[*handle].set_position(Translation::new(0.0, shift, 0.0) * at);
            }
            broad_phase.update(&params, &colliders, &bodies, &handles, &[], &mut events);
            events.iter().map(key).collect()
        };
        (0..steps).map(&mut update).collect()
    }

    #[test]
    fn stock_sorted_tells_what_stock_tells_in_the_order_of_ours() {
        let (stock, sorted) =
            (told(DefaultBroadPhase::new(), 20), told(Sorted(DefaultBroadPhase::new()), 20));
        let ours = told(PbigBroadPhase::new(), 20);
        assert!(stock.iter().any(|events| !events.is_sorted()), "there is something to sort");
        assert!(stock.iter().flatten().any(|event| event.0) && stock.iter().flatten().any(|event| !event.0));
        assert!(sorted.iter().chain(&ours).all(|events| events.is_sorted()));
        let in_order = |mut events: Vec<_>| {
            events.sort_unstable();
            events
        };
        assert_eq!(stock.into_iter().map(in_order).collect::<Vec<_>>(), sorted);
    }
}
