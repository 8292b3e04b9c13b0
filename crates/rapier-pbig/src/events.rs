//! Pairs of ids into rapier's events, in an order that is a function of the scene alone.

use crate::roll::Roll;
use pbig_core::{BroadPhase as Finder, Events, Pair};
use rapier3d::prelude::{BroadPhasePairEvent, ColliderHandle, ColliderPair};
use std::collections::HashSet;

/// Makes events.
#[derive(Clone, Debug, Default)]
pub(crate) struct Outbox {
    /// Pairs that the narrow phase had before this broad phase was there.
    pub(crate) adopted: Vec<ColliderPair>,
    /// By collider index: pairs before this call; only for the colliders in its events.
    before: Vec<u32>,
}

impl Outbox {
    /// Forgets adopted pairs of removed and disabled colliders, which the narrow phase drops itself.
    pub(crate) fn purge(&mut self, removed: &[ColliderHandle]) {
        if !removed.is_empty() && !self.adopted.is_empty() {
            let removed: HashSet<_> = removed.iter().copied().collect();
            let is_gone = |handle| removed.contains(&handle);
            self.adopted.retain(|pair| !is_gone(pair.collider1) && !is_gone(pair.collider2));
        }
    }

    /// The pair with the collider that has fewer pairs first, then the one with the lower index. Rapier looks for the edge of
    /// a pair by walking the pairs of the first collider: 30,000 balls that touch one ground take 17 ms in this order, 1.05 s
    /// with the ground first.
    pub(crate) fn pair(&self, pair: Pair, roll: &Roll, degree: impl Fn(u32) -> u32) -> ColliderPair {
        // Ids in the finder are on the roll.
        let handle = |id: u32| roll.handle(id).unwrap_or(ColliderHandle::invalid());
        let (a, b) = (handle(pair.a), handle(pair.b));
        if degree(pair.b) < degree(pair.a) { ColliderPair::new(b, a) } else { ColliderPair::new(a, b) }
    }

    /// Events that have led to what the finder has; returns how many pairs were added and deleted.
    pub(crate) fn send(
        &mut self,
        finder: &Finder,
        found: &Events,
        roll: &Roll,
        events: &mut Vec<BroadPhasePairEvent>,
    ) -> (usize, usize) {
        self.count_before(finder, found, roll.generations().len());
        let start = events.len();
        let before = |id: u32| self.before[id as usize];
        let deleted = found.removed.iter().map(|&pair| self.pair(pair, roll, before));
        events.extend(deleted.map(BroadPhasePairEvent::DeletePair));
        let known = self.known(roll);
        let holds = |pair| found.added.binary_search(&pair).is_ok();
        let ended = |pair: &&ColliderPair| !ids(pair, roll).is_some_and(holds);
        let ended = self.adopted.iter().filter(ended).copied();
        events.extend(ended.map(BroadPhasePairEvent::DeletePair));
        let deleted = events.len() - start;
        let new = found.added.iter().filter(|pair| !known.contains(pair));
        let added = new.map(|&pair| self.pair(pair, roll, |id| finder.degree(id)));
        events.extend(added.map(BroadPhasePairEvent::AddPair));
        self.adopted.clear();
        (events.len() - start - deleted, deleted)
    }

    /// A pair that has ended is ordered by the pairs that its colliders had before: a ground that has
    /// lost all of them must not come first.
    fn count_before(&mut self, finder: &Finder, found: &Events, ids: usize) {
        self.before.resize(ids, 0);
        let both = |pair: &Pair| [pair.a, pair.b];
        let touched = found.removed.iter().chain(&found.added).flat_map(both);
        touched.for_each(|id| self.before[id as usize] = finder.degree(id));
        found.removed.iter().flat_map(both).for_each(|id| self.before[id as usize] += 1);
        found.added.iter().flat_map(both).for_each(|id| self.before[id as usize] -= 1);
    }

    /// The adopted pairs of colliders that are there.
    fn known(&self, roll: &Roll) -> HashSet<Pair> {
        self.adopted.iter().filter_map(|pair| ids(pair, roll)).collect()
    }
}

fn ids(pair: &ColliderPair, roll: &Roll) -> Option<Pair> {
    let both = [pair.collider1, pair.collider2];
    let [a, b] = both.map(|handle| handle.into_raw_parts().0);
    both.iter().all(|&handle| roll.has(handle)).then(|| Pair::new(a, b))
}
