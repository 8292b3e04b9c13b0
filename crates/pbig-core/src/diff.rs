//! The pairs that exist, kept from update to update.
//!
//! Contract 5: the cost of an update follows the change. A pair that has ended is found by walking the kept pairs, an
//! added one by testing the old boxes of a found pair; neither needs a hash table. Where most boxes change, pairs are a
//! plain list, walked from end to end. Where few do, each pair is also linked into the lists of its two boxes, so that
//! those of one box are found without looking at the others. Links cost more than the walk to keep up, a few random
//! accesses for each pair that comes or goes (10,000 of 100,000: 1.1 ms against 0.1); so they are made when walks for the
//! sake of few boxes have cost as much, and dropped when most change.

use crate::Pair;
use rayon::prelude::*;
use std::collections::HashSet;

/// No pair: the end of a list.
const NONE: u32 = u32::MAX;

/// Walks that cost as much as linking all pairs.
const WALKS: usize = 12;

/// Pairs of a piece of a walk.
const PIECE: usize = 16_384;

/// The neighbours of a pair in the list of each of its boxes (`a` first, then `b`).
#[derive(Clone, Copy, Debug)]
struct Link {
    next: [u32; 2],
    previous: [u32; 2],
}

/// Which of the two boxes of a pair `id` is: 0 for `a`, 1 for `b`.
fn side(pair: Pair, id: u32) -> usize {
    usize::from(pair.a != id)
}

/// Which kept pairs have ended.
pub(crate) trait Judgement: Sync {
    /// Asks for what [`Judgement::holds`] will read.
    fn prepare(&self, _: Pair) {}

    /// Whether one of the boxes has changed. Pairs that do not concern us hold.
    fn concerns(&self, pair: Pair) -> bool;

    /// Whether a kept pair is still one.
    fn holds(&self, pair: Pair) -> bool;
}

/// The end of all pairs of some boxes.
struct EndOf(HashSet<u32>);

impl Judgement for EndOf {
    fn concerns(&self, pair: Pair) -> bool {
        self.0.contains(&pair.a) || self.0.contains(&pair.b)
    }

    fn holds(&self, _: Pair) -> bool {
        false
    }
}

/// The kept pairs. 8 bytes a pair and 4 an id; with links 16 and 4 more.
#[derive(Clone, Debug, Default)]
pub(crate) struct PairStore {
    pairs: Vec<Pair>,
    degree: Vec<u32>,
    /// By place, and by id; both empty while there are none.
    links: Vec<Link>,
    first: Vec<u32>,
    linked: bool,
    /// Pairs walked for the sake of few boxes since the links were dropped.
    walked: usize,
    /// Of each piece of a walk: the pairs that have ended.
    ended: Vec<Vec<Pair>>,
    /// The places of pairs to remove.
    places: Vec<u32>,
    /// Boxes whose pairs are no longer there, although they are still in the list: a walk for each would cost more than
    /// one for all.
    removed: HashSet<u32>,
}

impl PairStore {
    /// Most pairs that can be kept: places are 32 bits, and one of them means none.
    pub(crate) const MOST: u64 = NONE as u64;

    /// Makes ids below `ids` known.
    pub(crate) fn reserve_ids(&mut self, ids: usize) {
        if self.degree.len() < ids {
            self.degree.resize(ids, 0);
            if self.linked {
                self.first.resize(ids, NONE);
            }
        }
    }

    /// How many there are; counted one by one while boxes have been removed since [`PairStore::drop_removed`].
    pub(crate) fn len(&self) -> usize {
        if self.removed.is_empty() { self.pairs.len() } else { self.iter().count() }
    }

    /// How many pairs a box has; counted as [`PairStore::len`].
    pub(crate) fn degree(&self, id: u32) -> u32 {
        if self.removed.is_empty() { self.listed_degree(id) } else { self.of(id).count() as u32 }
    }

    fn listed_degree(&self, id: u32) -> u32 {
        self.degree.get(id as usize).copied().unwrap_or(0)
    }

    /// All pairs, in no particular order.
    pub(crate) fn iter(&self) -> impl Iterator<Item = Pair> {
        self.pairs.iter().copied().filter(|pair| self.is_there(*pair))
    }

    fn is_there(&self, pair: Pair) -> bool {
        self.removed.is_empty() || !(self.removed.contains(&pair.a) || self.removed.contains(&pair.b))
    }

    /// The pairs of a box; without links at the cost of looking at all, unless there are none.
    pub(crate) fn of(&self, id: u32) -> impl Iterator<Item = Pair> {
        let walk = !self.linked && self.listed_degree(id) > 0;
        let all = self.pairs.iter().take(if walk { self.pairs.len() } else { 0 }).copied();
        let all = all.filter(|pair| self.is_there(*pair));
        let linked = self.listed(id).map(|place| self.pairs[place as usize]);
        linked.chain(all.filter(move |pair| pair.a == id || pair.b == id))
    }

    /// The places in the list of a box.
    fn listed(&self, id: u32) -> impl Iterator<Item = u32> {
        let mut next = self.first.get(id as usize).copied().unwrap_or(NONE);
        std::iter::from_fn(move || {
            let (place, pair) = (next, self.pairs.get(next as usize)?);
            next = self.links[place as usize].next[side(*pair, id)];
            Some(place)
        })
    }

    /// Adds pairs that are not there yet.
    pub(crate) fn insert(&mut self, pairs: &[Pair]) {
        for &pair in pairs {
            if self.linked {
                self.link(pair, self.pairs.len() as u32);
            }
            self.pairs.push(pair);
            self.degree[pair.a as usize] += 1;
            self.degree[pair.b as usize] += 1;
        }
    }

    /// Removes all pairs of a box.
    pub(crate) fn remove_of(&mut self, id: u32) {
        if self.listed_degree(id) > 0 {
            self.removed.insert(id);
            if self.linked {
                self.drop_removed();
            }
        }
    }

    /// Drops pairs of removed boxes from the list: to be called before pairs are added or ended.
    pub(crate) fn drop_removed(&mut self) {
        if !self.removed.is_empty() {
            let boxes = std::mem::take(&mut self.removed);
            let ids: Vec<u32> = boxes.iter().copied().collect();
            self.end_few(&ids, &EndOf(boxes), &mut Vec::new());
        }
    }

    /// Removes the pairs that do not hold, of all; and appends them to `removed`.
    pub(crate) fn end_many(&mut self, of: &impl Judgement, removed: &mut Vec<Pair>) {
        self.linked = false;
        self.walked = 0;
        self.links.clear();
        self.first.clear();
        self.walk(
            |pairs, ended| keep(pairs, &|pair| of.holds(pair), |pair| of.prepare(pair), ended),
            removed,
        );
    }

    /// As [`PairStore::end_many`], where pairs concern only the few boxes `ids`.
    pub(crate) fn end_few(&mut self, ids: &[u32], of: &impl Judgement, removed: &mut Vec<Pair>) {
        if !self.linked && self.walked > WALKS * self.pairs.len() {
            self.link_all();
        }
        if !self.linked {
            self.walked += self.pairs.len();
            let holds = |pair| !of.concerns(pair) || of.holds(pair);
            return self.walk(|pairs, ended| keep(pairs, &holds, |_| {}, ended), removed);
        }
        let mut places = std::mem::take(&mut self.places);
        places.clear();
        for &id in ids {
            places.extend(self.listed(id).filter(|&place| !of.holds(self.pairs[place as usize])));
        }
        // A pair of two of the boxes is in both their lists.
        places.sort_unstable_by(|a, b| b.cmp(a));
        places.dedup();
        // Largest first: the pair that fills a hole comes from the end, which is not in the list.
        for &place in &places {
            removed.push(self.pairs[place as usize]);
            self.remove(place);
        }
        self.places = places;
    }

    /// Keeps in order what `keep` moves to the front of each piece.
    fn walk(&mut self, keep: impl Fn(&mut [Pair], &mut Vec<Pair>) + Sync, removed: &mut Vec<Pair>) {
        let pieces = self.pairs.len().div_ceil(PIECE);
        self.ended.resize(pieces.max(self.ended.len()), Vec::new());
        let walk = |(pairs, ended): (&mut [Pair], &mut Vec<Pair>)| keep(pairs, ended);
        if pieces > 2 && rayon::current_num_threads() > 1 {
            self.pairs.par_chunks_mut(PIECE).zip(&mut self.ended).for_each(walk);
        } else {
            self.pairs.chunks_mut(PIECE).zip(&mut self.ended).for_each(walk);
        }
        let first = removed.len();
        let (mut kept, mut start) = (0, 0);
        for ended in &mut self.ended[..pieces] {
            let end = (start + PIECE).min(self.pairs.len());
            let alive = end - start - ended.len();
            if kept < start {
                self.pairs.copy_within(start..start + alive, kept);
            }
            (kept, start) = (kept + alive, end);
            removed.append(ended);
        }
        self.pairs.truncate(kept);
        for pair in &removed[first..] {
            self.degree[pair.a as usize] -= 1;
            self.degree[pair.b as usize] -= 1;
        }
    }

    fn link_all(&mut self) {
        self.linked = true;
        self.first.resize(self.degree.len(), NONE);
        for place in 0..self.pairs.len() {
            self.link(self.pairs[place], place as u32);
        }
    }

    /// Makes a pair that will be at `place`, the next one, the first in the lists of its boxes.
    fn link(&mut self, pair: Pair, place: u32) {
        let ids = [pair.a, pair.b];
        let heads = ids.map(|id| self.first[id as usize]);
        self.links.push(Link { next: heads, previous: [NONE; 2] });
        for (id, head) in ids.into_iter().zip(heads) {
            self.set_previous(head, id, place);
            self.first[id as usize] = place;
        }
    }

    fn remove(&mut self, place: u32) {
        let (pair, link) = (self.pairs[place as usize], self.links[place as usize]);
        for (side, id) in [pair.a, pair.b].into_iter().enumerate() {
            self.set_next(link.previous[side], id, link.next[side]);
            self.set_previous(link.next[side], id, link.previous[side]);
            self.degree[id as usize] -= 1;
        }
        self.pairs.swap_remove(place as usize);
        self.links.swap_remove(place as usize);
        if let Some(moved) = self.links.get(place as usize).copied() {
            let pair = self.pairs[place as usize];
            for (side, id) in [pair.a, pair.b].into_iter().enumerate() {
                self.set_next(moved.previous[side], id, place);
                self.set_previous(moved.next[side], id, place);
            }
        }
    }

    fn set_next(&mut self, at: u32, id: u32, next: u32) {
        match self.pairs.get(at as usize) {
            Some(&pair) => self.links[at as usize].next[side(pair, id)] = next,
            None => self.first[id as usize] = next,
        }
    }

    fn set_previous(&mut self, at: u32, id: u32, previous: u32) {
        if let Some(&pair) = self.pairs.get(at as usize) {
            self.links[at as usize].previous[side(pair, id)] = previous;
        }
    }
}

/// Pairs ahead whose boxes are asked for: without, the walk waits for each, 21 ns instead of 8.
const AHEAD: usize = 24;

/// Moves what holds to the front, in order, and the rest to `ended`.
fn keep(pairs: &mut [Pair], holds: &impl Fn(Pair) -> bool, ahead: impl Fn(Pair), ended: &mut Vec<Pair>) {
    let mut kept = 0;
    for i in 0..pairs.len() {
        if let Some(pair) = pairs.get(i + AHEAD) {
            ahead(*pair);
        }
        let pair = pairs[i];
        pairs[kept] = pair;
        if holds(pair) {
            kept += 1;
        } else {
            ended.push(pair);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// Pairs that concern, and that hold.
    struct Test<C, H>(C, H);

    impl<C: Fn(Pair) -> bool + Sync, H: Fn(Pair) -> bool + Sync> Judgement for Test<C, H> {
        fn concerns(&self, pair: Pair) -> bool {
            self.0(pair)
        }

        fn holds(&self, pair: Pair) -> bool {
            self.1(pair)
        }
    }

    /// Every list holds exactly the pairs of its box, and the degrees agree.
    fn validate(store: &PairStore, wanted: &BTreeSet<Pair>) {
        let all: BTreeSet<Pair> = store.iter().collect();
        assert_eq!(&all, wanted);
        assert_eq!(store.len(), wanted.len());
        for id in 0..store.degree.len() as u32 {
            let listed: BTreeSet<Pair> = store.of(id).collect();
            let own: BTreeSet<Pair> = wanted.iter().copied().filter(|p| p.a == id || p.b == id).collect();
            assert_eq!(listed, own, "list of {id}");
            assert_eq!(store.of(id).count(), own.len(), "list of {id} repeats");
            assert_eq!(store.degree(id) as usize, own.len(), "degree of {id}");
        }
    }

    #[test]
    fn lists_stay_whole_through_insertions_and_removals_of_every_place_with_links_and_without() {
        let mut store = PairStore::default();
        store.reserve_ids(12);
        let mut wanted: BTreeSet<Pair> = BTreeSet::new();
        let (mut random, mut linked) = (1u64, 0);
        for _ in 0..4000 {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let (i, j) = ((random >> 33) as u32 % 12, (random >> 50) as u32 % 12);
            let mut removed = Vec::new();
            let before = wanted.clone();
            if random >> 20 & 3 == 0 {
                wanted.retain(|pair| pair.a != i && pair.b != i);
                store.remove_of(i);
                validate(&store, &wanted);
                // Several boxes are removed before the list is put right.
                if random >> 30 & 1 == 0 {
                    continue;
                }
            }
            store.drop_removed();
            if i != j && wanted.insert(Pair::new(i, j)) {
                store.insert(&[Pair::new(i, j)]);
            } else if random >> 22 & 63 == 0 {
                wanted.retain(|pair| !pair.a.is_multiple_of(3));
                store.end_many(&Test(|_| true, |pair: Pair| !pair.a.is_multiple_of(3)), &mut removed);
            } else {
                let concerns = |pair: Pair| [pair.a, pair.b].iter().any(|id| *id == i || *id == j);
                wanted.retain(|&pair| !concerns(pair) || pair.b.is_multiple_of(2));
                store.end_few(&[i, j], &Test(concerns, |pair: Pair| pair.b.is_multiple_of(2)), &mut removed);
            }
            validate(&store, &wanted);
            let ended: BTreeSet<Pair> = removed.iter().copied().collect();
            assert_eq!(ended.len(), removed.len(), "twice");
            assert!(ended.iter().all(|pair| before.contains(pair) && !wanted.contains(pair)));
            linked += u32::from(store.linked);
        }
        assert!((500..3500).contains(&linked), "{linked} rounds with links");
    }

    #[test]
    fn a_walk_in_pieces_is_the_same_as_one() {
        let pairs: Vec<Pair> = (0..3 * PIECE as u32 + 77).map(|i| Pair::new(i, i + 1 + i % 7)).collect();
        let mut store = PairStore::default();
        store.reserve_ids(pairs.len() + 10);
        store.insert(&pairs);
        let holds = |pair: Pair| !(pair.a / 3).is_multiple_of(5);
        let mut removed = Vec::new();
        store.end_many(&Test(|_| true, holds), &mut removed);
        let (kept, ended): (Vec<Pair>, Vec<Pair>) = pairs.into_iter().partition(|&pair| holds(pair));
        assert_eq!((store.pairs, removed), (kept, ended));
    }
}
