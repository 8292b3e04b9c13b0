//! Turns pairs of ids into events, in an order that depends on the scene alone.

use crate::order::PairOrder;
use crate::registry::ColliderRegistry;
use crate::{Handle, HandlePair};
use pbig_core::{Events, Pair};
use std::collections::HashSet;

/// An event for rapier's narrow phase.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PairEvent {
    /// The pair is new.
    Add(HandlePair),
    /// The pair has ended.
    Delete(HandlePair),
}

/// Writes events, and keeps the pairs that the narrow phase had before this broad phase took over.
#[derive(Clone, Debug, Default)]
pub(crate) struct EventWriter {
    pub(crate) adopted: Vec<HandlePair>,
    pub(crate) order: PairOrder,
    /// Adopted pairs end in the order in which they were handed over, not in that of [`PairOrder`].
    pub(crate) keeps_order: bool,
}

impl EventWriter {
    /// Starts with the pairs that another broad phase has reported, perhaps in the order of its events.
    pub(crate) fn adopt(&mut self, pairs: Vec<HandlePair>, keeps_order: bool) {
        *self = Self { adopted: pairs, keeps_order, order: PairOrder::default() };
    }

    /// Forgets adopted pairs of removed and disabled colliders, which the narrow phase drops itself.
    pub(crate) fn forget_adopted(&mut self, removed: impl Iterator<Item = Handle>) {
        if !self.adopted.is_empty() || self.order.has_adopted() {
            let removed: HashSet<_> = removed.collect();
            if removed.is_empty() {
                return;
            }
            self.adopted.retain(|pair| !removed.contains(&pair.0) && !removed.contains(&pair.1));
            self.order.forget(&removed);
        }
    }

    /// Sends the events that lead to the core's pairs. `size` returns the size class of a collider. Returns the number of added
    /// and of deleted pairs.
    pub(crate) fn write(
        &mut self,
        found: &Events,
        registry: &ColliderRegistry,
        size: impl Fn(Handle) -> u8,
        mut send: impl FnMut(PairEvent),
    ) -> (usize, usize) {
        let adopted = std::mem::take(&mut self.adopted);
        let (known, ended): (Vec<_>, Vec<_>) =
            adopted.into_iter().partition(|pair| overlaps(pair, found, registry));
        let deleted = found.removed.len() + ended.len();
        for &pair in &found.removed {
            let [a, b] = handles(pair, registry);
            let pair = self.order.of(a, b);
            self.order.end(pair);
            send(PairEvent::Delete(pair));
        }
        for pair in ended {
            let by_size = || self.order.of(pair.0, pair.1);
            send(PairEvent::Delete(if self.keeps_order { pair } else { by_size() }));
        }
        if self.keeps_order {
            known.iter().for_each(|&pair| self.order.adopt(pair, &size));
        }
        let known: HashSet<Pair> = known.iter().map(ids).collect();
        let new = found.added.iter().filter(|pair| !known.contains(pair));
        let added = new.map(|&pair| {
            let [a, b] = handles(pair, registry);
            send(PairEvent::Add(self.order.fix(a, b, &size)));
        });
        (added.count(), deleted)
    }
}

/// Returns true if an adopted pair still overlaps.
fn overlaps(pair: &HandlePair, found: &Events, registry: &ColliderRegistry) -> bool {
    let are_known = registry.contains(pair.0) && registry.contains(pair.1);
    are_known && found.added.binary_search(&ids(pair)).is_ok()
}

fn ids(pair: &HandlePair) -> Pair {
    Pair::new(pair.0.index, pair.1.index)
}

/// Returns the colliders of a pair. Every id in the core is in the registry.
pub(crate) fn handles(pair: Pair, registry: &ColliderRegistry) -> [Handle; 2] {
    [pair.a, pair.b].map(|index| registry.handle(index).unwrap_or(Handle { index, generation: 0 }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    /// A ground in pairs with `balls` others: it comes last in each, and each size is asked for once.
    #[test]
    fn a_ground_comes_last_at_the_cost_of_one_question_a_collider() {
        for balls in [10, 1000] {
            let registry = ColliderRegistry::from_generations(vec![0; balls + 1]);
            let pairs: Vec<Pair> = (1..=balls as u32).map(|ball| Pair::new(0, ball)).collect();
            let (asked, mut writer) = (Cell::new(0), EventWriter::default());
            let size = |one: Handle| {
                asked.set(asked.get() + 1);
                if one.index == 0 { 200 } else { 100 }
            };
            let (mut events, mut added, mut removed) = (Vec::new(), Events::default(), Events::default());
            (added.added, removed.removed) = (pairs.clone(), pairs);
            assert_eq!(writer.write(&added, &registry, size, |event| events.push(event)), (balls, 0));
            assert_eq!(writer.write(&removed, &registry, size, |event| events.push(event)), (0, balls));
            assert_eq!(asked.get(), balls + 1);
            let is_second = |event: &PairEvent| {
                let (PairEvent::Add(pair) | PairEvent::Delete(pair)) = event;
                pair.1 == Handle { index: 0, generation: 0 }
            };
            assert!(events.iter().all(is_second), "the ground comes last");
        }
    }
}
