//! Pairs of boxes that are near each other: a list as Verlet's (Phys. Rev. 159, 98, 1967).
//!
//! Each box has a *reach*, itself grown by a *skin*. As long as all stay in their reaches, whatever overlaps is among the
//! pairs whose reaches do. So these are found once, and for many updates only they are tested: 3 ns each, where to sort and
//! search costs 60 a box. Pairs that come and go are those whose test ends otherwise than the last time, without a look at
//! what boxes were. (Boxes copied into the order of their pairs, so that those of a pair are near in memory, too, were no
//! faster: the copying took what the tests gained.)

mod index;
#[cfg(test)]
mod tests;

use crate::cpu::codes::prefetch;
use crate::diff::{Judgement, PairStore};
use crate::{Aabb, Pair};
use index::Index;
use rayon::prelude::*;

/// No place among the kept pairs: the boxes are near, and apart.
const APART: u32 = u32::MAX;

/// The same, and they are no longer near.
const GONE: u32 = u32::MAX - 1;

/// Pairs of a piece of a walk.
const PIECE: usize = 16_384;

/// Pairs that are tested before those found are kept.
const BLOCK: usize = 1024;

/// Pairs ahead whose memory is asked for.
const AHEAD: usize = 24;

/// Pairs whose memory, 8 bytes each, is worth giving back.
const MANY: usize = 1 << 20;

/// Boxes whose pairs are looked up together.
const TOGETHER: usize = 32;

/// Walks that cost as much as an index.
const WALKS: usize = 8;

/// Some pairs, and their places.
type Piece<'a> = (&'a [Pair], &'a [u32]);

/// Near pairs, and which of them are kept: 12 bytes each, 8 more with an index, and 4 for each kept one.
#[derive(Clone, Debug, Default)]
pub(crate) struct NearPairs {
    pairs: Vec<Pair>,
    /// Of each: its place among the kept pairs, [`APART`] or [`GONE`].
    places: Vec<u32>,
    /// By place among the kept pairs: which near pair it is.
    owners: Vec<u32>,
    gone: usize,
    index: Index,
    /// Pairs walked for the sake of few boxes.
    walked: usize,
    /// Of each piece of a walk.
    flips: Vec<Vec<u32>>,
    /// Of each piece of a new list: pairs that are new.
    fresh: Vec<Vec<Pair>>,
    /// Tests made since they were asked for, and those that were true.
    tests: [u64; 2],
}

impl NearPairs {
    /// Forgets all; kept pairs stay what they are.
    pub(crate) fn clear(&mut self) {
        self.pairs.clear();
        self.places.clear();
        self.owners.clear();
        (self.gone, self.walked, self.index.known) = (0, 0, 0);
    }

    /// How many there are.
    pub(crate) fn len(&self) -> usize {
        self.pairs.len() - self.gone
    }

    /// Tests made since the last time, and how many were true.
    pub(crate) fn take_tests(&mut self) -> [u64; 2] {
        std::mem::take(&mut self.tests)
    }

    /// All pairs that are near, of a search; those that overlap become the kept pairs. Of these, the ones that did not hold
    /// before are put into `added`, and the others have been kept until now.
    pub(crate) fn fill(
        &mut self,
        found: &mut [Vec<Pair>],
        boxes: &[Aabb],
        kept: &mut PairStore,
        before: &impl Judgement,
        added: &mut Vec<Pair>,
    ) {
        self.clear();
        let count = found.iter().map(Vec::len).sum();
        self.pairs.reserve_exact(count);
        self.places.reserve_exact(count);
        self.add(found, boxes);
        if count > MANY {
            found.iter_mut().for_each(|pairs| *pairs = Vec::new());
        }
        let Self { pairs, places, owners, flips, fresh, .. } = self;
        let pieces = pairs.len().div_ceil(PIECE);
        fresh.resize(pieces.max(fresh.len()), Vec::new());
        let part = |(flips, fresh): (&Vec<u32>, &mut Vec<Pair>)| {
            fresh.clear();
            for (k, &i) in flips.iter().enumerate() {
                flips.get(k + AHEAD).into_iter().for_each(|&ahead| before.prepare(pairs[ahead as usize]));
                fresh.extend(Some(pairs[i as usize]).filter(|pair| !before.holds(*pair)));
            }
        };
        flips[..pieces].par_iter().zip(fresh.par_iter_mut()).for_each(part);
        let first = added.len();
        fresh[..pieces].iter().for_each(|fresh| added.extend_from_slice(fresh));
        owners.extend(flips[..pieces].iter().flatten());
        for (place, &i) in (0..).zip(&*owners) {
            places[i as usize] = place;
        }
        kept.relist(owners.iter().map(|&i| pairs[i as usize]), &added[first..]);
    }

    /// Adds pairs that have come near; keeps those that overlap, and tells which.
    pub(crate) fn extend(
        &mut self,
        found: &[Vec<Pair>],
        boxes: &[Aabb],
        kept: &mut PairStore,
        added: impl FnMut(Pair),
    ) {
        self.add(found, boxes);
        // What was apart cannot go.
        self.turn(kept, added, |_| {});
    }

    /// Adds pairs as apart; those that overlap into `flips`.
    fn add(&mut self, found: &[Vec<Pair>], boxes: &[Aabb]) {
        let first = self.pairs.len();
        found.iter().for_each(|pairs| self.pairs.extend_from_slice(pairs));
        self.places.resize(self.pairs.len(), APART);
        self.walk(first, boxes);
    }

    /// Tests all near pairs, and tells which have come and which have gone.
    pub(crate) fn update(
        &mut self,
        boxes: &[Aabb],
        kept: &mut PairStore,
        added: impl FnMut(Pair),
        removed: impl FnMut(Pair),
    ) {
        self.walk(0, boxes);
        self.turn(kept, added, removed);
    }

    /// The same, where only the boxes `changed` have. `comes_first` says of two boxes whether the first is the one that their
    /// pair is left to.
    pub(crate) fn update_few(
        &mut self,
        changed: &[u32],
        boxes: &[Aabb],
        comes_first: impl Fn(u32, u32) -> bool,
        kept: &mut PairStore,
        added: impl FnMut(Pair),
        removed: impl FnMut(Pair),
    ) {
        if !self.is_indexed(boxes.len()) {
            return self.update(boxes, kept, added, removed);
        }
        self.walk(self.index.known, boxes);
        let (mut flips, mut tests) = (std::mem::take(&mut self.flips[0]), self.tests);
        for changed in changed.chunks(TOGETHER) {
            self.ask_for(changed, boxes);
            for &id in changed {
                tests[0] += self.index.of(id).len() as u64;
                tests[1] += self.look_up(id, boxes, &comes_first, &mut flips);
            }
        }
        (self.flips[0], self.tests) = (flips, tests);
        self.turn(kept, added, removed);
    }

    /// Tests the pairs of one box; how many overlap.
    fn look_up(
        &self,
        id: u32,
        boxes: &[Aabb],
        comes_first: impl Fn(u32, u32) -> bool,
        flips: &mut Vec<u32>,
    ) -> u64 {
        let mut overlaps = 0;
        for &i in self.index.of(id) {
            let (Pair { a, b }, place) = (self.pairs[i as usize], self.places[i as usize]);
            let now = boxes[a as usize].overlaps(&boxes[b as usize]);
            if now != (place < GONE) && place != GONE && comes_first(id, a ^ b ^ id) {
                flips.push(i);
            }
            overlaps += u64::from(now);
        }
        overlaps
    }

    /// Asks for what the tests of some boxes will read.
    fn ask_for(&self, changed: &[u32], boxes: &[Aabb]) {
        let entries = || changed.iter().flat_map(|id| self.index.of(*id));
        changed.iter().for_each(|id| self.index.starts.get(*id as usize).into_iter().for_each(prefetch));
        changed.iter().for_each(|id| self.index.of(*id).first().into_iter().for_each(prefetch));
        for &i in entries() {
            prefetch(&self.pairs[i as usize]);
            prefetch(&self.places[i as usize]);
        }
        for &i in entries() {
            let Pair { a, b } = self.pairs[i as usize];
            [a, b].into_iter().for_each(|id| prefetch(&boxes[id as usize]));
        }
    }

    /// Whether there is an index, which is made when walks without have cost as much.
    fn is_indexed(&mut self, ids: usize) -> bool {
        let (all, known) = (self.pairs.len(), self.index.known);
        if known > 0 && (all - known) * 4 <= all {
            return true;
        }
        self.walked += all;
        if self.walked <= WALKS * all {
            return false;
        }
        self.walked = 0;
        self.index.make(&self.pairs, &self.places, ids);
        true
    }

    /// The pairs of boxes `ids`, and of no others that `is_one` knows, are no longer near; tells which of them were kept.
    pub(crate) fn remove_of(
        &mut self,
        ids: &[u32],
        is_one: impl Fn(u32) -> bool,
        kept: &mut PairStore,
        mut tell: impl FnMut(Pair),
    ) {
        let known = self.index.known;
        let indexed = if known > 0 { ids } else { &[] };
        for &id in indexed {
            for e in self.index.range(id) {
                self.remove(self.index.entries[e] as usize, kept, &mut tell);
            }
        }
        for i in known..self.pairs.len() {
            let Pair { a, b } = self.pairs[i];
            if is_one(a) | is_one(b) {
                self.remove(i, kept, &mut tell);
            }
        }
        if self.gone * 4 > self.pairs.len() {
            self.compact();
        }
    }

    fn remove(&mut self, i: usize, kept: &mut PairStore, tell: &mut impl FnMut(Pair)) {
        let place = std::mem::replace(&mut self.places[i], GONE);
        if place == GONE {
            return;
        }
        self.gone += 1;
        if place != APART {
            self.free(place, kept);
            tell(self.pairs[i]);
        }
    }

    /// Forgets pairs that are apart, and for which `is_near` does not hold.
    pub(crate) fn retain(&mut self, is_near: impl Fn(Pair) -> bool) {
        for (pair, place) in self.pairs.iter().zip(&mut self.places) {
            if *place == APART && !is_near(*pair) {
                *place = GONE;
            }
        }
        self.compact();
    }

    /// Drops what is gone.
    fn compact(&mut self) {
        let mut n = 0;
        for i in 0..self.pairs.len() {
            let place = self.places[i];
            (self.pairs[n], self.places[n]) = (self.pairs[i], place);
            if place < GONE {
                self.owners[place as usize] = n as u32;
            }
            n += usize::from(place != GONE);
        }
        self.pairs.truncate(n);
        self.places.truncate(n);
        (self.gone, self.index.known) = (0, 0);
    }

    /// Those of the pairs from `first` on whose test ends otherwise than the last time, into `flips`.
    fn walk(&mut self, first: usize, boxes: &[Aabb]) {
        let (pairs, places) = (&self.pairs[first..], &self.places[first..]);
        let pieces = pairs.len().div_ceil(PIECE);
        self.flips.resize(pieces.max(self.flips.len()).max(1), Vec::new());
        self.flips.iter_mut().for_each(Vec::clear);
        let walk = |(i, ((pairs, places), flips)): (usize, (Piece<'_>, &mut Vec<u32>))| -> u64 {
            let blocks = pairs.chunks(BLOCK).zip(places.chunks(BLOCK)).enumerate();
            let first = first + i * PIECE;
            blocks.map(|(k, block)| test(block, (first + k * BLOCK) as u32, boxes, flips)).sum()
        };
        let overlaps: u64 = if pieces > 2 && rayon::current_num_threads() > 1 {
            let all = pairs.par_chunks(PIECE).zip(places.par_chunks(PIECE));
            all.zip(&mut self.flips[..pieces]).enumerate().map(walk).sum()
        } else {
            let all = pairs.chunks(PIECE).zip(places.chunks(PIECE));
            all.zip(&mut self.flips[..pieces]).enumerate().map(walk).sum()
        };
        self.tests = [self.tests[0] + pairs.len() as u64, self.tests[1] + overlaps];
    }

    /// Keeps what was apart and gives up what was kept, of all in `flips`.
    fn turn(&mut self, kept: &mut PairStore, mut added: impl FnMut(Pair), mut removed: impl FnMut(Pair)) {
        let flips = std::mem::take(&mut self.flips);
        for flips in &flips {
            for (k, &i) in flips.iter().enumerate() {
                flips.get(k + AHEAD).into_iter().for_each(|&ahead| self.ask_for_turn(ahead as usize, kept));
                let pair = self.pairs[i as usize];
                match self.places[i as usize] {
                    GONE => {}
                    APART => {
                        self.places[i as usize] = kept.push(pair);
                        self.owners.push(i);
                        added(pair);
                    }
                    place => {
                        self.places[i as usize] = APART;
                        self.free(place, kept);
                        removed(pair);
                    }
                }
            }
        }
        self.flips = flips;
    }

    /// Asks for what it takes to turn a pair.
    #[inline(always)]
    fn ask_for_turn(&self, i: usize, kept: &PairStore) {
        kept.prepare(self.pairs[i]);
        self.owners.get(self.places[i] as usize).into_iter().for_each(prefetch);
    }

    /// Gives up a kept pair; the last one takes its place.
    fn free(&mut self, place: u32, kept: &mut PairStore) {
        kept.swap_remove(place);
        self.owners.swap_remove(place as usize);
        if let Some(&owner) = self.owners.get(place as usize) {
            self.places[owner as usize] = place;
        }
    }
}

/// Of a block of pairs and their places, those whose test ends otherwise than the last time; how many overlap. No branches:
/// what flips is a coin toss.
#[inline(always)]
fn test((pairs, places): Piece<'_>, first: u32, boxes: &[Aabb], flips: &mut Vec<u32>) -> u64 {
    let (mut found, mut count, mut overlaps) = ([0; BLOCK], 0, 0);
    for (i, (&Pair { a, b }, &place)) in pairs.iter().zip(places).enumerate() {
        if let Some(ahead) = pairs.get(i + AHEAD) {
            prefetch(&boxes[ahead.a as usize]);
            prefetch(&boxes[ahead.b as usize]);
        }
        let now = boxes[a as usize].overlaps(&boxes[b as usize]);
        found[count] = first + i as u32;
        count += usize::from(now != (place < GONE));
        overlaps += u64::from(now);
    }
    flips.extend_from_slice(&found[..count]);
    overlaps
}
