//! The pairs that exist, kept from update to update.
//!
//! Contract 5: the cost of an update follows the change. A pair that has ended is found by walking the kept pairs, an
//! added one by testing the old boxes of a found pair; neither needs a hash table. Where most boxes change, pairs are a
//! plain list, walked from end to end. Where few do, each pair is also linked into the lists of its two boxes, so that
//! those of one box are found without looking at the others. Links cost more than the walk to keep up, a few random
//! accesses for each pair that comes or goes (10,000 of 100,000: 1.1 ms against 0.1); so they are made when walks for the
//! sake of very few boxes have cost as much, and dropped where a walk costs less.
//! While a list of near pairs does the work (`crate::near`) it has the pairs that exist, too, and only how many each box
//! has is counted here.

#[cfg(test)]
mod tests;

use crate::cpu::codes::prefetch;
use crate::links::{Links, NONE};
use crate::marks::Marks;
use crate::share::{self, has_threads};
use crate::{Pair, shared_from};

/// Walks that cost as much as linking all pairs.
const WALKS: usize = 12;

/// Pairs that are walked in the time that the list of one box takes, and keeping it: 1.2 ns each, and 0.3 us.
const LOOKUP: usize = 256;

/// Pairs of a piece of a walk.
const PIECE: usize = shared_from(16_384);

/// Pairs of a walk for the sake of few boxes that are looked at together.
const BLOCK: usize = 1024;

/// Pairs whose memory, 8 bytes each, is worth giving back.
const MANY: usize = 1 << 20;

/// Which kept pairs have ended.
pub(crate) trait Judgement: Sync {
    /// Asks for what [`Judgement::holds`] will read.
    fn prepare(&self, _: Pair) {}

    /// Whether a kept pair is still one.
    fn holds(&self, pair: Pair) -> bool;
}

/// The end of all pairs.
struct End;

impl Judgement for End {
    fn holds(&self, _: Pair) -> bool {
        false
    }
}

/// The kept pairs. 8 bytes a pair and 4 an id, beside links.
#[derive(Clone, Debug, Default)]
pub(crate) struct PairStore {
    pairs: Vec<Pair>,
    degree: Vec<u32>,
    links: Links,
    /// Pairs walked for the sake of few boxes since the links were dropped.
    walked: usize,
    /// Of each piece of a walk: the pairs that have ended, or the places of those.
    ended: Vec<Vec<Pair>>,
    ended_places: Vec<Vec<u32>>,
    /// The places of pairs to remove.
    places: Vec<u32>,
    /// Boxes whose pairs are no longer there, although they are still in the list: a walk for each would cost more than
    /// one for all.
    removed: Vec<u32>,
    is_removed: Marks,
    /// Boxes of which a walk looks for pairs.
    marks: Marks,
}

impl PairStore {
    /// Most pairs that can be kept: places are 32 bits, and one of them means none.
    pub(crate) const MOST: u64 = NONE as u64;

    /// Makes ids below `ids` known.
    pub(crate) fn reserve_ids(&mut self, ids: usize) {
        if self.degree.len() < ids {
            self.degree.resize(ids, 0);
            self.is_removed.reserve_ids(ids);
            self.marks.reserve_ids(ids);
            self.links.reserve_ids(ids);
        }
    }

    /// Whether no boxes have been removed since [`PairStore::drop_removed`]: then what is counted is right.
    pub(crate) fn is_whole(&self) -> bool {
        self.removed.is_empty()
    }

    /// How many are listed; those of boxes that have been removed count.
    pub(crate) fn listed(&self) -> usize {
        self.pairs.len()
    }

    /// How many pairs a box has, here or in another list; those with boxes that have been removed count.
    pub(crate) fn counted(&self, id: u32) -> u32 {
        self.degree.get(id as usize).copied().unwrap_or(0)
    }

    /// Whether the pairs of a box are found without a walk.
    pub(crate) fn is_linked(&self) -> bool {
        self.links.are_there()
    }

    /// All pairs, in no particular order.
    pub(crate) fn iter(&self) -> impl Iterator<Item = Pair> {
        self.pairs.iter().copied().filter(|pair| self.is_there(*pair))
    }

    /// Whether neither box has been removed since [`PairStore::drop_removed`].
    pub(crate) fn is_there(&self, pair: Pair) -> bool {
        self.removed.is_empty() || !(self.is_removed.has(pair.a) | self.is_removed.has(pair.b))
    }

    /// The pairs of a box; without links at the cost of looking at all, unless there are none.
    pub(crate) fn of(&self, id: u32) -> impl Iterator<Item = Pair> {
        let walk = !self.links.are_there() && self.counted(id) > 0;
        let all = self.pairs.iter().take(if walk { self.pairs.len() } else { 0 }).copied();
        let all = all.filter(|pair| self.is_there(*pair));
        let linked = self.links.places(&self.pairs, id).map(|place| self.pairs[place as usize]);
        linked.chain(all.filter(move |pair| pair.a == id || pair.b == id))
    }

    /// Adds pairs that are not there yet.
    pub(crate) fn insert(&mut self, pairs: &[Pair]) {
        for &pair in pairs {
            self.pairs.push(pair);
            if self.links.are_there() {
                self.links.add(&self.pairs, self.pairs.len() - 1);
            }
            self.degree[pair.a as usize] += 1;
            self.degree[pair.b as usize] += 1;
        }
    }

    /// Takes back the pairs that another list had, so many, which have been counted.
    pub(crate) fn take_over(&mut self, pairs: impl Iterator<Item = Pair>, count: usize) {
        self.pairs.reserve(count);
        self.pairs.extend(pairs);
    }

    /// Leaves the pairs to another list, and goes on counting them.
    pub(crate) fn hand_over(&mut self) {
        self.links.drop_all();
        self.pairs.clear();
        if self.pairs.capacity() > MANY {
            self.pairs = Vec::new();
        }
    }

    /// The same, and what they are: all of them, also those of removed boxes. The room that `into` had is kept here.
    pub(crate) fn give_all(&mut self, into: &mut Vec<Pair>) {
        std::mem::swap(&mut self.pairs, into);
        self.hand_over();
    }

    /// No pairs have been counted.
    pub(crate) fn count_none(&mut self) {
        self.degree.fill(0);
    }

    /// Counts pairs that another list has added.
    pub(crate) fn count_added(&mut self, pairs: &[Pair]) {
        self.count(pairs, |degree| *degree += 1);
    }

    /// Counts pairs that another list has removed.
    pub(crate) fn count_removed(&mut self, pairs: &[Pair]) {
        self.count(pairs, |degree| *degree -= 1);
    }

    fn count(&mut self, pairs: &[Pair], change: impl Fn(&mut u32)) {
        for (k, pair) in pairs.iter().enumerate() {
            if let Some(ahead) = pairs.get(k + AHEAD) {
                [ahead.a, ahead.b].into_iter().for_each(|id| prefetch(&self.degree[id as usize]));
            }
            change(&mut self.degree[pair.a as usize]);
            change(&mut self.degree[pair.b as usize]);
        }
    }

    /// No listed pair is of a removed box any more.
    pub(crate) fn forget_removed(&mut self) {
        for id in self.removed.drain(..) {
            self.is_removed.unset(id);
        }
    }

    /// Removes all pairs of a box.
    pub(crate) fn remove_of(&mut self, id: u32) {
        if self.counted(id) > 0 && !self.is_removed.has(id) {
            self.is_removed.set(id);
            self.removed.push(id);
            if self.links.are_there() {
                self.drop_removed();
            }
        }
    }

    /// Drops pairs of removed boxes from the list: to be called before pairs are added or ended.
    pub(crate) fn drop_removed(&mut self) {
        if self.removed.is_empty() {
            return;
        }
        let mut ids = std::mem::take(&mut self.removed);
        self.find_ended(&ids, &End, false, || ());
        self.remove_places(|_| {});
        ids.drain(..).for_each(|id| self.is_removed.unset(id));
        self.removed = ids;
    }

    /// Removes the pairs that do not hold, of all; and appends them to `removed`.
    pub(crate) fn end_many(&mut self, of: &impl Judgement, removed: &mut Vec<Pair>) {
        self.links.drop_all();
        self.walked = 0;
        self.walk(|pairs, ended| keep(pairs, of, ended), removed);
    }

    /// As [`PairStore::end_many`], where pairs concern only the few boxes `ids`.
    pub(crate) fn end_few(&mut self, ids: &[u32], of: &impl Judgement, removed: &mut Vec<Pair>) {
        self.find_ended(ids, of, false, || ());
        self.end_found(removed);
    }

    /// Removes what [`PairStore::find_ended`] has found, and appends it to `removed`.
    pub(crate) fn end_found(&mut self, removed: &mut Vec<Pair>) {
        self.remove_places(|pair| removed.push(pair));
    }

    /// Finds the pairs that do not hold, of those that concern the few boxes `ids`, and leaves them where they are; and does
    /// something else, beside that if `is_shared` and it takes a walk.
    pub(crate) fn find_ended<T>(
        &mut self,
        ids: &[u32],
        of: &impl Judgement,
        is_shared: bool,
        own: impl FnOnce() -> T,
    ) -> T {
        self.choose(ids.len());
        // Largest place first.
        let mut places = std::mem::take(&mut self.places);
        places.clear();
        let done;
        if self.links.are_there() {
            done = own();
            for &id in ids {
                let listed = self.links.places(&self.pairs, id);
                places.extend(listed.filter(|&place| !of.holds(self.pairs[place as usize])));
            }
            // A pair of two of the boxes is in both their lists.
            places.sort_unstable_by(|a, b| b.cmp(a));
            places.dedup();
        } else {
            ids.iter().for_each(|&id| self.marks.set(id));
            done = self.walk_for_few(of, &mut places, is_shared, own);
            ids.iter().for_each(|&id| self.marks.unset(id));
            places.reverse();
        }
        self.places = places;
        done
    }

    /// Links or not, for so many boxes: they are made when walks without have cost as much, and dropped where a walk
    /// costs less.
    fn choose(&mut self, boxes: usize) {
        let pairs = self.pairs.len();
        if boxes * LOOKUP >= pairs {
            self.links.drop_all();
        } else if !self.links.are_there() {
            self.walked += pairs;
            if self.walked > WALKS * pairs {
                self.walked = 0;
                self.links.make(&self.pairs, self.degree.len());
            }
        }
    }

    /// Removes the pairs at the places found. Largest first: the pair that fills a hole comes from the end, which is not
    /// among them.
    fn remove_places(&mut self, mut tell: impl FnMut(Pair)) {
        let mut places = std::mem::take(&mut self.places);
        for place in places.drain(..) {
            let pair = self.pairs[place as usize];
            tell(pair);
            self.degree[pair.a as usize] -= 1;
            self.degree[pair.b as usize] -= 1;
            if self.links.are_there() {
                self.links.remove(&mut self.pairs, place);
            } else {
                self.pairs.swap_remove(place as usize);
            }
        }
        self.places = places;
    }

    /// The places of pairs that do not hold, where those that have changed are few.
    fn walk_for_few<T>(
        &mut self,
        of: &impl Judgement,
        places: &mut Vec<u32>,
        is_shared: bool,
        own: impl FnOnce() -> T,
    ) -> T {
        let pieces = self.pairs.len().div_ceil(PIECE);
        self.ended_places.resize(pieces.max(self.ended_places.len()), Vec::new());
        let marks = &self.marks;
        let walk = |(i, (pairs, ended)): (usize, (&[Pair], &mut Vec<u32>))| {
            ended.clear();
            for (k, block) in pairs.chunks(BLOCK).enumerate() {
                find_few(block, (i * PIECE + k * BLOCK) as u32, marks, of, ended);
            }
        };
        let (pairs, ended) = (&self.pairs, &mut self.ended_places[..pieces]);
        let is_shared = is_shared || (pieces > 4 && has_threads());
        let done = share::beside(is_shared, own, pairs.chunks(PIECE).zip(ended).enumerate(), walk);
        self.ended_places[..pieces].iter().for_each(|ended| places.extend(ended));
        done
    }

    /// Keeps in order what `keep` moves to the front of each piece.
    fn walk(&mut self, keep: impl Fn(&mut [Pair], &mut Vec<Pair>) + Sync, removed: &mut Vec<Pair>) {
        if self.pairs.is_empty() {
            return;
        }
        let pieces = self.pairs.len().div_ceil(PIECE);
        self.ended.resize(pieces.max(self.ended.len()), Vec::new());
        let walk = |(pairs, ended): (&mut [Pair], &mut Vec<Pair>)| keep(pairs, ended);
        let is_shared = pieces > 2 && has_threads();
        share::for_each(is_shared, self.pairs.chunks_mut(PIECE).zip(&mut self.ended), walk);
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
}

/// Pairs ahead whose boxes are asked for: without, the walk waits for each, 21 ns instead of 8.
pub(crate) const AHEAD: usize = 24;

/// Moves what holds to the front, in order, and the rest to `ended`.
fn keep(pairs: &mut [Pair], of: &impl Judgement, ended: &mut Vec<Pair>) {
    let mut kept = 0;
    for i in 0..pairs.len() {
        if let Some(pair) = pairs.get(i + AHEAD) {
            of.prepare(*pair);
        }
        let pair = pairs[i];
        pairs[kept] = pair;
        if of.holds(pair) {
            kept += 1;
        } else {
            ended.push(pair);
        }
    }
}

/// The places of pairs that have ended, from `first` on. Without a branch for each: first those of marked boxes,
/// then which of them hold.
fn find_few(pairs: &[Pair], first: u32, marks: &Marks, of: &impl Judgement, ended: &mut Vec<u32>) {
    let (mut found, mut count) = ([0; BLOCK], 0);
    for (i, &pair) in (0..).zip(pairs) {
        found[count] = i;
        count += usize::from(marks.has(pair.a) | marks.has(pair.b));
    }
    let found = &found[..count];
    found.iter().for_each(|&i| of.prepare(pairs[i as usize]));
    ended.extend(found.iter().filter(|&&i| !of.holds(pairs[i as usize])).map(|&i| first + i));
}
