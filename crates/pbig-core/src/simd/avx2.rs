//! The inner loops by AVX2, which all x86-64 processors of the last ten years have.

use super::codes::{APART, MAX_STEP, MIN_STEP, Steps, TOMBSTONE};
use super::{BLOCK, Eight, EightBoxes, Simd};
use crate::Aabb;
use std::arch::x86_64::*;
use std::sync::atomic::{AtomicU8, Ordering};

/// A proof that the processor has the instructions, because only [`Avx2::detect`] makes one. Four codes lie in a register of 256 bits.
/// (512 bits were slower on Zen 4: every other load crosses a cache line.)
#[derive(Clone, Copy)]
pub(crate) struct Avx2(());

/// The processor's answer: 0 before it was asked.
static FOUND: AtomicU8 = AtomicU8::new(0);

struct Found;

impl Found {
    const YES: u8 = 1;
    const NO: u8 = 2;
}

impl Avx2 {
    /// Returns a proof if the processor has all instructions that [`Avx2::run`] enables.
    #[inline(always)]
    pub(crate) fn detect() -> Option<Self> {
        match FOUND.load(Ordering::Relaxed) {
            Found::YES => Some(Self(())),
            Found::NO => None,
            _ => Self::look(),
        }
    }

    /// Asks the processor, once: the library's answer takes five loads and tests.
    #[cold]
    fn look() -> Option<Self> {
        let has_all = is_x86_feature_detected!("avx2")
            && is_x86_feature_detected!("bmi1")
            && is_x86_feature_detected!("bmi2")
            && is_x86_feature_detected!("popcnt")
            && is_x86_feature_detected!("lzcnt");
        FOUND.store(if has_all { Found::YES } else { Found::NO }, Ordering::Relaxed);
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
    fn steps(self, origin: &[f64; 4], scale: &[f64; 4], aabb: &Aabb) -> (Steps, Steps) {
        // SAFETY: `self` proves the instructions; each load is of an array of four.
        unsafe {
            let (min, max) = aabb.corners();
            let origin = _mm256_loadu_pd(origin.as_ptr());
            let scale = _mm256_loadu_pd(scale.as_ptr());
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
    fn key(self, [x, y, z]: [i32; 3], shift: u32, wraps: bool, point: Steps) -> u32 {
        // SAFETY: `self` proves the instructions.
        unsafe {
            let point: __m128i = bytemuck::cast(point);
            let cell = _mm_sra_epi32(point, _mm_cvtsi32_si128(shift as i32));
            let cell = if wraps {
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
    fn fits(self, &[x, y, z]: &[f32; 3], aabb: &Aabb) -> bool {
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

    #[inline(always)]
    fn sorted_short(self, row: &Eight, len: usize) -> Eight {
        // SAFETY: `self` proves the instructions; the load is of eight numbers.
        unsafe {
            let lanes = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
            // Numbers behind the row take part as the largest ones.
            let behind = _mm256_cmpgt_epi32(lanes, _mm256_set1_epi32(len as i32 - 1));
            bytemuck::cast(sorted(_mm256_or_si256(_mm256_loadu_si256(row.as_ptr().cast()), behind)))
        }
    }

    #[inline(always)]
    fn gather(self, list: &[Aabb], at: &Eight) -> EightBoxes {
        // SAFETY: `self` proves the instructions.
        unsafe {
            let corners = |lane: usize| list.get(at[lane] as usize).unwrap_or(&Aabb::NOWHERE).corners();
            // A pair of boxes four lanes apart shares registers.
            let pair = |lane: usize| {
                let ((min, max), (other_min, other_max)) = (corners(lane), corners(lane + 4));
                (_mm256_set_m128(other_min, min), _mm256_set_m128(other_max, max))
            };
            let ((a, a_max), (b, b_max), (c, c_max), (d, d_max)) = (pair(0), pair(1), pair(2), pair(3));
            let (min, max) = (transposed(a, b, c, d), transposed(a_max, b_max, c_max, d_max));
            let valid = |k: usize| _mm256_cmp_ps::<_CMP_LE_OQ>(min[k], max[k]);
            let valid = _mm256_and_ps(_mm256_and_ps(valid(0), valid(1)), valid(2));
            let (most, least) = (_mm256_set1_ps(f32::INFINITY), _mm256_set1_ps(f32::NEG_INFINITY));
            let low = |k: usize| -> [f32; BLOCK] { bytemuck::cast(_mm256_blendv_ps(most, min[k], valid)) };
            let high = |k: usize| -> [f32; BLOCK] { bytemuck::cast(_mm256_blendv_ps(least, max[k], valid)) };
            [low(0), low(1), low(2), high(0), high(1), high(2)]
        }
    }

    #[inline(always)]
    fn around(self, boxes: &EightBoxes) -> Aabb {
        // SAFETY: `self` proves the instructions; each load is of eight numbers.
        unsafe {
            let halves = |k: usize| {
                let row = _mm256_loadu_ps(boxes[k].as_ptr());
                (_mm256_castps256_ps128(row), _mm256_extractf128_ps::<1>(row))
            };
            let low = |k: usize| _mm_min_ps(halves(k).0, halves(k).1);
            let high = |k: usize| _mm_max_ps(halves(k).0, halves(k).1);
            let ([a, b, c], [d, e, f]) = ([low(0), low(1), low(2)], [high(3), high(4), high(5)]);
            let two = |a, b, of: unsafe fn(__m128, __m128) -> __m128| {
                of(_mm_unpacklo_ps(a, b), _mm_unpackhi_ps(a, b))
            };
            let four =
                |a, b, of: unsafe fn(__m128, __m128) -> __m128| of(_mm_movelh_ps(a, b), _mm_movehl_ps(b, a));
            let min: [f32; 4] =
                bytemuck::cast(four(two(a, b, _mm_min_ps), two(c, c, _mm_min_ps), _mm_min_ps));
            let max: [f32; 4] =
                bytemuck::cast(four(two(d, e, _mm_max_ps), two(f, f, _mm_max_ps), _mm_max_ps));
            Aabb::new([min[0], min[1], min[2]], [max[0], max[1], max[2]])
        }
    }

    #[inline(always)]
    fn nearest(self, keys: &[f32; BLOCK], limits: &[f32; BLOCK]) -> Option<usize> {
        // SAFETY: `self` proves the instructions.
        let least = unsafe {
            let words = words(keys, limits).1;
            let four = _mm_min_epu32(_mm256_castsi256_si128(words), _mm256_extracti128_si256::<1>(words));
            let two = _mm_min_epu32(four, _mm_shuffle_epi32::<0b01_00_11_10>(four));
            _mm_cvtsi128_si32(_mm_min_epu32(two, _mm_shuffle_epi32::<0b10_11_00_01>(two))) as u32
        };
        (least != u32::MAX).then_some(least as usize % BLOCK)
    }

    #[inline(always)]
    fn farthest_first(
        self,
        keys: &[f32; BLOCK],
        limits: &[f32; BLOCK],
        values: &Eight,
    ) -> ([f32; BLOCK], Eight, usize) {
        // SAFETY: `self` proves the instructions; the load is of eight numbers.
        unsafe {
            let (found, words) = words(keys, limits);
            let all_bits = _mm256_set1_epi32(-1);
            let beyond = _mm256_cmpeq_epi32(words, all_bits);
            let count =
                BLOCK - (_mm256_movemask_ps(_mm256_castsi256_ps(beyond)) as u32).count_ones() as usize;
            // The largest word is to be first.
            let order = sorted(_mm256_or_si256(_mm256_xor_si256(words, all_bits), beyond));
            let order = _mm256_xor_si256(order, all_bits);
            let values = _mm256_loadu_si256(values.as_ptr().cast());
            let keys = _mm256_permutevar8x32_ps(found, order);
            let values = _mm256_permutevar8x32_epi32(values, order);
            (bytemuck::cast(keys), bytemuck::cast(values), count)
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
    fn at_most(self, numbers: &[f32; BLOCK], others: &[f32; BLOCK]) -> u32 {
        // SAFETY: `self` proves the instructions; each load is of eight numbers.
        unsafe {
            let (numbers, others) = (_mm256_loadu_ps(numbers.as_ptr()), _mm256_loadu_ps(others.as_ptr()));
            _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(numbers, others)) as u32
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

/// Returns x, y and z of four registers, each of which has x, y, z and anything of two boxes.
///
/// # Safety
/// The processor has AVX2.
#[inline(always)]
unsafe fn transposed(a: __m256, b: __m256, c: __m256, d: __m256) -> [__m256; 3] {
    // SAFETY: the caller's promise.
    unsafe {
        let (xy, more) = (_mm256_unpacklo_ps(a, b), _mm256_unpacklo_ps(c, d));
        let z = _mm256_shuffle_ps::<0b01_00_01_00>(_mm256_unpackhi_ps(a, b), _mm256_unpackhi_ps(c, d));
        [_mm256_shuffle_ps::<0b01_00_01_00>(xy, more), _mm256_shuffle_ps::<0b11_10_11_10>(xy, more), z]
    }
}

/// Returns eight keys, and words in their order with the lane in the last bits: all bits for a key beyond its limit.
///
/// # Safety
/// The processor has AVX2.
#[inline(always)]
unsafe fn words(keys: &[f32; BLOCK], limits: &[f32; BLOCK]) -> (__m256, __m256i) {
    // SAFETY: the caller's promise; each load is of eight numbers.
    unsafe {
        let (keys, limits) = (_mm256_loadu_ps(keys.as_ptr()), _mm256_loadu_ps(limits.as_ptr()));
        let beyond = _mm256_castps_si256(_mm256_cmp_ps::<_CMP_NLE_UQ>(keys, limits));
        let key = _mm256_and_si256(_mm256_castps_si256(keys), _mm256_set1_epi32(!7));
        let word = _mm256_or_si256(key, _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7));
        (keys, _mm256_or_si256(word, beyond))
    }
}

/// Sorts eight numbers by a network of six steps.
///
/// # Safety
/// The processor has AVX2.
#[inline(always)]
unsafe fn sorted(v: __m256i) -> __m256i {
    macro_rules! step {
        ($row:ident, $swapped:expr, $upper:literal) => {{
            let swapped = $swapped;
            _mm256_blend_epi32::<$upper>(_mm256_min_epu32($row, swapped), _mm256_max_epu32($row, swapped))
        }};
    }
    // SAFETY: the caller's promise.
    unsafe {
        let v = step!(v, _mm256_shuffle_epi32::<0b10_11_00_01>(v), 0b1010_1010);
        let v = step!(v, _mm256_shuffle_epi32::<0b00_01_10_11>(v), 0b1100_1100);
        let v = step!(v, _mm256_shuffle_epi32::<0b10_11_00_01>(v), 0b1010_1010);
        let reversed = _mm256_permute4x64_epi64::<0b01_00_11_10>(_mm256_shuffle_epi32::<0b00_01_10_11>(v));
        let v = step!(v, reversed, 0b1111_0000);
        let v = step!(v, _mm256_shuffle_epi32::<0b01_00_11_10>(v), 0b1100_1100);
        step!(v, _mm256_shuffle_epi32::<0b10_11_00_01>(v), 0b1010_1010)
    }
}
