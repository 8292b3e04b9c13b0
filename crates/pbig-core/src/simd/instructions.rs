//! The primitives of an instruction set, and the kernels of the inner loops on them.

use super::codes::{self, APART, SET_BITS, TOMBSTONE};
use super::{BLOCK, Eight, EightBoxes, Steps};
use crate::Aabb;

/// Instructions of a processor: primitives, and kernels on these, which an instruction set may have in another way. A value is a proof that the
/// processor has the instructions.
pub(crate) trait Simd: Copy {
    /// Eight numbers of 32 bits: integers, floats by their bits, or a mask, in which all bits of a lane are equal.
    type Row: Copy;

    /// Calls a function that is inlined here, compiled for the instructions.
    fn run<T>(self, work: impl FnOnce() -> T) -> T;

    fn load(self, row: &Eight) -> Self::Row;

    /// Returns the eight numbers of a row.
    fn store(self, row: Self::Row) -> Eight;

    /// Returns a row of eight equal numbers.
    fn splat(self, number: u32) -> Self::Row;

    /// Returns the eight bytes of a word as numbers.
    fn widen(self, bytes: u64) -> Self::Row;

    /// Adds integers, and wraps.
    fn add(self, a: Self::Row, b: Self::Row) -> Self::Row;

    /// Returns the bits that are set in both rows.
    fn and(self, a: Self::Row, b: Self::Row) -> Self::Row;

    /// Returns the bits that are set in one row at least.
    fn or(self, a: Self::Row, b: Self::Row) -> Self::Row;

    /// Returns the bits that are not set.
    fn not(self, a: Self::Row) -> Self::Row;

    /// Returns the lesser integers, without sign.
    fn min(self, a: Self::Row, b: Self::Row) -> Self::Row;

    /// Returns the greater integers, without sign.
    fn max(self, a: Self::Row, b: Self::Row) -> Self::Row;

    /// Returns a mask of the integers that are equal.
    fn equal(self, a: Self::Row, b: Self::Row) -> Self::Row;

    /// Returns a mask of the floats that are at most the other one. No number is at most a NaN.
    fn at_most_f32(self, a: Self::Row, b: Self::Row) -> Self::Row;

    /// Returns the numbers of one row where a mask is set, and those of another elsewhere.
    fn select(self, mask: Self::Row, set: Self::Row, unset: Self::Row) -> Self::Row;

    /// Returns the numbers that lie in the named lanes. Only the last three bits of a name count.
    fn permute(self, row: Self::Row, lanes: Self::Row) -> Self::Row;

    /// Returns a bit for each lane of a mask.
    fn bits(self, mask: Self::Row) -> u32;

    /// Returns the least of eight integers, without sign.
    fn least(self, row: Self::Row) -> u32;

    /// Adds a number to each of eight codes. Returns a bit for each sum that has none of `bits`.
    fn lacks_bits(self, add: u64, bits: u64, codes: &[u64; BLOCK]) -> u32;

    /// Returns eight boxes axis by axis.
    fn transpose(self, boxes: [&Aabb; BLOCK]) -> [Self::Row; 6];

    /// Returns the box around eight boxes; an empty one around empty ones. No number is a NaN.
    fn around(self, boxes: &EightBoxes) -> Aabb;

    /// Returns both corners of a box in steps: `scale` of them in a length unit, from `origin` on.
    #[inline(always)]
    fn steps(self, origin: &[f64; 4], scale: &[f64; 4], aabb: &Aabb) -> (Steps, Steps) {
        (codes::steps(origin, scale, &aabb.min), codes::steps(origin, scale, &aabb.max))
    }

    /// Returns the number, row by row, of the cell of a point. A cell has `1 << shift` steps, and there are `dims` of them by axis. The
    /// point is wrapped into these, or clamped into those that have neighbours on both sides.
    #[inline(always)]
    fn key(self, dims: [i32; 3], shift: u32, wraps: bool, point: Steps) -> u32 {
        let mut cell = point.map(|step| step >> shift);
        for k in 0..3 {
            cell[k] = if wraps { cell[k] & (dims[k] - 1) } else { cell[k].clamp(1, dims[k] - 2) };
        }
        ((cell[2] * dims[1] + cell[1]) * dims[0] + cell[0]) as u32
    }

    /// Returns true for a valid box with these extents at most.
    #[inline(always)]
    fn fits(self, most: &[f32; 3], aabb: &Aabb) -> bool {
        let extent: [f32; 3] = std::array::from_fn(|k| aabb.max[k] - aabb.min[k]);
        let fits = |k: usize| (extent[k] >= 0.0) & (extent[k] <= most[k]);
        fits(0) & fits(1) & fits(2)
    }

    /// Returns the code of a box: `-low` and `high` on each axis, modulo 512 steps, ten bits a field.
    #[inline(always)]
    fn code(self, low: Steps, high: Steps) -> u64 {
        let half = |of: Steps| {
            let field = |k: usize| (of[k] as u32 & 511) << (10 * k);
            field(0) | field(1) | field(2)
        };
        u64::from(half(low.map(i32::wrapping_neg))) | u64::from(half(high)) << 32
    }

    /// Returns eight integers, sorted, by a network of six steps.
    #[inline(always)]
    fn sorted(self, row: Self::Row) -> Self::Row {
        const PAIRS: [Eight; 2] = [[1, 0, 3, 2, 5, 4, 7, 6], upper(0b1010_1010)];
        const TWOS: [Eight; 2] = [[2, 3, 0, 1, 6, 7, 4, 5], upper(0b1100_1100)];
        const FOURS: [Eight; 2] = [[3, 2, 1, 0, 7, 6, 5, 4], upper(0b1100_1100)];
        const EIGHT: [Eight; 2] = [[7, 6, 5, 4, 3, 2, 1, 0], upper(0b1111_0000)];
        let row = exchange(self, exchange(self, row, &PAIRS), &FOURS);
        let row = exchange(self, exchange(self, row, &PAIRS), &EIGHT);
        exchange(self, exchange(self, row, &TWOS), &PAIRS)
    }

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

/// Returns a mask of the lanes whose bits are set.
const fn upper(bits: u32) -> Eight {
    let (mut mask, mut lane) = ([0; BLOCK], 0);
    while lane < BLOCK {
        mask[lane] = (bits >> lane & 1).wrapping_neg();
        lane += 1;
    }
    mask
}

/// Compares each number with a partner's: the upper lanes get the greater one, the others the lesser one.
#[inline(always)]
fn exchange<S: Simd>(simd: S, row: S::Row, [partners, upper]: &[Eight; 2]) -> S::Row {
    let other = simd.permute(row, simd.load(partners));
    simd.select(simd.load(upper), simd.max(row, other), simd.min(row, other))
}

#[inline(always)]
fn floats<S: Simd>(simd: S, row: &[f32; BLOCK]) -> S::Row {
    simd.load(bytemuck::cast_ref(row))
}

/// Reads the first `len` numbers of a row. The largest number takes the place of the others.
#[inline(always)]
fn limited<S: Simd>(simd: S, row: &Eight, len: usize) -> S::Row {
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
fn words<S: Simd>(simd: S, keys: &[f32; BLOCK], limits: &[f32; BLOCK]) -> S::Row {
    let keys = floats(simd, keys);
    let word = simd.or(simd.and(keys, simd.splat(!7)), simd.load(&[0, 1, 2, 3, 4, 5, 6, 7]));
    simd.select(simd.at_most_f32(keys, floats(simd, limits)), word, simd.splat(u32::MAX))
}
