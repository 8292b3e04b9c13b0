//! Steps and codes: the place of a box in integers. See the cells of the grid.

use crate::Aabb;

/// Coordinates in steps, an axis a lane; the fourth lane is unused.
pub(crate) type Steps = [i32; 4];

/// Coordinates beyond these steps are clamped: steps must fit an `i32` with room for a window. Both ends lie in different
/// cells of a grid that wraps, so that boxes far away on different sides do not meet there.
pub(super) const MIN_STEP: f64 = -((1u32 << 29) as f64);
pub(super) const MAX_STEP: f64 = ((1u32 << 29) + 21 * 64) as f64;

/// The sign bits of a code's six fields.
pub(super) const APART: u64 = 0x1004_0100_1004_0100;

/// A code that matches no query, for slots whose box has moved away. Its two bits are never set otherwise.
pub(crate) const TOMBSTONE: u64 = 1 << 30 | 1 << 62;

/// Returns both corners of a box in steps, on any processor.
#[inline(always)]
pub(super) fn steps_portable(origin: &[f64; 4], scale: &[f64; 4], aabb: &Aabb) -> (Steps, Steps) {
    let step = |k: usize, x: f32| {
        let x = (f64::from(x) - origin[k]) * scale[k];
        // Comparisons rather than `clamp`, which keeps a NaN.
        let x = if x < MAX_STEP { x } else { MAX_STEP };
        let x = if x > MIN_STEP { x } else { MIN_STEP };
        round_to_i32(x)
    };
    let corner = |corner: &[f32; 3]| [step(0, corner[0]), step(1, corner[1]), step(2, corner[2]), 0];
    (corner(&aabb.min), corner(&aabb.max))
}

/// Rounds to the nearest integer, ties to even, for |x| < 2^31: the sum's lowest bits are the integer.
#[inline(always)]
fn round_to_i32(x: f64) -> i32 {
    const SHIFT: f64 = 6_755_399_441_055_744.0; // 1.5 * 2^52
    (x + SHIFT).to_bits() as i32
}

/// Returns the code of a box: `-low` and `high` on each axis, modulo 512 steps, ten bits a field.
#[inline(always)]
pub(super) fn code_portable(low: Steps, high: Steps) -> u64 {
    let field = |step: i32, k: usize| u64::from(step as u32 & 511) << (10 * k);
    let half = |of: Steps, sign: i32| {
        field(sign.wrapping_mul(of[0]), 0)
            | field(sign.wrapping_mul(of[1]), 1)
            | field(sign.wrapping_mul(of[2]), 2)
    };
    half(low, -1) | half(high, 1) << 32
}

/// Returns the query that finds the codes of boxes which overlap the box of `code`.
#[inline(always)]
pub(crate) fn query_of(code: u64) -> u64 {
    code.rotate_left(32)
}
