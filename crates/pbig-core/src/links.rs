//! The pairs of each box, as lists through the list of all pairs.

use crate::Pair;

/// No pair: the end of a list.
pub(crate) const NONE: u32 = u32::MAX;

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

/// A link for each pair, and the first pair of each box; both empty while there are none. 16 bytes a pair and 4 an id.
#[derive(Clone, Debug, Default)]
pub(crate) struct Links {
    /// By place.
    links: Vec<Link>,
    /// By id.
    first: Vec<u32>,
    are_there: bool,
}

impl Links {
    /// Links all pairs.
    pub(crate) fn make(&mut self, pairs: &[Pair], ids: usize) {
        self.are_there = true;
        self.first.resize(ids, NONE);
        (0..pairs.len()).for_each(|place| self.add(pairs, place));
    }

    pub(crate) fn drop_all(&mut self) {
        self.are_there = false;
        self.links.clear();
        self.first.clear();
    }

    pub(crate) fn are_there(&self) -> bool {
        self.are_there
    }

    /// Makes ids below `ids` known.
    pub(crate) fn reserve_ids(&mut self, ids: usize) {
        if self.are_there {
            self.first.resize(ids, NONE);
        }
    }

    /// The places in the list of a box.
    pub(crate) fn places(&self, pairs: &[Pair], id: u32) -> impl Iterator<Item = u32> {
        let mut next = self.first.get(id as usize).copied().unwrap_or(NONE);
        std::iter::from_fn(move || {
            let (place, pair) = (next, pairs.get(next as usize)?);
            next = self.links[place as usize].next[side(*pair, id)];
            Some(place)
        })
    }

    /// Links the pair at `place`, behind all linked ones: it becomes the first of its boxes.
    pub(crate) fn add(&mut self, pairs: &[Pair], place: usize) {
        let (pair, place) = (pairs[place], place as u32);
        let heads = [pair.a, pair.b].map(|id| self.first[id as usize]);
        self.links.push(Link { next: heads, previous: [NONE; 2] });
        for (id, head) in [pair.a, pair.b].into_iter().zip(heads) {
            self.set_previous(pairs, head, id, place);
            self.first[id as usize] = place;
        }
    }

    /// Takes out the pair at `place`, into which the last one moves.
    pub(crate) fn remove(&mut self, pairs: &mut Vec<Pair>, place: u32) {
        let (pair, link) = (pairs[place as usize], self.links[place as usize]);
        for (side, id) in [pair.a, pair.b].into_iter().enumerate() {
            self.set_next(pairs, link.previous[side], id, link.next[side]);
            self.set_previous(pairs, link.next[side], id, link.previous[side]);
        }
        pairs.swap_remove(place as usize);
        self.links.swap_remove(place as usize);
        if let Some(moved) = self.links.get(place as usize).copied() {
            let pair = pairs[place as usize];
            for (side, id) in [pair.a, pair.b].into_iter().enumerate() {
                self.set_next(pairs, moved.previous[side], id, place);
                self.set_previous(pairs, moved.next[side], id, place);
            }
        }
    }

    fn set_next(&mut self, pairs: &[Pair], at: u32, id: u32, next: u32) {
        match pairs.get(at as usize) {
            Some(&pair) => self.links[at as usize].next[side(pair, id)] = next,
            None => self.first[id as usize] = next,
        }
    }

    fn set_previous(&mut self, pairs: &[Pair], at: u32, id: u32, previous: u32) {
        if let Some(&pair) = pairs.get(at as usize) {
            self.links[at as usize].previous[side(pair, id)] = previous;
        }
    }
}
