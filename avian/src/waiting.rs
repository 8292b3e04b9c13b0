//! Overlapping pairs without a contact: vetoed by a joint or a hook, or not asked for since their contact was removed.

use pbig_core::Pair;
use std::collections::BTreeSet;

/// A set of pairs, by either of their ids.
#[derive(Default)]
pub(crate) struct Waiting {
    /// Each pair twice: as it is, and turned.
    ends: BTreeSet<[u32; 2]>,
}

impl Waiting {
    /// Inserts a pair or removes it.
    pub(crate) fn set(&mut self, pair: Pair, waits: bool) {
        let ends = [[pair.a, pair.b], [pair.b, pair.a]];
        if waits {
            self.ends.extend(ends);
        } else if self.ends.remove(&ends[0]) {
            self.ends.remove(&ends[1]);
        }
    }

    /// Removes the pairs of an id.
    pub(crate) fn forget(&mut self, id: u32) {
        let pairs: Vec<_> = self.of(id).collect();
        pairs.into_iter().for_each(|pair| self.set(pair, false));
    }

    /// Appends the pairs with at least one of some different ids, in no order, perhaps twice. The work follows the smaller set.
    pub(crate) fn list(&self, ids: &[u32], has: impl Fn(u32) -> bool, pairs: &mut Vec<Pair>) {
        if 2 * ids.len() < self.ends.len() {
            pairs.extend(ids.iter().flat_map(|&id| self.of(id)));
        } else {
            let is_listed = |end: &&[u32; 2]| end[0] < end[1] && (has(end[0]) || has(end[1]));
            pairs.extend(self.ends.iter().filter(is_listed).map(|&[a, b]| Pair { a, b }));
        }
    }

    fn of(&self, id: u32) -> impl Iterator<Item = Pair> + '_ {
        let ends = self.ends.range([id, 0]..=[id, u32::MAX]);
        ends.map(|&[one, other]| Pair { a: one.min(other), b: one.max(other) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn listed(waiting: &Waiting, ids: &[u32]) -> Vec<Pair> {
        let mut pairs = Vec::new();
        waiting.list(ids, |id| ids.contains(&id), &mut pairs);
        pairs.sort_unstable();
        pairs.dedup();
        pairs
    }

    #[test]
    fn both_ways_to_list_pairs_give_those_of_the_ids() {
        let (mut waiting, mut all) = (Waiting::default(), BTreeSet::new());
        for i in 0..200 {
            let pair = Pair { a: i % 9, b: 9 + i % 11 };
            waiting.set(pair, true);
            all.insert(pair);
        }
        for removed in [Pair { a: 3, b: 12 }, Pair { a: 3, b: 12 }] {
            waiting.set(removed, false);
            all.remove(&removed);
        }
        [0, 14].iter().for_each(|&id| waiting.forget(id));
        all.retain(|pair| ![pair.a, pair.b].iter().any(|id| [0, 14].contains(id)));
        // Few ids are looked up, many are compared with every pair.
        for ids in [vec![], vec![3], vec![0, 1, 14, 12], (2..200).collect()] {
            let wanted = all.iter().filter(|pair| ids.contains(&pair.a) || ids.contains(&pair.b));
            assert_eq!(listed(&waiting, &ids), wanted.copied().collect::<Vec<_>>(), "{ids:?}");
        }
    }

    #[test]
    fn ten_thousand_waiting_pairs_cost_what_the_moved_ones_are() {
        let mut waiting = Waiting::default();
        (0..10_000).for_each(|i| waiting.set(Pair { a: i, b: i + 10_000 }, true));
        let asked = std::cell::Cell::new(0);
        let mut pairs = Vec::new();
        waiting.list(
            &[7, 19_000],
            |_| {
                asked.set(asked.get() + 1);
                false
            },
            &mut pairs,
        );
        assert_eq!((pairs.len(), asked.get()), (2, 0));
    }
}
