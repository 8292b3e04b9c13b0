//! Kernels of the inner loops, for every instruction set.

use super::codes::{APART, SET_BITS, TOMBSTONE};
use super::{BLOCK, Eight, EightBoxes, Primitives};
use crate::Aabb;

/// Kernels of the inner loops.
pub(crate) trait Simd: Primitives {
    /// Returns a bit for each of eight codes: set if the two boxes may overlap. Tombstones never do.
    #[inline(always)]
    fn test(self, query: u64, codes: &[u64; BLOCK]) -> u32 {
        self.lacks_bits(query, APART | TOMBSTONE, codes)
    }

    /// Writes `query` and a place, `first + bit`, for each set bit of `mask`, and any numbers behind them. Returns the number of set bits.
    #[inline(always)]
    fn expand(self, query: u32, first: u32, mask: u32, queries: &mut Eight, places: &mut Eight) -> usize {
        let found = self.widen(SET_BITS[mask as usize & 255]);
        *queries = self.store(self.splat(query));
        *places = self.store(self.add(self.splat(first), found));
        mask.count_ones() as usize
    }

    /// Returns the first `len` (at most 8) numbers of a row, sorted, and any numbers behind them.
    #[inline(always)]
    fn sorted_short(self, row: &Eight, len: usize) -> Eight {
        self.store(self.sorted(limited(self, row, len)))
    }

    /// Returns true if the first `len` (at most 8) numbers of two rows are the same.
    #[inline(always)]
    fn same_short(self, one: &Eight, other: &Eight, len: usize) -> bool {
        let same = self.bits(self.equal(self.load(one), self.load(other)));
        !same & ((1 << len) - 1) == 0
    }

    /// Returns a bit for each number that is not among the first `len` (at most 8) others.
    #[inline(always)]
    fn absent(self, numbers: &Eight, others: &Eight, len: usize) -> u32 {
        let (numbers, next) = (self.load(numbers), self.load(&[1, 2, 3, 4, 5, 6, 7, 0]));
        // The largest number is not an id.
        let mut others = limited(self, others, len);
        let mut found = self.equal(numbers, others);
        for _ in 1..BLOCK {
            others = self.permute(others, next);
            found = self.or(found, self.equal(numbers, others));
        }
        !self.bits(found) & 255
    }

    /// Returns eight boxes of a list. An invalid one, and one that is not in the list, becomes an empty box: from infinity to minus infinity.
    #[inline(always)]
    fn gather(self, list: &[Aabb], at: &Eight) -> EightBoxes {
        let mut boxes = [&Aabb::NOWHERE; BLOCK];
        for lane in 0..BLOCK {
            boxes[lane] = list.get(at[lane] as usize).unwrap_or(&Aabb::NOWHERE);
        }
        let rows = self.transpose(boxes);
        let valid = self.and(
            self.and(self.at_most_f32(rows[0], rows[3]), self.at_most_f32(rows[1], rows[4])),
            self.at_most_f32(rows[2], rows[5]),
        );
        let empty = [self.splat(f32::INFINITY.to_bits()), self.splat(f32::NEG_INFINITY.to_bits())];
        let mut eight = [[0.0; BLOCK]; 6];
        for k in 0..6 {
            eight[k] = bytemuck::cast(self.store(self.select(valid, rows[k], empty[k / 3])));
        }
        eight
    }

    /// Returns the box around eight boxes; an empty one around empty ones.
    #[inline(always)]
    fn around(self, boxes: &EightBoxes) -> Aabb {
        let low = [floats(self, &boxes[0]), floats(self, &boxes[1]), floats(self, &boxes[2])];
        let high = [floats(self, &boxes[3]), floats(self, &boxes[4]), floats(self, &boxes[5])];
        Aabb::new(self.lowest(low), self.highest(high))
    }

    /// Returns the lane of the least of those keys that are at most their limit. Keys are not negative. Of keys that differ in their last
    /// three bits alone the first one counts as the least.
    #[inline(always)]
    fn nearest(self, keys: &[f32; BLOCK], limits: &[f32; BLOCK]) -> Option<usize> {
        let least = self.least(words(self, keys, limits));
        (least != u32::MAX).then_some(least as usize % BLOCK)
    }

    /// Sorts the keys that are at most their limit, with their values: the largest one first, and [`Simd::nearest`] last. Returns both
    /// rows, with any numbers behind the sorted ones, and the number of these keys.
    #[inline(always)]
    fn farthest_first(
        self,
        keys: &[f32; BLOCK],
        limits: &[f32; BLOCK],
        values: &Eight,
    ) -> ([f32; BLOCK], Eight, usize) {
        let (words, all_bits) = (words(self, keys, limits), self.splat(u32::MAX));
        let beyond = self.equal(words, all_bits);
        let count = BLOCK - self.bits(beyond).count_ones() as usize;
        // The largest word is to be first.
        let order = self.not(self.sorted(self.or(self.not(words), beyond)));
        let keys = self.store(self.permute(floats(self, keys), order));
        (bytemuck::cast(keys), self.store(self.permute(self.load(values), order)), count)
    }

    /// Returns a bit for each of eight numbers that is at most the other one.
    #[inline(always)]
    fn at_most(self, numbers: &[f32; BLOCK], others: &[f32; BLOCK]) -> u32 {
        self.bits(self.at_most_f32(floats(self, numbers), floats(self, others)))
    }

    /// Returns a bit for each of eight boxes that overlaps a box.
    #[inline(always)]
    fn overlaps_eight(self, boxes: &EightBoxes, aabb: &Aabb) -> u32 {
        let mut overlaps = self.splat(u32::MAX);
        for k in 0..3 {
            let (min, max) = (floats(self, &boxes[k]), floats(self, &boxes[k + 3]));
            let below = self.at_most_f32(self.splat(aabb.min[k].to_bits()), max);
            let above = self.at_most_f32(min, self.splat(aabb.max[k].to_bits()));
            overlaps = self.and(overlaps, self.and(below, above));
        }
        self.bits(overlaps)
    }
}

impl<P: Primitives> Simd for P {}

/// Reads eight floats.
#[inline(always)]
fn floats<P: Primitives>(simd: P, row: &[f32; BLOCK]) -> P::Row {
    simd.load(bytemuck::cast_ref(row))
}

/// Reads the first `len` numbers of a row. The largest number takes the place of the others.
#[inline(always)]
fn limited<P: Primitives>(simd: P, row: &Eight, len: usize) -> P::Row {
    let behind = simd.load(&BEHIND[len]);
    simd.or(simd.load(row), behind)
}

/// By length: all bits in each lane that lies behind.
static BEHIND: [Eight; BLOCK + 1] = {
    let mut masks = [[0; BLOCK]; BLOCK + 1];
    let mut i = 0;
    while i < BLOCK * BLOCK {
        masks[i / BLOCK][i % BLOCK] = if i % BLOCK < i / BLOCK { 0 } else { u32::MAX };
        i += 1;
    }
    masks
};

/// Returns words in the order of eight keys with the lane in the last bits: all bits for a key beyond its limit.
#[inline(always)]
fn words<P: Primitives>(simd: P, keys: &[f32; BLOCK], limits: &[f32; BLOCK]) -> P::Row {
    let keys = floats(simd, keys);
    let word = simd.or(simd.and(keys, simd.splat(!7)), simd.load(&[0, 1, 2, 3, 4, 5, 6, 7]));
    simd.select(simd.at_most_f32(keys, floats(simd, limits)), word, simd.splat(u32::MAX))
}
