//! Primitives in plain Rust, which a compiler turns into whatever vectors its target has.

use super::{BLOCK, Eight, EightBoxes, Simd, lanewise};
use crate::Aabb;

#[derive(Clone, Copy)]
pub(crate) struct Portable;

#[inline(always)]
fn zip(a: Eight, b: Eight, of: impl Fn(u32, u32) -> u32) -> Eight {
    let mut row = [0; BLOCK];
    (0..BLOCK).for_each(|lane| row[lane] = of(a[lane], b[lane]));
    row
}

/// Folds eight floats in halves: one after the other takes twice as long.
#[inline(always)]
fn fold(row: &[f32; BLOCK], of: impl Fn(f32, f32) -> f32) -> f32 {
    let mut four = [0.0; 4];
    (0..4).for_each(|i| four[i] = of(row[i], row[i + 4]));
    of(of(four[0], four[2]), of(four[1], four[3]))
}

impl Simd for Portable {
    type Row = Eight;

    /// Not inlined beside the code for other instructions.
    #[inline(never)]
    fn run<T>(self, work: impl FnOnce() -> T) -> T {
        work()
    }

    #[inline(always)]
    fn load(self, row: &Eight) -> Eight {
        *row
    }

    #[inline(always)]
    fn store(self, row: Eight) -> Eight {
        row
    }

    #[inline(always)]
    fn splat(self, number: u32) -> Eight {
        [number; BLOCK]
    }

    #[inline(always)]
    fn widen(self, bytes: u64) -> Eight {
        bytes.to_le_bytes().map(u32::from)
    }

    lanewise! { Eight:
        add(a, b) => zip(a, b, u32::wrapping_add);
        and(a, b) => zip(a, b, |a, b| a & b);
        or(a, b) => zip(a, b, |a, b| a | b);
        min(a, b) => zip(a, b, u32::min);
        max(a, b) => zip(a, b, u32::max);
        equal(a, b) => zip(a, b, |a, b| u32::from(a == b).wrapping_neg());
        at_most_f32(a, b) => zip(a, b, |a, b| u32::from(f32::from_bits(a) <= f32::from_bits(b)).wrapping_neg());
    }

    #[inline(always)]
    fn not(self, a: Eight) -> Eight {
        a.map(|a| !a)
    }

    #[inline(always)]
    fn select(self, mask: Eight, set: Eight, unset: Eight) -> Eight {
        self.or(self.and(mask, set), self.and(self.not(mask), unset))
    }

    #[inline(always)]
    fn permute(self, row: Eight, lanes: Eight) -> Eight {
        lanes.map(|lane| row[lane as usize % BLOCK])
    }

    #[inline(always)]
    fn bits(self, mask: Eight) -> u32 {
        (0..BLOCK).fold(0, |bits, lane| bits | (mask[lane] & 1) << lane)
    }

    #[inline(always)]
    fn least(self, row: Eight) -> u32 {
        row.into_iter().fold(u32::MAX, u32::min)
    }

    #[inline(always)]
    fn lacks_bits(self, add: u64, bits: u64, codes: &[u64; BLOCK]) -> u32 {
        let lacks = |code: u64| add.wrapping_add(code) & bits == 0;
        (0..BLOCK).fold(0, |bits, lane| bits | u32::from(lacks(codes[lane])) << lane)
    }

    #[inline(always)]
    fn transpose(self, boxes: [&Aabb; BLOCK]) -> [Eight; 6] {
        let mut rows = [[0; BLOCK]; 6];
        for lane in 0..BLOCK {
            for k in 0..3 {
                rows[k][lane] = boxes[lane].min[k].to_bits();
                rows[k + 3][lane] = boxes[lane].max[k].to_bits();
            }
        }
        rows
    }

    #[inline(always)]
    fn around(self, boxes: &EightBoxes) -> Aabb {
        let low = |k: usize| fold(&boxes[k], |a, b| if a < b { a } else { b });
        let high = |k: usize| fold(&boxes[k], |a, b| if a > b { a } else { b });
        Aabb::new([low(0), low(1), low(2)], [high(3), high(4), high(5)])
    }

    #[inline(always)]
    fn sorted(self, mut row: Eight) -> Eight {
        row.sort_unstable();
        row
    }

    /// Sorts no more than it has to, as the next ones do.
    #[inline(always)]
    fn sorted_short(self, row: &Eight, len: usize) -> Eight {
        let mut sorted = *row;
        sorted[..len].sort_unstable();
        sorted
    }

    #[inline(always)]
    fn nearest(self, keys: &[f32; BLOCK], limits: &[f32; BLOCK]) -> Option<usize> {
        let lanes = (0..BLOCK).filter(|lane| keys[*lane] <= limits[*lane]);
        lanes.min_by_key(|lane| word(keys, *lane))
    }

    #[inline(always)]
    fn farthest_first(
        self,
        keys: &[f32; BLOCK],
        limits: &[f32; BLOCK],
        values: &Eight,
    ) -> ([f32; BLOCK], Eight, usize) {
        let (mut order, mut count) = ([0; BLOCK], 0);
        for lane in (0..BLOCK).filter(|lane| keys[*lane] <= limits[*lane]) {
            let mut at = count;
            while at > 0 && word(keys, order[at - 1]) < word(keys, lane) {
                order[at] = order[at - 1];
                at -= 1;
            }
            (order[at], count) = (lane, count + 1);
        }
        (order.map(|lane| keys[lane]), order.map(|lane| values[lane]), count)
    }

    #[inline(always)]
    fn overlaps_eight(self, boxes: &EightBoxes, aabb: &Aabb) -> u32 {
        let mut overlaps = [1; BLOCK];
        for k in 0..3 {
            for lane in 0..BLOCK {
                let meets = (aabb.min[k] <= boxes[k + 3][lane]) & (boxes[k][lane] <= aabb.max[k]);
                overlaps[lane] &= u32::from(meets);
            }
        }
        (0..BLOCK).fold(0, |mask, lane| mask | overlaps[lane] << lane)
    }
}

/// Returns an integer in the order of keys that are not negative. Its last bits are the lane, so that no two are equal.
#[inline(always)]
fn word(keys: &[f32; BLOCK], lane: usize) -> u32 {
    keys[lane].to_bits() & !(BLOCK as u32 - 1) | lane as u32
}

/// Does nothing: no stable function brings a line into the cache here.
#[cfg(not(target_arch = "x86_64"))]
#[inline(always)]
pub(crate) fn prefetch<T>(_: *const T) {}
