//! Steps and codes: the place of a box in integers. See the cells of the grid.

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

/// By mask: the numbers of its set bits, a byte each, lowest first.
pub(super) static SET_BITS: [u64; 256] = {
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

#[inline(always)]
pub(super) fn steps(origin: &[f64; 4], scale: &[f64; 4], &[x, y, z]: &[f32; 3]) -> Steps {
    let (corner, mut steps) = ([x, y, z, 0.0], [0; 4]);
    for k in 0..4 {
        let x = (f64::from(corner[k]) - origin[k]) * scale[k];
        // Comparisons rather than `clamp`, which keeps a NaN.
        let x = if x < MAX_STEP { x } else { MAX_STEP };
        let x = if x > MIN_STEP { x } else { MIN_STEP };
        steps[k] = round_to_i32(x);
    }
    steps
}

/// Rounds to the nearest integer, ties to even, for |x| < 2^31: the sum's lowest bits are the integer.
#[inline(always)]
fn round_to_i32(x: f64) -> i32 {
    const SHIFT: f64 = 6_755_399_441_055_744.0; // 1.5 * 2^52
    (x + SHIFT).to_bits() as i32
}

/// Returns the query that finds the codes of boxes which overlap the box of `code`.
#[inline(always)]
pub(crate) fn query_of(code: u64) -> u64 {
    code.rotate_left(32)
}
