//! The inner loops' instructions: AVX2 where the processor has it, chosen at run time; plain Rust elsewhere.

#[cfg(target_arch = "x86_64")]
use super::avx2::Avx2;
use super::cells::{APART, Cells, Steps, TOMBSTONE, code_portable, steps_portable};
use crate::Aabb;

/// Codes tested together: a cache line of them.
pub(crate) const BLOCK: usize = 8;

/// Eight boxes axis by axis: three rows of lower corners, three of upper ones.
pub(crate) type EightBoxes = [[f32; BLOCK]; 6];

/// One implementation of the inner loops.
///
/// # Safety
/// The methods may be called only on a processor that has the instructions: inside [`dispatch`].
pub(crate) trait Simd {
    /// Returns both corners of a box in steps.
    unsafe fn steps(cells: &Cells, aabb: &Aabb) -> (Steps, Steps);

    /// Returns the key of the cell of a point, see [`Cells::cell`].
    unsafe fn key(cells: &Cells, point: Steps) -> u32;

    /// Returns true for a valid box that is not oversize, see [`Cells::takes`].
    unsafe fn takes(cells: &Cells, aabb: &Aabb) -> bool;

    /// Returns the code of a box.
    unsafe fn code(low: Steps, high: Steps) -> u64;

    /// Returns a bit for each of [`BLOCK`] codes from `codes` on: set if the two boxes may overlap. Tombstones never do.
    unsafe fn test(query: u64, codes: *const u64) -> u32;

    /// Writes `query` and the places `first + bit` of the set bits of `mask`, and returns how many; may write
    /// [`BLOCK`] elements to each list.
    unsafe fn expand(query: u32, first: u32, mask: u32, queries: *mut u32, places: *mut u32) -> usize;

    /// Returns the first `len` (at most 8) of the 8 numbers from `row` on, sorted, and any numbers behind them.
    unsafe fn sorted_short(row: *const u32, len: usize) -> [u32; 8];

    /// Returns true if the first `len` (at most 8) of 8 numbers each are the same.
    unsafe fn same_short(one: *const u32, other: *const u32, len: usize) -> bool;

    /// Returns a bit for each of 8 numbers that is not among the first `len` (at most 8) of 8 others.
    unsafe fn absent(numbers: *const u32, others: *const u32, len: usize) -> u32;

    /// Returns a bit for each of 8 boxes, given axis by axis, that overlaps a box.
    unsafe fn overlaps_eight(boxes: &EightBoxes, aabb: &Aabb) -> u32;
}

/// Any processor.
#[derive(Clone, Copy)]
pub(crate) struct Portable;

impl Simd for Portable {
    #[inline(always)]
    unsafe fn steps(cells: &Cells, aabb: &Aabb) -> (Steps, Steps) {
        steps_portable(cells, aabb)
    }

    #[inline(always)]
    unsafe fn key(cells: &Cells, point: Steps) -> u32 {
        cells.key(cells.cell(point))
    }

    #[inline(always)]
    unsafe fn takes(cells: &Cells, aabb: &Aabb) -> bool {
        cells.takes(aabb)
    }

    #[inline(always)]
    unsafe fn code(low: Steps, high: Steps) -> u64 {
        code_portable(low, high)
    }

    #[inline(always)]
    unsafe fn test(query: u64, codes: *const u64) -> u32 {
        // SAFETY: the caller has a block of codes there.
        let block = unsafe { codes.cast::<[u64; BLOCK]>().read() };
        let may_overlap = |code: u64| query.wrapping_add(code) & (APART | TOMBSTONE) == 0;
        (0..BLOCK).fold(0, |mask, bit| mask | u32::from(may_overlap(block[bit])) << bit)
    }

    #[inline(always)]
    unsafe fn expand(query: u32, first: u32, mut mask: u32, queries: *mut u32, places: *mut u32) -> usize {
        let mut count = 0;
        while mask != 0 {
            // SAFETY: the caller has room for a block.
            unsafe {
                *queries.add(count) = query;
                *places.add(count) = first + mask.trailing_zeros();
            }
            mask &= mask - 1;
            count += 1;
        }
        count
    }

    #[inline(always)]
    unsafe fn sorted_short(row: *const u32, len: usize) -> [u32; 8] {
        // SAFETY: the caller has 8 numbers there.
        let mut sorted = unsafe { row.cast::<[u32; 8]>().read() };
        for i in 1..len {
            let (value, mut j) = (sorted[i], i);
            while j > 0 && sorted[j - 1] > value {
                sorted[j] = sorted[j - 1];
                j -= 1;
            }
            sorted[j] = value;
        }
        sorted
    }

    #[inline(always)]
    unsafe fn same_short(one: *const u32, other: *const u32, len: usize) -> bool {
        // SAFETY: the caller has as many.
        (0..len).all(|i| unsafe { *one.add(i) == *other.add(i) })
    }

    #[inline(always)]
    unsafe fn absent(numbers: *const u32, others: *const u32, len: usize) -> u32 {
        // SAFETY: the caller has 8 numbers each.
        let (numbers, others) =
            unsafe { (*numbers.cast::<[u32; 8]>(), std::slice::from_raw_parts(others, len)) };
        (0..8).fold(0, |mask, i| mask | u32::from(!others.contains(&numbers[i])) << i)
    }

    #[inline(always)]
    unsafe fn overlaps_eight(boxes: &EightBoxes, aabb: &Aabb) -> u32 {
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

/// The implementation in use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Level {
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2,
}

fn detect() -> Level {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2")
        && is_x86_feature_detected!("bmi1")
        && is_x86_feature_detected!("bmi2")
        && is_x86_feature_detected!("popcnt")
        && is_x86_feature_detected!("lzcnt")
    {
        return Level::Avx2;
    }
    Level::Portable
}

/// Returns the instructions that the CPU backend uses on this machine: "AVX2" or "portable".
///
/// ```
/// assert!(["AVX2", "portable"].contains(&pbig_core::simd()));
/// ```
pub fn simd() -> &'static str {
    match detect() {
        Level::Portable => "portable",
        #[cfg(target_arch = "x86_64")]
        Level::Avx2 => "AVX2",
    }
}

/// Work that is compiled once for each implementation. `run` and all that it calls must be `#[inline(always)]`: a
/// function that is not inlined is compiled without the instructions (one such helper made the search 6 times slower).
pub(crate) trait Kernel {
    /// The result of the work.
    type Output;

    /// Does the work.
    ///
    /// # Safety
    /// The processor has the instructions of `S`.
    unsafe fn run<S: Simd>(self) -> Self::Output;
}

/// Runs a kernel with the best instructions that the processor has.
#[inline]
pub(crate) fn dispatch<K: Kernel>(kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    if detect() == Level::Avx2 {
        // SAFETY: the instructions were detected.
        return unsafe { run_avx2(kernel) };
    }
    run_portable(kernel)
}

/// Runs a kernel without special instructions.
pub(crate) fn run_portable<K: Kernel>(kernel: K) -> K::Output {
    // SAFETY: every processor has them.
    unsafe { kernel.run::<Portable>() }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi1,bmi2,popcnt,lzcnt")]
unsafe fn run_avx2<K: Kernel>(kernel: K) -> K::Output {
    // SAFETY: the caller has detected them.
    unsafe { kernel.run::<Avx2>() }
}

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
