//! Pairs of boxes that are near each other: a list as Verlet's (Phys. Rev. 159, 98, 1967).
//!
//! Each box has a *reach*, itself grown by a *skin*. As long as all stay in their reaches, whatever overlaps is among the
//! pairs whose reaches do. So these are found once, and for many updates only they are tested: 3 ns each, where to sort and
//! search costs 60 a box. Pairs that come and go are those whose test ends otherwise than the last time, without a look at
//! what boxes were. (Boxes copied into the order of their pairs, so that those of a pair are near in memory, too, were no
//! faster: the copying took what the tests gained.)
//!
//! While there is such a list, the pairs that exist are those that it has as overlapping, and are nowhere else. Kept in a
//! list of their own beside it, each that came or went took 47 ns.

mod index;
#[cfg(test)]
mod tests;

use crate::cpu::codes::prefetch;
use crate::diff::{AHEAD, Judgement};
use crate::plan::spread_evenly;
use crate::share::{self, has_threads};
use crate::{Aabb, Pair, shared_from};
use index::Index;
use std::ops::Range;

/// What the last test of a pair has said.
const APART: u8 = 0;
const OVERLAP: u8 = 1;

/// The boxes are no longer near.
const GONE: u8 = 2;

/// Pairs of a piece of a walk.
const PIECE: usize = shared_from(16_384);

/// Pairs of a new list that are tested before those that overlap are told: of all at once these would take as much memory as
/// the kept pairs do.
const PORTION: usize = 64 * PIECE;

/// Pairs that are tested before those found are told.
const BLOCK: usize = 1024;

/// Boxes whose pairs are looked up together.
const TOGETHER: usize = 32;

/// Boxes of near pairs of which one has changed, for those of changed boxes to be looked up. Each pair is one of two boxes, and
/// takes five times as long as in a walk that two threads share (37 ns and 7 in a list of 2.5 million).
const RARE: usize = 10;

/// Near pairs that are asked for it.
const SAMPLE: usize = 256;

/// Walks that cost as much as an index.
const WALKS: usize = 3;

/// Some pairs, and their states.
type Piece<'a> = (&'a [Pair], &'a mut [u8]);

/// Near pairs, and which of them overlap: 9 bytes each, 8 more with an index.
#[derive(Clone, Debug, Default)]
pub(crate) struct NearPairs {
    pairs: Vec<Pair>,
    /// Of each: [`APART`], [`OVERLAP`] or [`GONE`].
    states: Vec<u8>,
    overlapping: usize,
    gone: usize,
    index: Index,
    /// Pairs walked for the sake of few boxes.
    walked: usize,
    /// Of each piece of a walk.
    turned: Vec<Turned>,
    /// Tests made since they were asked for, and those that were true.
    tests: [u64; 2],
}

/// Pairs that have begun to overlap, and that have ended.
#[derive(Clone, Debug, Default)]
struct Turned {
    added: Vec<Pair>,
    removed: Vec<Pair>,
}

impl NearPairs {
    pub(crate) fn clear(&mut self) {
        self.pairs.clear();
        self.states.clear();
        (self.overlapping, self.gone, self.walked, self.index.known) = (0, 0, 0, 0);
    }

    /// How many there are.
    pub(crate) fn len(&self) -> usize {
        self.pairs.len() - self.gone
    }

    /// How many of them overlap.
    pub(crate) fn overlapping(&self) -> usize {
        self.overlapping
    }

    /// Those that overlap.
    pub(crate) fn iter(&self) -> impl Iterator<Item = Pair> {
        let all = self.pairs.iter().zip(&self.states);
        all.filter(|(_, state)| **state == OVERLAP).map(|(pair, _)| *pair)
    }

    /// Those of one box that overlap; without an index all are looked at.
    pub(crate) fn of(&self, id: u32) -> impl Iterator<Item = Pair> {
        let known = self.index.of(id).iter().map(|&i| i as usize);
        let all = (self.index.known..self.pairs.len()).filter(move |&i| {
            let Pair { a, b } = self.pairs[i];
            (a == id) | (b == id)
        });
        known.chain(all).filter(|&i| self.states[i] == OVERLAP).map(|i| self.pairs[i])
    }

    /// Tests made since the last time, and how many were true.
    pub(crate) fn take_tests(&mut self) -> [u64; 2] {
        std::mem::take(&mut self.tests)
    }

    /// The pairs that overlap, which `give` puts in the place of those there were.
    pub(crate) fn begin(&mut self, give: impl FnOnce(&mut Vec<Pair>)) {
        self.clear();
        give(&mut self.pairs);
        self.overlapping = self.pairs.len();
        self.states.resize(self.pairs.len(), OVERLAP);
    }

    /// Where a search puts all pairs that are near, instead of those there were, for [`NearPairs::begin_all`].
    pub(crate) fn all(&mut self) -> &mut Vec<Pair> {
        self.clear();
        &mut self.pairs
    }

    /// Pairs that overlap, of all that are near, are told, and those of them that did not before are put into `added`.
    pub(crate) fn begin_all(
        &mut self,
        boxes: &[Aabb],
        before: &impl Judgement,
        mut tell: impl FnMut(&[Pair]),
        added: &mut Vec<Pair>,
    ) {
        self.states.resize(self.pairs.len(), APART);
        for first in (0..self.pairs.len()).step_by(PORTION) {
            let pieces = self.walk(first..self.pairs.len().min(first + PORTION), boxes);
            let turned = self.turned[..pieces].iter_mut();
            share::for_each(pieces > 2 && has_threads(), turned, |turned| turned.find_fresh(before));
            for turned in &self.turned[..pieces] {
                self.overlapping += turned.added.len();
                tell(&turned.added);
                added.extend_from_slice(&turned.removed);
            }
        }
    }

    /// Adds pairs that have come near; those that overlap are told.
    pub(crate) fn extend(&mut self, found: &[Vec<Pair>], boxes: &[Aabb], added: &mut Vec<Pair>) {
        let (first, new) = (self.pairs.len(), found.iter().map(Vec::len).sum::<usize>());
        if self.pairs.capacity().min(self.states.capacity()) - first < new {
            // Not twice as much: this may be most of the memory that there is.
            self.pairs.reserve_exact(new + first / 8);
            self.states.reserve_exact(new + first / 8);
        }
        found.iter().for_each(|pairs| self.pairs.extend_from_slice(pairs));
        self.states.resize(self.pairs.len(), APART);
        let pieces = self.walk(first..self.pairs.len(), boxes);
        // What was apart cannot end.
        self.tell(pieces, added, &mut vec![]);
    }

    /// Tests all near pairs, and tells which have come and which have gone.
    pub(crate) fn update(&mut self, boxes: &[Aabb], added: &mut Vec<Pair>, removed: &mut Vec<Pair>) {
        let pieces = self.walk(0..self.pairs.len(), boxes);
        self.tell(pieces, added, removed);
    }

    /// Whether few near pairs are of boxes that have changed, as far as a sample shows. (How many boxes have changed does not
    /// tell: of a million, 100,000 that drifted had most near pairs, and to look those up took 60 ms where a walk took 20.)
    pub(crate) fn is_rarely_of(&self, has_changed: impl Fn(u32) -> bool) -> bool {
        let (mut of_changed, mut of_any) = (0, 0);
        for i in spread_evenly(self.pairs.len(), SAMPLE).filter(|&i| self.states[i] != GONE) {
            let Pair { a, b } = self.pairs[i];
            of_changed += usize::from(has_changed(a)) + usize::from(has_changed(b));
            of_any += 2;
        }
        of_changed * RARE < of_any
    }

    /// The same, where only the boxes `changed` have. A pair of two of them is turned by the first, and then is as it should.
    pub(crate) fn update_few(
        &mut self,
        changed: &[u32],
        boxes: &[Aabb],
        added: &mut Vec<Pair>,
        removed: &mut Vec<Pair>,
    ) {
        if !self.is_indexed(boxes.len()) {
            return self.update(boxes, added, removed);
        }
        let pieces = self.walk(self.index.known..self.pairs.len(), boxes);
        self.tell(pieces, added, removed);
        for changed in changed.chunks(TOGETHER) {
            self.ask_for(changed, boxes);
            changed.iter().for_each(|&id| self.look_up(id, boxes, added, removed));
        }
    }

    /// Tests the pairs of one box.
    fn look_up(&mut self, id: u32, boxes: &[Aabb], added: &mut Vec<Pair>, removed: &mut Vec<Pair>) {
        for &i in self.index.of(id) {
            let (pair, state) = (self.pairs[i as usize], &mut self.states[i as usize]);
            let now = u8::from(boxes[pair.a as usize].overlaps(&boxes[pair.b as usize]));
            self.tests = [self.tests[0] + 1, self.tests[1] + u64::from(now)];
            if now ^ *state != 1 {
                continue;
            }
            *state = now;
            if now == OVERLAP {
                self.overlapping += 1;
                added.push(pair);
            } else {
                self.overlapping -= 1;
                removed.push(pair);
            }
        }
    }

    /// Asks for what the tests of some boxes will read.
    fn ask_for(&self, changed: &[u32], boxes: &[Aabb]) {
        let entries = || changed.iter().flat_map(|id| self.index.of(*id));
        changed.iter().for_each(|id| self.index.starts.get(*id as usize).into_iter().for_each(prefetch));
        changed.iter().for_each(|id| self.index.of(*id).first().into_iter().for_each(prefetch));
        for &i in entries() {
            prefetch(&self.pairs[i as usize]);
            prefetch(&self.states[i as usize]);
        }
        for &i in entries() {
            let Pair { a, b } = self.pairs[i as usize];
            [a, b].into_iter().for_each(|id| prefetch(&boxes[id as usize]));
        }
    }

    /// Whether there is an index, which is made when walks without have cost as much.
    fn is_indexed(&mut self, ids: usize) -> bool {
        let (all, known) = (self.pairs.len(), self.index.known);
        let is_known = known > 0 && (all - known) * 4 <= all;
        self.walked += if is_known { all - known } else { all };
        if self.walked <= WALKS * all {
            return is_known;
        }
        self.make_index(ids);
        true
    }

    /// Pairs are looked up from now on, where few boxes change.
    pub(crate) fn make_index(&mut self, ids: usize) {
        self.walked = 0;
        self.index.make(&self.pairs, &self.states, ids);
    }

    /// The pairs of boxes `ids`, and of no others that `is_one` knows, are no longer near; those that overlapped go to
    /// `parted`.
    pub(crate) fn remove_of(&mut self, ids: &[u32], is_one: impl Fn(u32) -> bool, parted: &mut Vec<Pair>) {
        let known = self.index.known;
        let indexed = if known > 0 { ids } else { &[] };
        for &id in indexed {
            for e in self.index.range(id) {
                self.remove(self.index.entries[e] as usize, parted);
            }
        }
        for i in known..self.pairs.len() {
            let Pair { a, b } = self.pairs[i];
            if is_one(a) | is_one(b) {
                self.remove(i, parted);
            }
        }
        if self.gone * 4 > self.pairs.len() {
            self.compact();
        }
    }

    fn remove(&mut self, i: usize, parted: &mut Vec<Pair>) {
        let state = std::mem::replace(&mut self.states[i], GONE);
        self.gone += usize::from(state != GONE);
        if state == OVERLAP {
            self.overlapping -= 1;
            parted.push(self.pairs[i]);
        }
    }

    /// Forgets pairs that are apart, and whose reaches no longer overlap.
    pub(crate) fn retain_near(&mut self, reach: &[Aabb]) {
        let forget = |(pairs, states): Piece<'_>| {
            for (i, (pair, state)) in pairs.iter().zip(states).enumerate() {
                if let Some(ahead) = pairs.get(i + AHEAD) {
                    prefetch(&reach[ahead.a as usize]);
                    prefetch(&reach[ahead.b as usize]);
                }
                let is_near = reach[pair.a as usize].overlaps(&reach[pair.b as usize]);
                *state = if (*state == APART) & !is_near { GONE } else { *state };
            }
        };
        let pieces = self.pairs.chunks(PIECE).zip(self.states.chunks_mut(PIECE));
        share::for_each(pieces.len() > 2 && has_threads(), pieces, forget);
        self.compact();
    }

    /// Drops what is gone.
    fn compact(&mut self) {
        let mut n = 0;
        for i in 0..self.pairs.len() {
            let state = self.states[i];
            (self.pairs[n], self.states[n]) = (self.pairs[i], state);
            n += usize::from(state != GONE);
        }
        self.pairs.truncate(n);
        self.states.truncate(n);
        if self.index.known > 0 {
            // It was of use, and will be: the next walk makes another one.
            self.walked = WALKS * n;
        }
        (self.gone, self.index.known) = (0, 0);
    }

    /// Tests some of the pairs, and turns those whose test ends otherwise than the last time, which go into `turned`; how many
    /// pieces that took.
    fn walk(&mut self, some: Range<usize>, boxes: &[Aabb]) -> usize {
        let pieces = self.prepare_pieces(some.len());
        let (pairs, states) = (&self.pairs[some.clone()], &mut self.states[some]);
        let turned = &mut self.turned[..pieces];
        let walk = |((pairs, states), turned): (Piece<'_>, &mut Turned)| -> u64 {
            let blocks = pairs.chunks(BLOCK).zip(states.chunks_mut(BLOCK));
            blocks.map(|block| test(block, boxes, turned)).sum()
        };
        let is_shared = pieces > 2 && has_threads();
        let all = pairs.chunks(PIECE).zip(states.chunks_mut(PIECE)).zip(turned);
        let overlaps = share::sum(is_shared, all, walk, |a, b| a + b);
        self.tests = [self.tests[0] + pairs.len() as u64, self.tests[1] + overlaps];
        pieces
    }

    /// Room for what turns in a walk of so many pairs; how many pieces it has.
    fn prepare_pieces(&mut self, pairs: usize) -> usize {
        let pieces = pairs.div_ceil(PIECE);
        self.turned.resize(pieces.max(self.turned.len()), Turned::default());
        for turned in &mut self.turned[..pieces] {
            turned.added.clear();
            turned.removed.clear();
        }
        pieces
    }

    /// What has turned in so many pieces.
    fn tell(&mut self, pieces: usize, added: &mut Vec<Pair>, removed: &mut Vec<Pair>) {
        for turned in &self.turned[..pieces] {
            self.overlapping += turned.added.len();
            self.overlapping -= turned.removed.len();
            added.extend_from_slice(&turned.added);
            removed.extend_from_slice(&turned.removed);
        }
    }
}

impl Turned {
    /// Those of the added pairs that did not hold before, into `removed`, which a new list has no other use for.
    fn find_fresh(&mut self, before: &impl Judgement) {
        for (k, &pair) in self.added.iter().enumerate() {
            self.added.get(k + AHEAD).into_iter().for_each(|&ahead| before.prepare(ahead));
            self.removed.extend(Some(pair).filter(|pair| !before.holds(*pair)));
        }
    }
}

/// Turns those of a block whose test ends otherwise than the last time; how many overlap. No branches: what turns is a coin
/// toss.
#[inline(always)]
fn test((pairs, states): Piece<'_>, boxes: &[Aabb], turned: &mut Turned) -> u64 {
    let (mut added, mut removed) = ([0u32; BLOCK], [0u32; BLOCK]);
    let (mut come, mut gone, mut overlaps) = (0, 0, 0);
    for (i, (&Pair { a, b }, state)) in pairs.iter().zip(states).enumerate() {
        if let Some(ahead) = pairs.get(i + AHEAD) {
            prefetch(&boxes[ahead.a as usize]);
            prefetch(&boxes[ahead.b as usize]);
        }
        let now = u8::from(boxes[a as usize].overlaps(&boxes[b as usize]));
        let (comes, goes) = (*state < now, (*state == OVERLAP) & (now == APART));
        (added[come], removed[gone]) = (i as u32, i as u32);
        *state = if *state == GONE { GONE } else { now };
        come += usize::from(comes);
        gone += usize::from(goes);
        overlaps += u64::from(now);
    }
    turned.added.extend(added[..come].iter().map(|&i| pairs[i as usize]));
    turned.removed.extend(removed[..gone].iter().map(|&i| pairs[i as usize]));
    overlaps
}
