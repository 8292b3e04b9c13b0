//! Primitives of AVX2, which all x86-64 processors of the last ten years have.

use super::codes::{MAX_STEP, MIN_STEP, Steps};
use super::{BLOCK, Eight, EightBoxes, Simd, lanewise};
use crate::Aabb;
use crate::aabb::sse::corners;
use std::arch::x86_64::*;
use std::sync::OnceLock;

/// A proof that the processor has the instructions, because only [`Avx2::detect`] makes one. Four codes lie in a register of 256 bits.
/// (512 bits were slower on Zen 4: every other load crosses a cache line.)
#[derive(Clone, Copy)]
pub(crate) struct Avx2(());

/// The processor's answer: asked once, because the library's takes five loads and tests.
static HAS_ALL: OnceLock<bool> = OnceLock::new();

impl Avx2 {
    /// Returns a proof if the processor has all instructions that its `run` enables.
    #[inline(always)]
    pub(crate) fn detect() -> Option<Self> {
        let has_all = HAS_ALL.get_or_init(|| {
            is_x86_feature_detected!("avx2")
                && is_x86_feature_detected!("bmi1")
                && is_x86_feature_detected!("bmi2")
                && is_x86_feature_detected!("popcnt")
                && is_x86_feature_detected!("lzcnt")
        });
        has_all.then_some(Self(()))
    }
}

/// Evaluates an expression of intrinsics in a method of a proof.
macro_rules! by {
    ($expression:expr) => {
        // SAFETY: `self` proves the instructions; each load is of an array that is borrowed.
        unsafe { $expression }
    };
}

impl Simd for Avx2 {
    type Row = __m256i;

    #[inline]
    fn run<T>(self, work: impl FnOnce() -> T) -> T {
        #[target_feature(enable = "avx2,bmi1,bmi2,popcnt,lzcnt")]
        fn compiled<T>(work: impl FnOnce() -> T) -> T {
            work()
        }
        by!(compiled(work))
    }

    #[inline(always)]
    fn load(self, row: &Eight) -> __m256i {
        by!(_mm256_loadu_si256(row.as_ptr().cast()))
    }

    #[inline(always)]
    fn store(self, row: __m256i) -> Eight {
        bytemuck::cast(row)
    }

    #[inline(always)]
    fn splat(self, number: u32) -> __m256i {
        by!(_mm256_set1_epi32(number as i32))
    }

    #[inline(always)]
    fn widen(self, bytes: u64) -> __m256i {
        by!(_mm256_cvtepu8_epi32(_mm_cvtsi64_si128(bytes as i64)))
    }

    lanewise! { __m256i:
        add(a, b) => by!(_mm256_add_epi32(a, b));
        and(a, b) => by!(_mm256_and_si256(a, b));
        or(a, b) => by!(_mm256_or_si256(a, b));
        min(a, b) => by!(_mm256_min_epu32(a, b));
        max(a, b) => by!(_mm256_max_epu32(a, b));
        equal(a, b) => by!(_mm256_cmpeq_epi32(a, b));
    }

    #[inline(always)]
    fn not(self, a: __m256i) -> __m256i {
        by!(_mm256_xor_si256(a, _mm256_set1_epi32(-1)))
    }

    #[inline(always)]
    fn at_most_f32(self, a: __m256i, b: __m256i) -> __m256i {
        by!({
            let (a, b) = (_mm256_castsi256_ps(a), _mm256_castsi256_ps(b));
            _mm256_castps_si256(_mm256_cmp_ps::<_CMP_LE_OQ>(a, b))
        })
    }

    #[inline(always)]
    fn select(self, mask: __m256i, set: __m256i, unset: __m256i) -> __m256i {
        by!(_mm256_blendv_epi8(unset, set, mask))
    }

    #[inline(always)]
    fn permute(self, row: __m256i, lanes: __m256i) -> __m256i {
        by!(_mm256_permutevar8x32_epi32(row, lanes))
    }

    #[inline(always)]
    fn bits(self, mask: __m256i) -> u32 {
        by!(_mm256_movemask_ps(_mm256_castsi256_ps(mask)) as u32)
    }

    #[inline(always)]
    fn least(self, row: __m256i) -> u32 {
        by!({
            let four = _mm_min_epu32(_mm256_castsi256_si128(row), _mm256_extracti128_si256::<1>(row));
            let two = _mm_min_epu32(four, _mm_shuffle_epi32::<0b01_00_11_10>(four));
            _mm_cvtsi128_si32(_mm_min_epu32(two, _mm_shuffle_epi32::<0b10_11_00_01>(two))) as u32
        })
    }

    #[inline(always)]
    fn lacks_bits(self, add: u64, bits: u64, codes: &[u64; BLOCK]) -> u32 {
        by!({
            let (add, bits) = (_mm256_set1_epi64x(add as i64), _mm256_set1_epi64x(bits as i64));
            // A closure could be left out of line, for which the loops around it are several times as slow.
            let (low, high) = (codes[0..].as_ptr().cast(), codes[BLOCK / 2..].as_ptr().cast());
            let low = _mm256_and_si256(_mm256_add_epi64(add, _mm256_loadu_si256(low)), bits);
            let high = _mm256_and_si256(_mm256_add_epi64(add, _mm256_loadu_si256(high)), bits);
            let low = _mm256_cmpeq_epi64(low, _mm256_setzero_si256());
            let high = _mm256_cmpeq_epi64(high, _mm256_setzero_si256());
            let low = _mm256_movemask_pd(_mm256_castsi256_pd(low)) as u32;
            let high = _mm256_movemask_pd(_mm256_castsi256_pd(high)) as u32;
            low | high << (BLOCK / 2)
        })
    }

    #[inline(always)]
    fn transpose(self, boxes: [&Aabb; BLOCK]) -> [__m256i; 6] {
        by!({
            // Two boxes, four lanes apart, share registers.
            let ((a, a_max), (b, b_max)) = (pair(boxes[0], boxes[4]), pair(boxes[1], boxes[5]));
            let ((c, c_max), (d, d_max)) = (pair(boxes[2], boxes[6]), pair(boxes[3], boxes[7]));
            let ([x, y, z], [max_x, max_y, max_z]) =
                (by_axis(a, b, c, d), by_axis(a_max, b_max, c_max, d_max));
            [x, y, z, max_x, max_y, max_z]
        })
    }

    #[inline(always)]
    fn steps(self, origin: &[f64; 4], scale: &[f64; 4], aabb: &Aabb) -> (Steps, Steps) {
        by!({
            let (min, max) = corners(aabb);
            let origin = _mm256_loadu_pd(origin.as_ptr());
            let scale = _mm256_loadu_pd(scale.as_ptr());
            let steps = |corner: __m128| -> Steps {
                let x = _mm256_mul_pd(_mm256_sub_pd(_mm256_cvtps_pd(corner), origin), scale);
                // The second operand wins where the first is NaN.
                let x = _mm256_max_pd(_mm256_min_pd(x, _mm256_set1_pd(MAX_STEP)), _mm256_set1_pd(MIN_STEP));
                bytemuck::cast(_mm256_cvtpd_epi32(x))
            };
            (steps(min), steps(max))
        })
    }

    #[inline(always)]
    fn key(self, [x, y, z]: [i32; 3], shift: u32, wraps: bool, point: Steps) -> u32 {
        by!({
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
        })
    }

    #[inline(always)]
    fn fits(self, &[x, y, z]: &[f32; 3], aabb: &Aabb) -> bool {
        by!({
            let (min, max) = corners(aabb);
            let extent = _mm_sub_ps(max, min);
            let fits = _mm_cmple_ps(extent, _mm_setr_ps(x, y, z, 0.0));
            _mm_movemask_ps(_mm_and_ps(_mm_cmpge_ps(extent, _mm_setzero_ps()), fits)) & 7 == 7
        })
    }

    #[inline(always)]
    fn code(self, low: Steps, high: Steps) -> u64 {
        by!({
            let (low, high): (__m128i, __m128i) = (bytemuck::cast(low), bytemuck::cast(high));
            let (mask, shifts) = (_mm_setr_epi32(511, 511, 511, 0), _mm_setr_epi32(0, 10, 20, 0));
            let field = |steps| _mm_sllv_epi32(_mm_and_si128(steps, mask), shifts);
            let (low, high) = (field(_mm_sub_epi32(_mm_setzero_si128(), low)), field(high));
            let or = _mm_or_si128(_mm_unpacklo_epi32(low, high), _mm_unpackhi_epi32(low, high));
            _mm_cvtsi128_si64(_mm_or_si128(or, _mm_shuffle_epi32::<0b01_00_11_10>(or))) as u64
        })
    }

    #[inline(always)]
    fn around(self, [x, y, z, max_x, max_y, max_z]: &EightBoxes) -> Aabb {
        by!(Aabb::new(folded([x, y, z], _mm_min_ps), folded([max_x, max_y, max_z], _mm_max_ps)))
    }
}

/// Returns the lower and the upper corners of two boxes.
///
/// # Safety
/// The processor has AVX2.
#[inline(always)]
unsafe fn pair(one: &Aabb, other: &Aabb) -> (__m256, __m256) {
    let ((min, max), (other_min, other_max)) = (corners(one), corners(other));
    // SAFETY: the caller's promise.
    unsafe { (_mm256_set_m128(other_min, min), _mm256_set_m128(other_max, max)) }
}

/// Returns x, y and z of four registers, each of which has x, y, z and anything of two boxes.
///
/// # Safety
/// The processor has AVX2.
#[inline(always)]
unsafe fn by_axis(a: __m256, b: __m256, c: __m256, d: __m256) -> [__m256i; 3] {
    // SAFETY: the caller's promise.
    unsafe {
        let (xy, more) = (_mm256_unpacklo_ps(a, b), _mm256_unpacklo_ps(c, d));
        let z = _mm256_shuffle_ps::<0b01_00_01_00>(_mm256_unpackhi_ps(a, b), _mm256_unpackhi_ps(c, d));
        let (x, y) =
            (_mm256_shuffle_ps::<0b01_00_01_00>(xy, more), _mm256_shuffle_ps::<0b11_10_11_10>(xy, more));
        [_mm256_castps_si256(x), _mm256_castps_si256(y), _mm256_castps_si256(z)]
    }
}

/// Folds each of three rows. The rows share the steps of a fold.
///
/// # Safety
/// The processor has AVX2.
#[inline(always)]
unsafe fn folded([a, b, c]: [&[f32; BLOCK]; 3], of: unsafe fn(__m128, __m128) -> __m128) -> [f32; 3] {
    // SAFETY: the caller's promise.
    unsafe {
        let (a, b, c) = (halves(a), halves(b), halves(c));
        let (a, b, c) = (of(a.0, a.1), of(b.0, b.1), of(c.0, c.1));
        let ab = of(_mm_unpacklo_ps(a, b), _mm_unpackhi_ps(a, b));
        let cc = of(_mm_unpacklo_ps(c, c), _mm_unpackhi_ps(c, c));
        let abc: [f32; 4] = bytemuck::cast(of(_mm_movelh_ps(ab, cc), _mm_movehl_ps(cc, ab)));
        [abc[0], abc[1], abc[2]]
    }
}

/// Returns both halves of a row.
#[inline(always)]
fn halves(row: &[f32; BLOCK]) -> (__m128, __m128) {
    // SAFETY: SSE is part of the architecture; each load is of four numbers of eight.
    unsafe { (_mm_loadu_ps(row.as_ptr()), _mm_loadu_ps(row[BLOCK / 2..].as_ptr())) }
}

/// Starts to bring the cache line at `address` into the cache.
#[inline(always)]
pub(crate) fn prefetch<T>(address: *const T) {
    // SAFETY: a prefetch reads nothing that could fault.
    unsafe { _mm_prefetch::<_MM_HINT_T0>(address.cast()) }
}
