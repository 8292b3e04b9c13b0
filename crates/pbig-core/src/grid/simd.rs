//! The inner loops' instructions: AVX2 where the processor has it, chosen at run time; plain Rust elsewhere.

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

/// Four codes to a register of 256 bits. (512 bits were slower on Zen 4: every other load crosses a cache line.)
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy)]
pub(crate) struct Avx2;

/// By mask: the numbers of its set bits, a byte each, lowest first.
#[cfg(target_arch = "x86_64")]
static SET_BITS: [u64; 256] = {
    let mut table = [0; 256];
    let mut mask = 0;
    while mask < 256 {
        let (mut bit, mut shift) = (0, 0);
        while bit < 8 {
            if mask >> bit & 1 == 1 {
                table[mask] |= (bit as u64) << shift;
                shift += 8;
            }
            bit += 1;
        }
        mask += 1;
    }
    table
};

#[cfg(target_arch = "x86_64")]
impl Simd for Avx2 {
    #[inline(always)]
    unsafe fn steps(cells: &Cells, aabb: &Aabb) -> (Steps, Steps) {
        use super::cells::{MAX_STEP, MIN_STEP};
        use std::arch::x86_64::*;
        // SAFETY: the loads lie inside the box and the cells; the caller has AVX2.
        unsafe {
            let (min, max) = aabb.corners();
            let origin = _mm256_loadu_pd(cells.origin.as_ptr());
            let scale = _mm256_loadu_pd(cells.scale.as_ptr());
            let steps = |corner: __m128| -> Steps {
                let x = _mm256_mul_pd(_mm256_sub_pd(_mm256_cvtps_pd(corner), origin), scale);
                // The second operand wins where the first is NaN.
                let x = _mm256_max_pd(_mm256_min_pd(x, _mm256_set1_pd(MAX_STEP)), _mm256_set1_pd(MIN_STEP));
                std::mem::transmute::<__m128i, Steps>(_mm256_cvtpd_epi32(x))
            };
            (steps(min), steps(max))
        }
    }

    #[inline(always)]
    unsafe fn key(cells: &Cells, point: Steps) -> u32 {
        use std::arch::x86_64::*;
        let [x, y, z] = cells.dims;
        // SAFETY: the caller has AVX2.
        unsafe {
            let point = std::mem::transmute::<Steps, __m128i>(point);
            let cell = _mm_sra_epi32(point, _mm_cvtsi32_si128(cells.shift as i32));
            let cell = if cells.wraps {
                _mm_and_si128(cell, _mm_setr_epi32(x - 1, y - 1, z - 1, 0))
            } else {
                let most = _mm_setr_epi32(x - 2, y - 2, z - 2, 0);
                _mm_min_epi32(_mm_max_epi32(cell, _mm_set1_epi32(1)), most)
            };
            let key = _mm_mullo_epi32(cell, _mm_setr_epi32(1, x, x.wrapping_mul(y), 0));
            let key = _mm_add_epi32(key, _mm_shuffle_epi32::<0b01_00_11_10>(key));
            _mm_cvtsi128_si32(_mm_add_epi32(key, _mm_shuffle_epi32::<0b10_11_00_01>(key))) as u32
        }
    }

    #[inline(always)]
    unsafe fn takes(cells: &Cells, aabb: &Aabb) -> bool {
        use std::arch::x86_64::*;
        let [x, y, z] = cells.max_extent;
        // SAFETY: the caller has AVX2.
        unsafe {
            let (min, max) = aabb.corners();
            let extent = _mm_sub_ps(max, min);
            let fits = _mm_cmple_ps(extent, _mm_setr_ps(x, y, z, 0.0));
            _mm_movemask_ps(_mm_and_ps(_mm_cmpge_ps(extent, _mm_setzero_ps()), fits)) & 7 == 7
        }
    }

    #[inline(always)]
    unsafe fn code(low: Steps, high: Steps) -> u64 {
        use std::arch::x86_64::*;
        // SAFETY: the caller has AVX2.
        unsafe {
            let [low, high] = [low, high].map(|steps| std::mem::transmute::<Steps, __m128i>(steps));
            let (mask, shifts) = (_mm_setr_epi32(511, 511, 511, 0), _mm_setr_epi32(0, 10, 20, 0));
            let field = |steps| _mm_sllv_epi32(_mm_and_si128(steps, mask), shifts);
            let (low, high) = (field(_mm_sub_epi32(_mm_setzero_si128(), low)), field(high));
            let or = _mm_or_si128(_mm_unpacklo_epi32(low, high), _mm_unpackhi_epi32(low, high));
            _mm_cvtsi128_si64(_mm_or_si128(or, _mm_shuffle_epi32::<0b01_00_11_10>(or))) as u64
        }
    }

    #[inline(always)]
    unsafe fn test(query: u64, codes: *const u64) -> u32 {
        use std::arch::x86_64::*;
        // SAFETY: the caller has a block of codes there, and AVX2.
        unsafe {
            let query = _mm256_set1_epi64x(query as i64);
            let apart = _mm256_set1_epi64x((APART | TOMBSTONE) as i64);
            let half = |at: usize| {
                let codes = _mm256_loadu_si256(codes.add(at).cast());
                let sum = _mm256_and_si256(_mm256_add_epi64(query, codes), apart);
                let near = _mm256_cmpeq_epi64(sum, _mm256_setzero_si256());
                _mm256_movemask_pd(_mm256_castsi256_pd(near)) as u32
            };
            half(0) | half(BLOCK / 2) << (BLOCK / 2)
        }
    }

    #[inline(always)]
    unsafe fn expand(query: u32, first: u32, mask: u32, queries: *mut u32, places: *mut u32) -> usize {
        use std::arch::x86_64::*;
        // SAFETY: the caller has room for a block, and AVX2; a mask has eight bits.
        unsafe {
            let bits = _mm_cvtsi64_si128(SET_BITS[mask as usize & 255] as i64);
            let found = _mm256_add_epi32(_mm256_set1_epi32(first as i32), _mm256_cvtepu8_epi32(bits));
            _mm256_storeu_si256(queries.cast(), _mm256_set1_epi32(query as i32));
            _mm256_storeu_si256(places.cast(), found);
        }
        mask.count_ones() as usize
    }

    /// A sorting network of six steps; numbers behind the row take part as the largest ones.
    #[inline(always)]
    unsafe fn sorted_short(row: *const u32, len: usize) -> [u32; 8] {
        use std::arch::x86_64::*;
        macro_rules! step {
            ($row:ident, $swapped:expr, $upper:literal) => {{
                let swapped = $swapped;
                _mm256_blend_epi32::<$upper>(_mm256_min_epu32($row, swapped), _mm256_max_epu32($row, swapped))
            }};
        }
        // SAFETY: the caller has 8 numbers there, and AVX2.
        unsafe {
            let lanes = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
            let behind = _mm256_cmpgt_epi32(lanes, _mm256_set1_epi32(len as i32 - 1));
            let v = _mm256_or_si256(_mm256_loadu_si256(row.cast()), behind);
            let v = step!(v, _mm256_shuffle_epi32::<0b10_11_00_01>(v), 0b1010_1010);
            let v = step!(v, _mm256_shuffle_epi32::<0b00_01_10_11>(v), 0b1100_1100);
            let v = step!(v, _mm256_shuffle_epi32::<0b10_11_00_01>(v), 0b1010_1010);
            let reversed =
                _mm256_permute4x64_epi64::<0b01_00_11_10>(_mm256_shuffle_epi32::<0b00_01_10_11>(v));
            let v = step!(v, reversed, 0b1111_0000);
            let v = step!(v, _mm256_shuffle_epi32::<0b01_00_11_10>(v), 0b1100_1100);
            let v = step!(v, _mm256_shuffle_epi32::<0b10_11_00_01>(v), 0b1010_1010);
            std::mem::transmute::<__m256i, [u32; 8]>(v)
        }
    }

    #[inline(always)]
    unsafe fn same_short(one: *const u32, other: *const u32, len: usize) -> bool {
        use std::arch::x86_64::*;
        // SAFETY: the caller has 8 numbers each, and AVX2.
        unsafe {
            let same = _mm256_cmpeq_epi32(_mm256_loadu_si256(one.cast()), _mm256_loadu_si256(other.cast()));
            let same = _mm256_movemask_ps(_mm256_castsi256_ps(same)) as u32;
            !same & ((1 << len) - 1) == 0
        }
    }

    #[inline(always)]
    unsafe fn absent(numbers: *const u32, others: *const u32, len: usize) -> u32 {
        use std::arch::x86_64::*;
        // SAFETY: the caller has 8 numbers each, and AVX2.
        unsafe {
            let lanes = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
            let behind = _mm256_cmpgt_epi32(lanes, _mm256_set1_epi32(len as i32 - 1));
            let numbers = _mm256_loadu_si256(numbers.cast());
            // No id is the largest number.
            let mut others = _mm256_or_si256(_mm256_loadu_si256(others.cast()), behind);
            let next = _mm256_setr_epi32(1, 2, 3, 4, 5, 6, 7, 0);
            let mut found = _mm256_cmpeq_epi32(numbers, others);
            for _ in 1..8 {
                others = _mm256_permutevar8x32_epi32(others, next);
                found = _mm256_or_si256(found, _mm256_cmpeq_epi32(numbers, others));
            }
            !_mm256_movemask_ps(_mm256_castsi256_ps(found)) as u32 & 255
        }
    }

    #[inline(always)]
    unsafe fn overlaps_eight(boxes: &EightBoxes, aabb: &Aabb) -> u32 {
        use std::arch::x86_64::*;
        // SAFETY: the caller has AVX2.
        unsafe {
            let mut overlaps = _mm256_castsi256_ps(_mm256_set1_epi32(-1));
            for k in 0..3 {
                let (min, max) = (_mm256_loadu_ps(boxes[k].as_ptr()), _mm256_loadu_ps(boxes[k + 3].as_ptr()));
                let below = _mm256_cmp_ps::<_CMP_LE_OQ>(_mm256_set1_ps(aabb.min[k]), max);
                let above = _mm256_cmp_ps::<_CMP_LE_OQ>(min, _mm256_set1_ps(aabb.max[k]));
                overlaps = _mm256_and_ps(overlaps, _mm256_and_ps(below, above));
            }
            _mm256_movemask_ps(overlaps) as u32
        }
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
