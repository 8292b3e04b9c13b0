//! Follows events and keeps the pairs that the narrow phase has after them.

use super::Fault;
use crate::{Handle, HandlePair, PairEvent};
use std::collections::HashSet;

#[derive(Clone, Default)]
pub(super) struct Followed(pub(super) HashSet<HandlePair>);

impl Followed {
    pub(super) fn of(pairs: impl IntoIterator<Item = HandlePair>) -> Self {
        Self(pairs.into_iter().map(|pair| HandlePair::sorted(pair.0, pair.1)).collect())
    }

    /// Drops the pairs of removed and disabled colliders, as the narrow phase does by itself.
    pub(super) fn purge(&mut self, removed: &[Handle]) {
        if !removed.is_empty() {
            let gone: HashSet<_> = removed.iter().collect();
            self.0.retain(|HandlePair(a, b)| !gone.contains(a) && !gone.contains(b));
        }
    }

    pub(super) fn follow(&mut self, events: &[PairEvent], mut fault: impl FnMut(Fault, HandlePair)) {
        let mut deleted = HashSet::new();
        for event in events {
            let (pair, added) = match event {
                PairEvent::Add(pair) => (pair, true),
                PairEvent::Delete(pair) => (pair, false),
            };
            let pair = HandlePair::sorted(pair.0, pair.1);
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
