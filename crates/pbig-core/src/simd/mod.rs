//! Instructions of the inner loops: AVX2 where the processor has it, found at run time; NEON on 64-bit ARM; plain Rust elsewhere.
//!
//! An instruction set has [`Primitives`] on registers of eight numbers. The kernels of the loops, [`Simd`], are written once on these.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(any(test, not(target_arch = "x86_64")))]
pub(crate) mod axes;
mod codes;
mod kernels;
#[cfg(target_arch = "aarch64")]
mod neon;
mod portable;
#[cfg(target_arch = "x86_64")]
pub(crate) mod sse;

#[cfg(target_arch = "x86_64")]
pub(crate) use self::sse as one_box;
use crate::Aabb;
#[cfg(target_arch = "x86_64")]
pub(crate) use avx2::Avx2;
#[cfg(not(target_arch = "x86_64"))]
pub(crate) use axes as one_box;
pub(crate) use codes::{Steps, TOMBSTONE, query_of};
pub(crate) use kernels::Simd;
#[cfg(target_arch = "aarch64")]
use neon::Neon;
pub(crate) use one_box::prefetch;
pub(crate) use portable::Portable;

/// Codes tested together: a cache line of them.
pub(crate) const BLOCK: usize = 8;

/// Eight boxes axis by axis: three rows of lower corners, three of upper ones.
pub(crate) type EightBoxes = [[f32; BLOCK]; 6];

/// Eight ids or places.
pub(crate) type Eight = [u32; BLOCK];

/// Least and greatest coordinates of some boxes, and greatest extents. Each has an axis a lane; the fourth lane holds anything.
pub(crate) type Extremes = [[f32; 4]; 3];

/// Instructions of a processor. A value is a proof that the processor has them.
pub(crate) trait Primitives: Copy {
    /// Eight numbers of 32 bits: integers, floats by their bits, or a mask, in which all bits of a lane are equal.
    type Row: Copy;

    /// Calls a function that is inlined here, compiled for the instructions.
    fn run<T>(self, work: impl FnOnce() -> T) -> T;

    /// Reads eight numbers.
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

    /// Returns the least float of each row. No float is a NaN.
    fn lowest(self, rows: [Self::Row; 3]) -> [f32; 3];

    /// Returns the greatest float of each row. No float is a NaN.
    fn highest(self, rows: [Self::Row; 3]) -> [f32; 3];

    /// Returns both corners of a box in steps: `scale` of them in a length unit, from `origin` on.
    #[inline(always)]
    fn steps(self, origin: &[f64; 4], scale: &[f64; 4], aabb: &Aabb) -> (Steps, Steps) {
        (codes::steps(origin, scale, &aabb.min), codes::steps(origin, scale, &aabb.max))
    }

    /// Returns the number, row by row, of the cell of a point. A cell has `1 << shift` steps, and there are `dims` of them by axis. The
    /// point is wrapped into these, or clamped into those that have neighbours on both sides.
    #[inline(always)]
    fn key(self, dims: [i32; 3], shift: u32, wraps: bool, point: Steps) -> u32 {
        codes::key(dims, shift, wraps, point)
    }

    /// Returns true for a valid box with these extents at most.
    #[inline(always)]
    fn fits(self, most: &[f32; 3], aabb: &Aabb) -> bool {
        let extent: [f32; 3] = std::array::from_fn(|k| aabb.max[k] - aabb.min[k]);
        let fits = |k: usize| (extent[k] >= 0.0) & (extent[k] <= most[k]);
        fits(0) & fits(1) & fits(2)
    }

    /// Returns the code of a box.
    #[inline(always)]
    fn code(self, low: Steps, high: Steps) -> u64 {
        codes::code(low, high)
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
fn exchange<P: Primitives>(simd: P, row: P::Row, [partners, upper]: &[Eight; 2]) -> P::Row {
    let other = simd.permute(row, simd.load(partners));
    simd.select(simd.load(upper), simd.max(row, other), simd.min(row, other))
}

/// Borrows eight numbers of a list, from a place on.
#[inline(always)]
pub(crate) fn eight_from(list: &mut [u32], from: usize) -> &mut Eight {
    list[from..].first_chunk_mut().expect("lists have room for a block more")
}

/// Returns the instructions that the CPU backend uses on this machine: "AVX2", "NEON" or "portable".
///
/// ```
/// assert!(["AVX2", "NEON", "portable"].contains(&pbig_core::simd()));
/// ```
pub fn simd() -> &'static str {
    #[cfg(target_arch = "x86_64")]
    if Avx2::detect().is_some() {
        return "AVX2";
    }
    if cfg!(target_arch = "aarch64") { "NEON" } else { "portable" }
}

/// Calls a function with a proof of the best instructions that the processor has, and the arguments. The function and all that it calls
/// must be `#[inline(always)]`, closures in `for_each` included: what is not inlined is compiled without the instructions (one
/// such helper made the search 6 times slower).
#[cfg(target_arch = "x86_64")]
macro_rules! dispatch {
    ($work:path, $($argument:expr),*) => {
        match $crate::simd::Avx2::detect() {
            Some(avx2) => $crate::simd::Primitives::run(avx2, #[inline(always)] || $work(avx2, $($argument),*)),
            None => {
                let portable = $crate::simd::Portable;
                $crate::simd::Primitives::run(portable, #[inline(always)] || $work(portable, $($argument),*))
            }
        }
    };
}

/// Calls a function with a proof of instructions that every processor of the target has, and the arguments.
#[cfg(not(target_arch = "x86_64"))]
macro_rules! dispatch {
    ($work:path, $($argument:expr),*) => {{
        let baseline = $crate::simd::BASELINE;
        $crate::simd::Primitives::run(baseline, #[inline(always)] || $work(baseline, $($argument),*))
    }};
}
pub(crate) use dispatch;

/// The best instructions that every processor of the target has.
#[cfg(target_arch = "aarch64")]
pub(crate) const BASELINE: Neon = Neon;

/// The best instructions that every processor of the target has.
#[cfg(not(any(target_arch = "aarch64", target_arch = "x86_64")))]
pub(crate) const BASELINE: Portable = Portable;
