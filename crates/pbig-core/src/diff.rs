//! The pairs that exist, kept so that those of one box are found without looking at the others.
//!
//! Contract 5: the cost of an update follows the change. A deleted pair is found by walking the
//! kept pairs of the changed boxes, an added one by testing the old boxes of a found pair; neither
//! needs a hash table. Pairs lie in one dense list, each linked into the lists of its two boxes.

use crate::Pair;

/// No pair: the end of a list.
const NONE: u32 = u32::MAX;

/// A kept pair, and its neighbours in the list of each of its boxes (`a` first, then `b`).
#[derive(Clone, Copy, Debug)]
struct Link {
    pair: Pair,
    next: [u32; 2],
    previous: [u32; 2],
}

impl Link {
    /// Which of the two boxes `id` is: 0 for `a`, 1 for `b`.
    fn side(&self, id: u32) -> usize {
        usize::from(self.pair.a != id)
    }
}

/// The kept pairs. 24 bytes a pair, 8 an id.
#[derive(Clone, Debug, Default)]
pub(crate) struct PairStore {
    links: Vec<Link>,
    first: Vec<u32>,
    degree: Vec<u32>,
}

impl PairStore {
    /// Most pairs that can be kept: places are 32 bits, and one of them means none.
    pub(crate) const MOST: u64 = NONE as u64;

    /// Makes ids below `ids` known.
    pub(crate) fn reserve_ids(&mut self, ids: usize) {
        if self.first.len() < ids {
            self.first.resize(ids, NONE);
            self.degree.resize(ids, 0);
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.links.len()
    }

    /// How many pairs a box has.
    pub(crate) fn degree(&self, id: u32) -> u32 {
        self.degree.get(id as usize).copied().unwrap_or(0)
    }

    /// All pairs with their places, in no particular order.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (u32, Pair)> {
        self.links.iter().enumerate().map(|(place, link)| (place as u32, link.pair))
    }

    /// The pairs of a box with their places.
    pub(crate) fn of(&self, id: u32) -> impl Iterator<Item = (u32, Pair)> {
        let mut next = self.first.get(id as usize).copied().unwrap_or(NONE);
        std::iter::from_fn(move || {
            let place = next;
            let link = self.links.get(place as usize)?;
            next = link.next[link.side(id)];
            Some((place, link.pair))
        })
    }

    /// Adds a pair that is not there yet.
    pub(crate) fn insert(&mut self, pair: Pair) {
        let place = self.links.len() as u32;
        let heads = [pair.a, pair.b].map(|id| self.first[id as usize]);
        self.links.push(Link { pair, next: heads, previous: [NONE; 2] });
        for (id, head) in [pair.a, pair.b].into_iter().zip(heads) {
            self.set_previous(head, id, place);
            self.first[id as usize] = place;
            self.degree[id as usize] += 1;
        }
    }

    /// Removes the pairs at the given places.
    pub(crate) fn remove_all(&mut self, places: &mut [u32]) {
        // Largest first: the pair that fills a hole comes from the end, which is not in the list.
        places.sort_unstable_by(|a, b| b.cmp(a));
        for &place in places.iter() {
            self.remove(place);
        }
    }

    fn remove(&mut self, place: u32) {
        let link = self.links[place as usize];
        for (side, id) in [link.pair.a, link.pair.b].into_iter().enumerate() {
            self.set_next(link.previous[side], id, link.next[side]);
            self.set_previous(link.next[side], id, link.previous[side]);
            self.degree[id as usize] -= 1;
        }
        self.links.swap_remove(place as usize);
        if let Some(moved) = self.links.get(place as usize).copied() {
            for (side, id) in [moved.pair.a, moved.pair.b].into_iter().enumerate() {
                self.set_next(moved.previous[side], id, place);
                self.set_previous(moved.next[side], id, place);
            }
        }
    }

    fn set_next(&mut self, at: u32, id: u32, next: u32) {
        match self.links.get_mut(at as usize) {
            Some(link) => {
                let side = link.side(id);
                link.next[side] = next;
            }
            None => self.first[id as usize] = next,
        }
    }

    fn set_previous(&mut self, at: u32, id: u32, previous: u32) {
        if let Some(link) = self.links.get_mut(at as usize) {
            let side = link.side(id);
            link.previous[side] = previous;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// Every list holds exactly the pairs of its box, and the degrees agree.
    fn validate(store: &PairStore, wanted: &BTreeSet<Pair>) {
        let all: BTreeSet<Pair> = store.iter().map(|(_, pair)| pair).collect();
        assert_eq!(&all, wanted);
        assert_eq!(store.len(), wanted.len());
        for id in 0..store.first.len() as u32 {
            let listed: BTreeSet<Pair> = store.of(id).map(|(_, pair)| pair).collect();
            let own: BTreeSet<Pair> = wanted.iter().copied().filter(|p| p.a == id || p.b == id).collect();
            assert_eq!(listed, own, "list of {id}");
            assert_eq!(store.of(id).count(), own.len(), "list of {id} repeats");
            assert_eq!(store.degree(id) as usize, own.len(), "degree of {id}");
        }
    }

    #[test]
    fn lists_stay_whole_through_insertions_and_removals_of_every_place() {
        let mut store = PairStore::default();
        store.reserve_ids(12);
        let mut wanted = BTreeSet::new();
        let mut random = 1u64;
        for _ in 0..2000 {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let (i, j) = ((random >> 33) as u32 % 12, (random >> 50) as u32 % 12);
            if i != j && wanted.insert(Pair::new(i, j)) {
                store.insert(Pair::new(i, j));
            } else {
                let mut places: Vec<u32> = store.of(i).map(|(place, _)| place).collect();
                store.remove_all(&mut places);
                wanted.retain(|pair| pair.a != i && pair.b != i);
            }
            validate(&store, &wanted);
        }
    }
}
