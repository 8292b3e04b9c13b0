//! The test of codes, a block at a time, as fast as the processor can: chosen at run time.

use super::cells::APART;

/// Codes tested at once: a cache line of them.
pub(crate) const BLOCK: usize = 8;

/// A way of testing a block.
pub(crate) trait Lanes {
    /// A bit for each code of the block that begins at `from`: set when the two boxes may overlap.
    ///
    /// # Safety
    /// There are [`BLOCK`] codes from `from` on, and the processor has what the implementation needs.
    unsafe fn test(query: u64, codes: &[u64], from: usize) -> u32;
}

/// Any processor.
pub(crate) struct Portable;

impl Lanes for Portable {
    #[inline(always)]
    unsafe fn test(query: u64, codes: &[u64], from: usize) -> u32 {
        debug_assert!(from + BLOCK <= codes.len());
        // SAFETY: the caller's first promise.
        let block = unsafe { codes.get_unchecked(from..from + BLOCK) };
        let mut mask = 0;
        for (bit, code) in block.iter().enumerate() {
            mask |= u32::from(query.wrapping_add(*code) & APART == 0) << bit;
        }
        mask
    }
}

/// Four codes to a register of 256 bits. (512 bits were slower on Zen 4: every other load crosses a cache line.)
#[cfg(target_arch = "x86_64")]
pub(crate) struct Avx2;

#[cfg(target_arch = "x86_64")]
impl Lanes for Avx2 {
    #[inline(always)]
    unsafe fn test(query: u64, codes: &[u64], from: usize) -> u32 {
        use std::arch::x86_64::*;
        debug_assert!(from + BLOCK <= codes.len());
        // SAFETY: the caller's promises: both loads lie within the block, and there is AVX2.
        unsafe {
            let (query, apart) = (_mm256_set1_epi64x(query as i64), _mm256_set1_epi64x(APART as i64));
            let half = |at: usize| {
                let codes = _mm256_loadu_si256(codes.as_ptr().add(at).cast());
                let sum = _mm256_and_si256(_mm256_add_epi64(query, codes), apart);
                let near = _mm256_cmpeq_epi64(sum, _mm256_setzero_si256());
                _mm256_movemask_pd(_mm256_castsi256_pd(near)) as u32
            };
            half(from) | half(from + BLOCK / 2) << (BLOCK / 2)
        }
    }
}

/// Which implementation to use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Simd {
    Portable,
    /// With all that came with it or before.
    #[cfg(target_arch = "x86_64")]
    Avx2,
}

impl Simd {
    /// The best that this processor has.
    pub(crate) fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2")
            && is_x86_feature_detected!("bmi1")
            && is_x86_feature_detected!("bmi2")
            && is_x86_feature_detected!("popcnt")
            && is_x86_feature_detected!("lzcnt")
        {
            return Self::Avx2;
        }
        Self::Portable
    }

    /// The name for people.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Portable => "portable",
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => "AVX2",
        }
    }
}

/// Starts to bring a value into the cache. Costs an instruction; nothing where the processor has none for it.
#[doc(hidden)]
#[inline(always)]
pub fn prefetch<T: ?Sized>(value: &T) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: a prefetch reads nothing, and the address is that of a value.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(std::ptr::from_ref(value).cast()) }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = value;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_implementation_finds_what_the_definition_says() {
        let mut random = 1u64;
        let mut next = || {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            random ^ random >> 29
        };
        let codes: Vec<u64> = (0..4096).map(|_| next() & !0xC000_0000_C000_0000).collect();
        let (mut tested, mut near) = (0, 0);
        for from in 0..codes.len() - BLOCK {
            let query = codes[from * 7 % codes.len()];
            let wanted = (0..BLOCK).fold(0, |mask, bit| {
                mask | u32::from(query.wrapping_add(codes[from + bit]) & APART == 0) << bit
            });
            // SAFETY: the block ends before the codes do; AVX2 is used where it was detected.
            unsafe {
                assert_eq!(Portable::test(query, &codes, from), wanted);
                #[cfg(target_arch = "x86_64")]
                if Simd::detect() == Simd::Avx2 {
                    assert_eq!(Avx2::test(query, &codes, from), wanted);
                }
            }
            tested += BLOCK as u32;
            near += wanted.count_ones();
        }
        assert!(near > 100 && near < tested / 2, "{near} of {tested}");
    }
}
