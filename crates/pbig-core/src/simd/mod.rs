//! The inner loops' instructions: AVX2 where the processor has it, chosen at run time; plain Rust elsewhere.

#[cfg(target_arch = "x86_64")]
mod avx2;
mod codes;

use crate::Aabb;
#[cfg(target_arch = "x86_64")]
pub(crate) use avx2::Avx2;
use codes::{APART, code_portable, steps_portable};
pub(crate) use codes::{Steps, TOMBSTONE, query_of};

/// Codes tested together: a cache line of them.
pub(crate) const BLOCK: usize = 8;

/// Eight boxes axis by axis: three rows of lower corners, three of upper ones.
pub(crate) type EightBoxes = [[f32; BLOCK]; 6];

/// A register of ids or places.
pub(crate) type Eight = [u32; BLOCK];

/// One implementation of the inner loops. A value is a proof that the processor has the instructions.
pub(crate) trait Simd: Copy {
    /// Returns both corners of a box in steps: `scale` of them in a length unit, from `origin` on.
    fn steps(self, origin: &[f64; 4], scale: &[f64; 4], aabb: &Aabb) -> (Steps, Steps);

    /// Returns the number, row by row, of the cell of a point. A cell has `1 << shift` steps, and there are `dims` of them by axis. The
    /// point is wrapped into these, or clamped into those that have neighbours on both sides.
    fn key(self, dims: [i32; 3], shift: u32, wraps: bool, point: Steps) -> u32;

    /// Returns true for a valid box with these extents at most.
    fn fits(self, most: &[f32; 3], aabb: &Aabb) -> bool;

    /// Returns the code of a box.
    fn code(self, low: Steps, high: Steps) -> u64;

    /// Returns a bit for each of eight codes: set if the two boxes may overlap. Tombstones never do.
    fn test(self, query: u64, codes: &[u64; BLOCK]) -> u32;

    /// Writes `query` and the places `first + bit` of the set bits of `mask`, any numbers behind them, and returns how many.
    fn expand(self, query: u32, first: u32, mask: u32, queries: &mut Eight, places: &mut Eight) -> usize;

    /// Returns the first `len` (at most 8) numbers of a row, sorted, and any numbers behind them.
    fn sorted_short(self, row: &Eight, len: usize) -> Eight;

    /// Returns true if the first `len` (at most 8) numbers of two rows are the same.
    fn same_short(self, one: &Eight, other: &Eight, len: usize) -> bool;

    /// Returns a bit for each number that is not among the first `len` (at most 8) others.
    fn absent(self, numbers: &Eight, others: &Eight, len: usize) -> u32;

    /// Returns eight boxes of a list. An invalid one, and one that is not in the list, becomes an empty box: from infinity to minus infinity.
    fn gather(self, list: &[Aabb], at: &Eight) -> EightBoxes;

    /// Returns the box around eight boxes; an empty one around empty ones.
    fn around(self, boxes: &EightBoxes) -> Aabb;

    /// Returns the lane of the least of those keys that are at most their limit. Keys are not negative. Of keys that differ in their last
    /// three bits alone the first one counts as the least.
    fn nearest(self, keys: &[f32; BLOCK], limits: &[f32; BLOCK]) -> Option<usize>;

    /// Returns those keys that are at most their limit, and their values, the largest key first and that of [`Simd::nearest`] last, any
    /// others behind them, and their number.
    fn farthest_first(
        self,
        keys: &[f32; BLOCK],
        limits: &[f32; BLOCK],
        values: &Eight,
    ) -> ([f32; BLOCK], Eight, usize);

    /// Returns a bit for each of eight numbers that is at most the other one.
    fn at_most(self, numbers: &[f32; BLOCK], others: &[f32; BLOCK]) -> u32;

    /// Returns a bit for each of eight boxes that overlaps a box.
    fn overlaps_eight(self, boxes: &EightBoxes, aabb: &Aabb) -> u32;
}

/// Borrows eight numbers of a list, from a place on.
#[inline(always)]
pub(crate) fn eight_from(list: &mut [u32], from: usize) -> &mut Eight {
    list[from..].first_chunk_mut().expect("lists have room for a block more")
}

/// Any processor.
#[derive(Clone, Copy)]
pub(crate) struct Portable;

impl Portable {
    /// Calls a function that is inlined here, and not beside the code for other instructions.
    #[inline(never)]
    pub(crate) fn run<T>(self, work: impl FnOnce() -> T) -> T {
        work()
    }
}

impl Simd for Portable {
    #[inline(always)]
    fn steps(self, origin: &[f64; 4], scale: &[f64; 4], aabb: &Aabb) -> (Steps, Steps) {
        steps_portable(origin, scale, aabb)
    }

    #[inline(always)]
    fn key(self, dims: [i32; 3], shift: u32, wraps: bool, point: Steps) -> u32 {
        let [x, y, z] = std::array::from_fn(|k| {
            let cell = point[k] >> shift;
            if wraps { cell & (dims[k] - 1) } else { cell.clamp(1, dims[k] - 2) }
        });
        ((z * dims[1] + y) * dims[0] + x) as u32
    }

    #[inline(always)]
    fn fits(self, most: &[f32; 3], aabb: &Aabb) -> bool {
        let fits = |k: usize| {
            let extent = aabb.max[k] - aabb.min[k];
            (extent >= 0.0) & (extent <= most[k])
        };
        fits(0) & fits(1) & fits(2)
    }

    #[inline(always)]
    fn code(self, low: Steps, high: Steps) -> u64 {
        code_portable(low, high)
    }

    #[inline(always)]
    fn test(self, query: u64, codes: &[u64; BLOCK]) -> u32 {
        let may_overlap = |code: u64| query.wrapping_add(code) & (APART | TOMBSTONE) == 0;
        (0..BLOCK).fold(0, |mask, bit| mask | u32::from(may_overlap(codes[bit])) << bit)
    }

    #[inline(always)]
    fn expand(self, query: u32, first: u32, mask: u32, queries: &mut Eight, places: &mut Eight) -> usize {
        *queries = [query; BLOCK];
        let (mut rest, mut count) = (mask, 0);
        while rest != 0 {
            places[count] = first + rest.trailing_zeros();
            rest &= rest - 1;
            count += 1;
        }
        count
    }

    #[inline(always)]
    fn sorted_short(self, row: &Eight, len: usize) -> Eight {
        let mut sorted = *row;
        sorted[..len].sort_unstable();
        sorted
    }

    #[inline(always)]
    fn same_short(self, one: &Eight, other: &Eight, len: usize) -> bool {
        one[..len] == other[..len]
    }

    #[inline(always)]
    fn absent(self, numbers: &Eight, others: &Eight, len: usize) -> u32 {
        (0..BLOCK).fold(0, |mask, i| mask | u32::from(!others[..len].contains(&numbers[i])) << i)
    }

    #[inline(always)]
    fn gather(self, list: &[Aabb], at: &Eight) -> EightBoxes {
        let mut boxes = [[0.0; BLOCK]; 6];
        for lane in 0..BLOCK {
            let aabb = list.get(at[lane] as usize).unwrap_or(&Aabb::NOWHERE);
            let is_valid = aabb.is_valid();
            for k in 0..3 {
                boxes[k][lane] = if is_valid { aabb.min[k] } else { f32::INFINITY };
                boxes[k + 3][lane] = if is_valid { aabb.max[k] } else { f32::NEG_INFINITY };
            }
        }
        boxes
    }

    #[inline(always)]
    fn around(self, boxes: &EightBoxes) -> Aabb {
        let mut around = Aabb::NOWHERE;
        for k in 0..3 {
            around.min[k] = fold(&boxes[k], |a, b| if a < b { a } else { b });
            around.max[k] = fold(&boxes[k + 3], |a, b| if a > b { a } else { b });
        }
        around
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
    fn at_most(self, numbers: &[f32; BLOCK], others: &[f32; BLOCK]) -> u32 {
        (0..BLOCK).fold(0, |mask, lane| mask | u32::from(numbers[lane] <= others[lane]) << lane)
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

/// Folds eight numbers in halves: one after the other takes twice as long.
#[inline(always)]
fn fold(numbers: &[f32; BLOCK], of: impl Fn(f32, f32) -> f32) -> f32 {
    let mut four = [0.0; 4];
    (0..4).for_each(|i| four[i] = of(numbers[i], numbers[i + 4]));
    of(of(four[0], four[2]), of(four[1], four[3]))
}

/// Returns the instructions that the CPU backend uses on this machine: "AVX2" or "portable".
///
/// ```
/// assert!(["AVX2", "portable"].contains(&pbig_core::simd()));
/// ```
pub fn simd() -> &'static str {
    #[cfg(target_arch = "x86_64")]
    if Avx2::detect().is_some() {
        return "AVX2";
    }
    "portable"
}

/// Calls a function with a proof of the best instructions that the processor has, and the arguments. The function and all that it calls
/// must be `#[inline(always)]`, closures in `for_each` included: what is not inlined is compiled without the instructions (one
/// such helper made the search 6 times slower).
#[cfg(target_arch = "x86_64")]
macro_rules! dispatch {
    ($work:path, $($argument:expr),*) => {
        match $crate::simd::Avx2::detect() {
            Some(avx2) => avx2.run(#[inline(always)] || $work(avx2, $($argument),*)),
            None => $crate::simd::Portable.run(#[inline(always)] || $work($crate::simd::Portable, $($argument),*)),
        }
    };
}

/// Calls a function with a proof of instructions that every processor has, and the arguments.
#[cfg(not(target_arch = "x86_64"))]
macro_rules! dispatch {
    ($work:path, $($argument:expr),*) => {
        $crate::simd::Portable.run(#[inline(always)] || $work($crate::simd::Portable, $($argument),*))
    };
}
pub(crate) use dispatch;

/// Starts to bring the cache line at `address` into the cache; nothing where the processor has no instruction for it.
#[inline(always)]
pub(crate) fn prefetch<T>(address: *const T) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: a prefetch reads nothing that could fault.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(address.cast()) }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = address;
}
