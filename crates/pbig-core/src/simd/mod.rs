//! Instructions of the inner loops: AVX2 where the processor has it, found at run time; NEON on 64-bit ARM; plain Rust elsewhere.
//!
//! An instruction set has primitives on registers of eight numbers. The kernels of the loops are written once on these: see [`Simd`].

#[cfg(target_arch = "x86_64")]
mod avx2;
mod codes;
mod instructions;
#[cfg(target_arch = "aarch64")]
mod neon;
mod portable;

#[cfg(target_arch = "x86_64")]
pub(crate) use avx2::{Avx2, prefetch};
pub(crate) use codes::{Steps, TOMBSTONE, query_of};
pub(crate) use instructions::Simd;
#[cfg(target_arch = "aarch64")]
use neon::Neon;
pub(crate) use portable::Portable;
#[cfg(not(target_arch = "x86_64"))]
pub(crate) use portable::prefetch;

/// Codes tested together: a cache line of them.
pub(crate) const BLOCK: usize = 8;

/// Eight boxes axis by axis: three rows of lower corners, three of upper ones.
pub(crate) type EightBoxes = [[f32; BLOCK]; 6];

/// Eight ids or places.
pub(crate) type Eight = [u32; BLOCK];

/// Borrows eight numbers of a list, from a place on.
#[inline(always)]
pub(crate) fn eight_from(list: &mut [u32], from: usize) -> &mut Eight {
    list[from..].first_chunk_mut().expect("lists have room for a block more")
}

/// Takes the lowest bit out of a mask, and returns its number.
#[inline(always)]
pub(crate) fn next(mask: &mut u32) -> Option<usize> {
    let lane = mask.trailing_zeros() as usize;
    let is_any = *mask != 0;
    *mask &= mask.wrapping_sub(1);
    is_any.then_some(lane)
}

/// Defines primitives of two rows, lane by lane, on a type of rows.
macro_rules! lanewise {
    ($row:ty: $($name:ident($a:ident, $b:ident) => $body:expr;)*) => {$(
        #[inline(always)]
        fn $name(self, $a: $row, $b: $row) -> $row {
            $body
        }
    )*};
}
use lanewise;

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
            Some(avx2) => $crate::simd::Simd::run(avx2, #[inline(always)] || $work(avx2, $($argument),*)),
            None => {
                let portable = $crate::simd::Portable;
                $crate::simd::Simd::run(portable, #[inline(always)] || $work(portable, $($argument),*))
            }
        }
    };
}

/// Calls a function with a proof of instructions that every processor of the target has, and the arguments.
#[cfg(not(target_arch = "x86_64"))]
macro_rules! dispatch {
    ($work:path, $($argument:expr),*) => {{
        let baseline = $crate::simd::BASELINE;
        $crate::simd::Simd::run(baseline, #[inline(always)] || $work(baseline, $($argument),*))
    }};
}
pub(crate) use dispatch;

/// The best instructions that every processor of the target has.
#[cfg(target_arch = "aarch64")]
pub(crate) const BASELINE: Neon = Neon;

/// The best instructions that every processor of the target has.
#[cfg(not(any(target_arch = "aarch64", target_arch = "x86_64")))]
pub(crate) const BASELINE: Portable = Portable;
