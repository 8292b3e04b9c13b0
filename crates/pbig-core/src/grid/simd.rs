//! The inner loops' instructions: AVX2 where the processor has it, chosen at run time; plain Rust elsewhere.

#[cfg(target_arch = "x86_64")]
use super::avx2::Avx2;
use super::cells::{APART, Cells, Steps, TOMBSTONE, code_portable, steps_portable};
use crate::Aabb;

/// Codes tested together: a cache line of them.
pub(crate) const BLOCK: usize = 8;

/// Eight boxes axis by axis: three rows of lower corners, three of upper ones.
pub(crate) type EightBoxes = [[f32; BLOCK]; 6];

/// A register of ids or places.
pub(crate) type Eight = [u32; BLOCK];

/// One implementation of the inner loops. A value is a proof that the processor has the instructions.
pub(crate) trait Simd: Copy {
    /// Returns both corners of a box in steps.
    fn steps(self, cells: &Cells, aabb: &Aabb) -> (Steps, Steps);

    /// Returns the key of the cell of a point, see [`Cells::cell`].
    fn key(self, cells: &Cells, point: Steps) -> u32;

    /// Returns true for a valid box that is not oversize, see [`Cells::takes`].
    fn takes(self, cells: &Cells, aabb: &Aabb) -> bool;

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

    /// Returns a bit for each of eight boxes that overlaps a box.
    fn overlaps_eight(self, boxes: &EightBoxes, aabb: &Aabb) -> u32;
}

/// Borrows eight numbers of a list, from a place on.
#[inline(always)]
pub(super) fn eight_from(list: &mut [u32], from: usize) -> &mut Eight {
    list[from..].first_chunk_mut().expect("lists have room for a block more")
}

/// Any processor.
#[derive(Clone, Copy)]
pub(crate) struct Portable;

impl Simd for Portable {
    #[inline(always)]
    fn steps(self, cells: &Cells, aabb: &Aabb) -> (Steps, Steps) {
        steps_portable(cells, aabb)
    }

    #[inline(always)]
    fn key(self, cells: &Cells, point: Steps) -> u32 {
        cells.key(cells.cell(point))
    }

    #[inline(always)]
    fn takes(self, cells: &Cells, aabb: &Aabb) -> bool {
        cells.takes(aabb)
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
        match $crate::grid::Avx2::detect() {
            Some(avx2) => avx2.run(#[inline(always)] || $work(avx2, $($argument),*)),
            None => $work($crate::grid::Portable, $($argument),*),
        }
    };
}

/// Calls a function with a proof of instructions that every processor has, and the arguments.
#[cfg(not(target_arch = "x86_64"))]
macro_rules! dispatch {
    ($work:path, $($argument:expr),*) => {
        $work($crate::grid::Portable, $($argument),*)
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
