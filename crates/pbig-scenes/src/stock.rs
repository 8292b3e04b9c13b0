//! Rapier's own broad phase, which can take over a running world.

use crate::world::World;
use rapier3d::prelude::*;
use std::collections::HashSet;

/// Rapier's own broad phase. It can replace another one between two steps.
#[derive(Default)]
pub struct StockBroadPhase {
    inner: DefaultBroadPhase,
    /// Events of a takeover, which the next update sends.
    pending: Vec<BroadPhasePairEvent>,
}

impl StockBroadPhase {
    /// Takes over a world that another broad phase has served so far. The narrow phase keeps its pairs, so contacts stay warm,
    /// and sleeping bodies stay asleep. The next update sends only the pairs that differ.
    pub fn adopt(world: &World) -> Self {
        let colliders = marked_colliders(world);
        let all: Vec<_> = colliders.iter_enabled().map(|(handle, _)| handle).collect();
        let (mut inner, mut additions) = (DefaultBroadPhase::default(), Vec::new());
        inner.update(&world.params, &colliders, &world.bodies, &all, &[], &mut additions);
        Self { inner, pending: differences(world, &additions) }
    }
}

impl BroadPhase for StockBroadPhase {
    fn update(
        &mut self,
        params: &IntegrationParameters,
        colliders: &ColliderSet,
        bodies: &RigidBodySet,
        modified: &[ColliderHandle],
        removed: &[ColliderHandle],
        events: &mut Vec<BroadPhasePairEvent>,
    ) {
        events.append(&mut self.pending);
        self.inner.update(params, colliders, bodies, modified, removed, events);
    }
}

/// Returns a copy of a world's colliders, all marked as moved: stock skips the others. Rapier wakes the bodies of colliders that
/// are marked in the world itself.
fn marked_colliders(world: &World) -> ColliderSet {
    let mut colliders = world.colliders.clone();
    for (_, collider) in colliders.iter_mut() {
        collider.set_position(*collider.position());
    }
    colliders
}

/// Returns the additions that the narrow phase lacks, and the ends of its pairs that are not among the additions. The narrow
/// phase would skip an addition of a pair that it has, but a count of events would not.
fn differences(world: &World, additions: &[BroadPhasePairEvent]) -> Vec<BroadPhasePairEvent> {
    let held: HashSet<_> = world.pairs().map(sorted).collect();
    let added: HashSet<_> = additions.iter().filter_map(added_pair).map(sorted).collect();
    let is_new = |pair: &ColliderPair| !held.contains(&sorted(*pair));
    let new = additions.iter().filter_map(added_pair).filter(is_new);
    let ended = world.pairs().filter(|pair| !added.contains(&sorted(*pair)));
    new.map(BroadPhasePairEvent::AddPair).chain(ended.map(BroadPhasePairEvent::DeletePair)).collect()
}

fn added_pair(event: &BroadPhasePairEvent) -> Option<ColliderPair> {
    match event {
        BroadPhasePairEvent::AddPair(pair) => Some(*pair),
        BroadPhasePairEvent::DeletePair(_) => None,
    }
}

/// Returns the raw handles of a pair, the lower first.
fn sorted(pair: ColliderPair) -> [(u32, u32); 2] {
    let mut handles = [pair.collider1, pair.collider2].map(ColliderHandle::into_raw_parts);
    handles.sort_unstable();
    handles
}

#[cfg(test)]
mod tests;
