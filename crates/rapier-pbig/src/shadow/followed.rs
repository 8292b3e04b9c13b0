//! Follows events and keeps the pairs that the narrow phase has after them.

use super::{Fault, HandlePair, ordered};
use rapier3d::prelude::*;
use std::collections::HashSet;

#[derive(Clone, Default)]
pub(super) struct Followed(pub(super) HashSet<HandlePair>);

impl Followed {
    pub(super) fn of(pairs: impl IntoIterator<Item = ColliderPair>) -> Self {
        Self(pairs.into_iter().map(|pair| ordered(pair.collider1, pair.collider2)).collect())
    }

    /// Drops the pairs of removed and disabled colliders, as the narrow phase does by itself.
    pub(super) fn purge(&mut self, removed: &[ColliderHandle]) {
        if !removed.is_empty() {
            let gone: HashSet<_> = removed.iter().collect();
            self.0.retain(|(a, b)| !gone.contains(a) && !gone.contains(b));
        }
    }

    pub(super) fn follow(
        &mut self,
        events: &[BroadPhasePairEvent],
        mut fault: impl FnMut(Fault, HandlePair),
    ) {
        let mut deleted = HashSet::new();
        for event in events {
            let (pair, added) = match event {
                BroadPhasePairEvent::AddPair(pair) => (pair, true),
                BroadPhasePairEvent::DeletePair(pair) => (pair, false),
            };
            let pair = ordered(pair.collider1, pair.collider2);
            if pair.0 == pair.1 {
                fault(Fault::WithItself, pair);
            } else if added && !self.0.insert(pair) {
                fault(Fault::AddedTwice, pair);
            } else if !added && !self.0.remove(&pair) {
                fault(Fault::DeletedUnknown, pair);
            }
            if !added {
                deleted.insert(pair);
            } else if deleted.contains(&pair) {
                fault(Fault::Flickered, pair);
            }
        }
    }
}
