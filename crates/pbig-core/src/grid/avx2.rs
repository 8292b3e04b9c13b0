//! The inner loops by AVX2, which all x86-64 processors of the last ten years have.

use super::cells::{APART, Cells, MAX_STEP, MIN_STEP, Steps, TOMBSTONE};
use super::simd::{BLOCK, Eight, EightBoxes, Simd};
use crate::Aabb;
use std::arch::x86_64::*;

/// A proof that the processor has the instructions, because only [`Avx2::detect`] makes one. Four codes lie in a register of 256 bits.
/// (512 bits were slower on Zen 4: every other load crosses a cache line.)
#[derive(Clone, Copy)]
pub(crate) struct Avx2(());

impl Avx2 {
    /// Returns a proof if the processor has all instructions that [`Avx2::run`] enables.
    #[inline]
    pub(crate) fn detect() -> Option<Self> {
        let has_all = is_x86_feature_detected!("avx2")
            && is_x86_feature_detected!("bmi1")
            && is_x86_feature_detected!("bmi2")
            && is_x86_feature_detected!("popcnt")
            && is_x86_feature_detected!("lzcnt");
        has_all.then_some(Self(()))
    }

    /// Calls a function that is inlined here, compiled for these instructions.
    #[inline]
    pub(crate) fn run<T>(self, work: impl FnOnce() -> T) -> T {
        #[target_feature(enable = "avx2,bmi1,bmi2,popcnt,lzcnt")]
        fn compiled<T>(work: impl FnOnce() -> T) -> T {
            work()
        }
        // SAFETY: `self` proves that the processor has these instructions.
        unsafe { compiled(work) }
    }
}

/// By mask: the numbers of its set bits, a byte each, lowest first.
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

impl Simd for Avx2 {
    #[inline(always)]
    fn steps(self, cells: &Cells, aabb: &Aabb) -> (Steps, Steps) {
        // SAFETY: `self` proves the instructions; each load is of an array of four.
        unsafe {
            let (min, max) = aabb.corners();
            let origin = _mm256_loadu_pd(cells.origin.as_ptr());
            let scale = _mm256_loadu_pd(cells.scale.as_ptr());
            let steps = |corner: __m128| -> Steps {
                let x = _mm256_mul_pd(_mm256_sub_pd(_mm256_cvtps_pd(corner), origin), scale);
                // The second operand wins where the first is NaN.
                let x = _mm256_max_pd(_mm256_min_pd(x, _mm256_set1_pd(MAX_STEP)), _mm256_set1_pd(MIN_STEP));
                bytemuck::cast(_mm256_cvtpd_epi32(x))
            };
            (steps(min), steps(max))
        }
    }

    #[inline(always)]
    fn key(self, cells: &Cells, point: Steps) -> u32 {
        let [x, y, z] = cells.dims;
        // SAFETY: `self` proves the instructions.
        unsafe {
            let point: __m128i = bytemuck::cast(point);
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
    fn takes(self, cells: &Cells, aabb: &Aabb) -> bool {
        let [x, y, z] = cells.max_extent;
        // SAFETY: `self` proves the instructions.
        unsafe {
            let (min, max) = aabb.corners();
            let extent = _mm_sub_ps(max, min);
            let fits = _mm_cmple_ps(extent, _mm_setr_ps(x, y, z, 0.0));
            _mm_movemask_ps(_mm_and_ps(_mm_cmpge_ps(extent, _mm_setzero_ps()), fits)) & 7 == 7
        }
    }

    #[inline(always)]
    fn code(self, low: Steps, high: Steps) -> u64 {
        // SAFETY: `self` proves the instructions.
        unsafe {
            let (low, high): (__m128i, __m128i) = (bytemuck::cast(low), bytemuck::cast(high));
            let (mask, shifts) = (_mm_setr_epi32(511, 511, 511, 0), _mm_setr_epi32(0, 10, 20, 0));
            let field = |steps| _mm_sllv_epi32(_mm_and_si128(steps, mask), shifts);
            let (low, high) = (field(_mm_sub_epi32(_mm_setzero_si128(), low)), field(high));
            let or = _mm_or_si128(_mm_unpacklo_epi32(low, high), _mm_unpackhi_epi32(low, high));
            _mm_cvtsi128_si64(_mm_or_si128(or, _mm_shuffle_epi32::<0b01_00_11_10>(or))) as u64
        }
    }

    #[inline(always)]
    fn test(self, query: u64, codes: &[u64; BLOCK]) -> u32 {
        // SAFETY: `self` proves the instructions; each load is of a half of the codes.
        unsafe {
            let query = _mm256_set1_epi64x(query as i64);
            let apart = _mm256_set1_epi64x((APART | TOMBSTONE) as i64);
            // A closure could be left out of line, for which the loops around it are several times as slow.
            let (low, high) = (codes[0..].as_ptr().cast(), codes[BLOCK / 2..].as_ptr().cast());
            let low = _mm256_and_si256(_mm256_add_epi64(query, _mm256_loadu_si256(low)), apart);
            let high = _mm256_and_si256(_mm256_add_epi64(query, _mm256_loadu_si256(high)), apart);
            let low = _mm256_cmpeq_epi64(low, _mm256_setzero_si256());
            let high = _mm256_cmpeq_epi64(high, _mm256_setzero_si256());
            let low = _mm256_movemask_pd(_mm256_castsi256_pd(low)) as u32;
            let high = _mm256_movemask_pd(_mm256_castsi256_pd(high)) as u32;
            low | high << (BLOCK / 2)
        }
    }

    #[inline(always)]
    fn expand(self, query: u32, first: u32, mask: u32, queries: &mut Eight, places: &mut Eight) -> usize {
        // SAFETY: `self` proves the instructions; each store is of eight numbers.
        unsafe {
            let bits = _mm_cvtsi64_si128(SET_BITS[mask as usize & 255] as i64);
            let found = _mm256_add_epi32(_mm256_set1_epi32(first as i32), _mm256_cvtepu8_epi32(bits));
            _mm256_storeu_si256(queries.as_mut_ptr().cast(), _mm256_set1_epi32(query as i32));
            _mm256_storeu_si256(places.as_mut_ptr().cast(), found);
        }
        mask.count_ones() as usize
    }

    /// A sorting network of six steps; numbers behind the row take part as the largest ones.
    #[inline(always)]
    fn sorted_short(self, row: &Eight, len: usize) -> Eight {
        macro_rules! step {
            ($row:ident, $swapped:expr, $upper:literal) => {{
                let swapped = $swapped;
                _mm256_blend_epi32::<$upper>(_mm256_min_epu32($row, swapped), _mm256_max_epu32($row, swapped))
            }};
        }
        // SAFETY: `self` proves the instructions; the load is of eight numbers.
        unsafe {
            let lanes = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
            let behind = _mm256_cmpgt_epi32(lanes, _mm256_set1_epi32(len as i32 - 1));
            let v = _mm256_or_si256(_mm256_loadu_si256(row.as_ptr().cast()), behind);
            let v = step!(v, _mm256_shuffle_epi32::<0b10_11_00_01>(v), 0b1010_1010);
            let v = step!(v, _mm256_shuffle_epi32::<0b00_01_10_11>(v), 0b1100_1100);
            let v = step!(v, _mm256_shuffle_epi32::<0b10_11_00_01>(v), 0b1010_1010);
            let reversed =
                _mm256_permute4x64_epi64::<0b01_00_11_10>(_mm256_shuffle_epi32::<0b00_01_10_11>(v));
            let v = step!(v, reversed, 0b1111_0000);
            let v = step!(v, _mm256_shuffle_epi32::<0b01_00_11_10>(v), 0b1100_1100);
            let v = step!(v, _mm256_shuffle_epi32::<0b10_11_00_01>(v), 0b1010_1010);
            bytemuck::cast(v)
        }
    }

    #[inline(always)]
    fn same_short(self, one: &Eight, other: &Eight, len: usize) -> bool {
        // SAFETY: `self` proves the instructions; each load is of eight numbers.
        unsafe {
            let same = _mm256_cmpeq_epi32(
                _mm256_loadu_si256(one.as_ptr().cast()),
                _mm256_loadu_si256(other.as_ptr().cast()),
            );
            let same = _mm256_movemask_ps(_mm256_castsi256_ps(same)) as u32;
            !same & ((1 << len) - 1) == 0
        }
    }

    #[inline(always)]
    fn absent(self, numbers: &Eight, others: &Eight, len: usize) -> u32 {
        // SAFETY: `self` proves the instructions; each load is of eight numbers.
        unsafe {
            let lanes = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
            let behind = _mm256_cmpgt_epi32(lanes, _mm256_set1_epi32(len as i32 - 1));
            let numbers = _mm256_loadu_si256(numbers.as_ptr().cast());
            // Lanes behind the row get the largest number, which is not an id.
            let mut others = _mm256_or_si256(_mm256_loadu_si256(others.as_ptr().cast()), behind);
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
    fn overlaps_eight(self, boxes: &EightBoxes, aabb: &Aabb) -> u32 {
        // SAFETY: `self` proves the instructions; each load is of eight numbers.
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
