//! A bitmap index for few boxes: each axis is cut into 64 bands, and each band has a bit for every box.
//!
//! Whoever overlaps a box has a bit in one of its bands on each axis, so the candidates are the AND over axes of the OR
//! over bands: for 256 boxes three rows of four words. Nothing is sorted or planned, and a box that moves within its
//! bands changes no bit.
//!
//! Bands repeat: the number of a band is taken modulo 64, so there are no bounds, and a box far away costs the others
//! nothing. Numbers are monotone in the coordinate (rounding included), so boxes that overlap share a band.

use super::bands::{BANDS, Span, width};
use crate::Aabb;

/// A bit for each of 256 ids.
type Block = [u64; 4];

/// Boxes in a block.
const BLOCK: usize = 256;

/// Most blocks of a row: beyond, rows are longer to read than boxes to sort.
const BLOCKS: usize = 4;

/// Most boxes.
pub(crate) const MOST: usize = BLOCKS * BLOCK;

/// The index.
#[derive(Clone, Debug, Default)]
pub(crate) struct Bitmap {
    /// By axis, band, and ids.
    rows: Vec<Block>,
    /// Blocks of a row: 1, 2 or 4.
    blocks: usize,
    bands_per_unit: [f32; 4],
    /// By id.
    spans: Vec<Span>,
    /// Scratch of a search.
    list: Vec<u32>,
}

impl Bitmap {
    /// Whether the same boxes lie in the same bands.
    #[cfg(test)]
    pub(crate) fn is_like(&self, other: &Self) -> bool {
        self.rows == other.rows && self.spans == other.spans
    }

    /// Whether there is room for so many ids.
    pub(crate) fn holds(&self, ids: usize) -> bool {
        ids <= self.spans.len()
    }

    /// Blocks of a row.
    pub(crate) fn blocks(&self) -> usize {
        self.blocks
    }

    /// Begins anew with these boxes, the index in the list being the id; at most [`MOST`].
    pub(crate) fn build(&mut self, boxes: &[Aabb]) {
        self.blocks = boxes.len().div_ceil(BLOCK).next_power_of_two();
        for axis in 0..3 {
            self.bands_per_unit[axis] = 1.0 / width(boxes, axis);
        }
        self.rows.clear();
        self.rows.resize(3 * BANDS * self.blocks, [0; 4]);
        self.spans.clear();
        self.spans.resize(self.blocks * BLOCK, Span::NONE);
        self.list.resize(self.blocks * BLOCK, 0);
        for (id, aabb) in boxes.iter().enumerate() {
            self.put(id as u32, aabb);
        }
    }

    /// A box, valid or nowhere, is here now.
    #[inline(always)]
    pub(crate) fn put(&mut self, id: u32, aabb: &Aabb) {
        let span = Span::of(aabb, &self.bands_per_unit);
        let known = &mut self.spans[id as usize];
        if *known != span {
            let before = std::mem::replace(known, span);
            self.mark(id, before, false);
            self.mark(id, span, true);
        }
    }

    #[inline(never)]
    fn mark(&mut self, id: u32, span: Span, here: bool) {
        if span.is_none() {
            return;
        }
        for axis in 0..3 {
            let [first, last] = span.ends(axis);
            self.set(axis, first, id, here);
            self.set(axis, last, id, here);
        }
        if span.is_long() {
            span.inner().for_each(|(axis, band)| self.set(axis, band, id, here));
        }
    }

    #[inline(always)]
    fn set(&mut self, axis: usize, band: usize, id: u32, here: bool) {
        let block = &mut self.rows[(axis * BANDS + band) * self.blocks + id as usize / BLOCK];
        let (word, bit) = (&mut block[id as usize / 64 % 4], 1 << (id % 64));
        *word = if here { *word | bit } else { *word & !bit };
    }

    /// A search. `B` is [`Bitmap::blocks`].
    #[inline(always)]
    pub(crate) fn search<const B: usize>(&mut self) -> Search<'_, B> {
        let rows = self.rows.as_chunks().0.try_into().expect("as many as bands");
        Search { rows, spans: &self.spans, list: &mut self.list, extra: 0 }
    }
}

/// A search for the candidates of one box after the other.
pub(crate) struct Search<'a, const B: usize> {
    rows: &'a [[Block; B]; 3 * BANDS],
    spans: &'a [Span],
    list: &'a mut [u32],
    /// Bands between the ends of boxes that were read.
    pub(crate) extra: usize,
}

impl<const B: usize> Search<'_, B> {
    /// The others that may overlap the box; where `higher`, those with higher ids: half of the rows need not be read.
    #[inline(always)]
    pub(crate) fn candidates(&mut self, id: u32, higher: bool) -> &[u32] {
        let span = self.spans[id as usize];
        if span.is_none() {
            return &[];
        }
        let (mut count, is_long, own) = (0, span.is_long(), id as usize / BLOCK);
        for i in if higher { own } else { 0 }..B {
            let mut near = if is_long { self.near_long(span, i) } else { self.near(span, i) };
            if i == own {
                near = and(near, others(id % BLOCK as u32, higher));
            }
            if near != [0; 4] {
                count = list(near[0], i * BLOCK, self.list, count);
                count = list(near[1], i * BLOCK + 64, self.list, count);
                count = list(near[2], i * BLOCK + 128, self.list, count);
                count = list(near[3], i * BLOCK + 192, self.list, count);
            }
        }
        &self.list[..count]
    }

    /// Who shares a band with the box on each axis, of one block. No branch tells boxes in one band from those in two.
    #[inline(always)]
    fn near(&self, span: Span, i: usize) -> Block {
        and(and(self.at_ends(span, 0, i), self.at_ends(span, 1, i)), self.at_ends(span, 2, i))
    }

    #[inline(always)]
    fn at_ends(&self, span: Span, axis: usize, i: usize) -> Block {
        let [first, last] = span.ends(axis);
        let (first, last) = (axis * BANDS + first % BANDS, axis * BANDS + last % BANDS);
        or(self.rows[first][i], self.rows[last][i])
    }

    /// As [`Search::near`], of a box with bands between its ends.
    #[cold]
    fn near_long(&mut self, span: Span, i: usize) -> Block {
        let mut any = [self.at_ends(span, 0, i), self.at_ends(span, 1, i), self.at_ends(span, 2, i)];
        for (axis, band) in span.inner() {
            any[axis] = or(any[axis], self.rows[axis * BANDS + band][i]);
            self.extra += 1;
        }
        and(and(any[0], any[1]), any[2])
    }
}

// Loops: `map` and `from_fn` of arrays were calls, 20 ns a box.

#[inline(always)]
fn or(mut a: Block, b: Block) -> Block {
    for w in 0..4 {
        a[w] |= b[w];
    }
    a
}

#[inline(always)]
fn and(mut a: Block, b: Block) -> Block {
    for w in 0..4 {
        a[w] &= b[w];
    }
    a
}

/// All bits but this one; where `higher`, those after it. (A block with a bit for each box that was looked up already
/// did that too, but to read what had just been written took 10 ns.)
#[inline(always)]
fn others(bit: u32, higher: bool) -> Block {
    let (word, own) = (u64::from(bit / 64), 1 << (bit % 64));
    let mut others = [0, 1, 2, 3];
    for k in &mut others {
        *k = if *k == word {
            !(if higher { own | (own - 1) } else { own })
        } else if *k > word || !higher {
            u64::MAX
        } else {
            0
        };
    }
    others
}

/// Appends the number of each bit that is set, counted from `first`; returns how many there are then. (Words, not the
/// block: as an argument that would lie in memory all the time.)
#[inline(always)]
fn list(mut word: u64, first: usize, list: &mut [u32], mut count: usize) -> usize {
    while word != 0 {
        list[count] = first as u32 + word.trailing_zeros();
        word &= word - 1;
        count += 1;
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// Numbers from 0 to 1, the same ones every time.
    struct Random(u64);

    impl Random {
        fn next(&mut self) -> f32 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 40) as f32 / (1u64 << 24) as f32
        }

        /// Mostly small boxes in a small world; some flat, huge, infinite, far away, or nowhere.
        fn aabb(&mut self) -> Aabb {
            let center = [self.next() * 20.0, self.next() * 20.0, self.next() * 5.0];
            let small = Aabb::from_center(center, [self.next(), self.next(), 0.5]);
            match (self.next() * 40.0) as u32 {
                0 => Aabb::NOWHERE,
                1 => Aabb::new([f32::NEG_INFINITY; 3], [f32::INFINITY; 3]),
                2 => Aabb::new([-0.5 * f32::MAX; 3], [0.5 * f32::MAX, center[1], 3.0]),
                3 => Aabb::from_center(center.map(|x| x * 1e30), [1e29; 3]),
                4 => Aabb::from_center(center, [0.0; 3]),
                5 => Aabb::from_center(center, [30.0, 0.1, 0.1]),
                6 => Aabb::new([f32::INFINITY; 3], [f32::INFINITY; 3]),
                7 => Aabb::from_center(center.map(|x| x - 1e6), [1.0; 3]),
                _ => small,
            }
        }
    }

    /// All candidates of all boxes, each pair as found.
    fn all(bitmap: &mut Bitmap, ids: usize, higher: bool) -> Vec<(u32, u32)> {
        fn with<const B: usize>(bitmap: &mut Bitmap, ids: usize, higher: bool) -> Vec<(u32, u32)> {
            let mut search = bitmap.search::<B>();
            let of = |id: u32| -> Vec<(u32, u32)> {
                search.candidates(id, higher).iter().map(|&other| (id, other)).collect()
            };
            (0..ids as u32).flat_map(of).collect()
        }
        match bitmap.blocks() {
            1 => with::<1>(bitmap, ids, higher),
            2 => with::<2>(bitmap, ids, higher),
            _ => with::<4>(bitmap, ids, higher),
        }
    }

    #[test]
    fn every_overlapping_pair_is_a_candidate_once_each_way_wherever_boxes_have_moved() {
        for ids in [1, 2, 64, 65, 256, 257, 500, 513, 1024] {
            let mut random = Random(ids as u64);
            let mut boxes: Vec<Aabb> = (0..ids).map(|_| random.aabb()).collect();
            let mut bitmap = Bitmap::default();
            bitmap.build(&boxes);
            for round in 0..4 {
                let found = all(&mut bitmap, ids, false);
                let both: BTreeSet<_> = found.iter().copied().collect();
                assert_eq!(both.len(), found.len(), "twice");
                assert!(found.iter().all(|(id, other)| id != other && both.contains(&(*other, *id))));
                let higher: BTreeSet<_> = all(&mut bitmap, ids, true).into_iter().collect();
                assert_eq!(higher, both.iter().copied().filter(|(id, other)| id < other).collect());
                for a in 0..ids {
                    for b in (0..ids).filter(|&b| a != b && boxes[a].overlaps(&boxes[b])) {
                        assert!(both.contains(&(a as u32, b as u32)), "{ids} boxes, round {round}: {a} {b}");
                    }
                }
                for id in (0..ids).filter(|id| round == 0 || id % 3 == 0) {
                    boxes[id] = random.aabb();
                    bitmap.put(id as u32, &boxes[id]);
                }
            }
        }
    }

    #[test]
    fn boxes_leave_no_bits_behind() {
        let mut random = Random(7);
        let boxes: Vec<Aabb> = (0..300).map(|_| random.aabb()).collect();
        let mut bitmap = Bitmap::default();
        bitmap.build(&boxes);
        let fresh = bitmap.rows.clone();
        for change in [|_: &Aabb, new: Aabb| new, |_: &Aabb, _| Aabb::NOWHERE, |old: &Aabb, _| *old] {
            boxes.iter().enumerate().for_each(|(i, aabb)| bitmap.put(i as u32, &change(aabb, random.aabb())));
        }
        assert!(bitmap.rows == fresh, "back where they were");
        (0..300).for_each(|id| bitmap.put(id, &Aabb::NOWHERE));
        assert!(bitmap.rows.iter().all(|block| *block == [0; 4]));
    }

    #[test]
    fn few_boxes_are_candidates_whatever_the_scale_and_however_far_some_are() {
        for (scale, shift) in [(1.0, 0.0), (1e-6, 0.0), (1e9, 0.0), (1.0, 1e4)] {
            let mut random = Random(3);
            let mut at = || [0; 3].map(|_| (shift + random.next() * 30.0) * scale);
            let mut boxes: Vec<Aabb> = (0..1000).map(|_| Aabb::from_center(at(), [0.3 * scale; 3])).collect();
            boxes[5] = Aabb::from_center([1e25 * scale; 3], [scale; 3]);
            boxes[6] = Aabb::new([-1e30; 3], [1e30; 3]);
            let mut bitmap = Bitmap::default();
            bitmap.build(&boxes);
            let (higher, ids) = (true, boxes.len());
            let candidates = all(&mut bitmap, ids, higher).len();
            assert!(candidates < 4 * ids, "{candidates} at scale {scale}, shift {shift}");
        }
    }
}
