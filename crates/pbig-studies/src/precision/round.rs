//! Rounding outward: what is stored of a minimum is never above it, what is stored of a maximum never below.

use half::f16;

/// Coordinates are clamped to this many cells of the origin. Up to here f64 tells the smallest steps apart; beyond, all
/// coordinates share one place, which costs tests and never a pair. Without it steps would be rounded to multiples of
/// what fixed point wraps around at.
pub const FARTHEST: f64 = (1u64 << 32) as f64;

/// An integer for each f16, in their order; -0 just below 0.
fn ordered(half: f16) -> i16 {
    let bits = half.to_bits() as i16;
    bits ^ (((bits >> 15) as u16) >> 1) as i16
}

/// The value of an integer in the order of f16.
pub fn half_value(integer: i16) -> f32 {
    // The order's inverse is itself.
    f16::from_bits((integer ^ (((integer >> 15) as u16) >> 1) as i16) as u16).to_f32()
}

/// The largest f16 that is not above `x`, as an integer in the order of f16; `x` is no NaN.
#[inline]
pub fn half_down(x: f32) -> i16 {
    // Zeros are one: a box that ends at -0 touches one that begins at 0.
    let x = x + 0.0;
    let nearest = f16::from_f32(x);
    ordered(nearest) - i16::from(nearest.to_f32() > x)
}

/// The smallest f16 that is not below `x`, as an integer in the order of f16; `x` is no NaN.
#[inline]
pub fn half_up(x: f32) -> i16 {
    let x = x + 0.0;
    let nearest = f16::from_f32(x);
    ordered(nearest) + i16::from(nearest.to_f32() < x)
}

/// From coordinates to steps of cells.
#[derive(Clone, Copy, Debug)]
pub struct Scale {
    /// The lower corner of cell 0.
    pub origin: [f32; 3],
    /// The edge of a cell; above 0.
    pub cell: f32,
}

impl Scale {
    #[inline(always)]
    fn cells(&self, axis: usize, x: f32) -> f64 {
        let cells = (f64::from(x) - f64::from(self.origin[axis])) / f64::from(self.cell);
        cells.clamp(-FARTHEST, FARTHEST)
    }

    /// The cell that contains a coordinate.
    pub fn cell(&self, axis: usize, x: f32) -> i64 {
        self.down(axis, x, 1)
    }

    /// Whole steps up to a coordinate: monotone, and never above it.
    #[inline(always)]
    pub fn down(&self, axis: usize, x: f32, steps: u32) -> i64 {
        let exact = self.cells(axis, x) * f64::from(steps);
        let whole = exact as i64;
        whole - i64::from((whole as f64) > exact)
    }

    /// Whole steps to the next one at or above a coordinate: monotone, and never below it.
    #[inline(always)]
    pub fn up(&self, axis: usize, x: f32, steps: u32) -> i64 {
        let exact = self.cells(axis, x) * f64::from(steps);
        let whole = exact as i64;
        whole + i64::from((whole as f64) < exact)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_f16_is_itself_and_what_lies_beside_it_is_rounded_outward() {
        for bits in 0..=u16::MAX {
            let x = f16::from_bits(bits).to_f32();
            if x.is_nan() {
                continue;
            }
            assert_eq!((half_value(half_down(x)), half_value(half_up(x))), (x, x));
            for beside in [x.next_down(), x.next_up()].into_iter().filter(|x| x.is_finite()) {
                let (down, up) = (half_down(beside), half_up(beside));
                assert!(half_value(down) <= beside && beside <= half_value(up), "{beside:e}: {down} {up}");
                // None lies between; -0 and 0 are two integers.
                assert!(up - down <= 2 && half_value(down + 1) >= beside, "{beside:e}: {down} {up}");
            }
        }
    }

    #[test]
    fn steps_are_whole_numbers_around_the_exact_one() {
        let scale = Scale { origin: [-3.0, 0.0, 0.0], cell: 0.1 };
        for x in [-5.0f32, -3.0, -2.95, -0.0, 0.0, 1e-40, 0.05, 7.3, 1e8] {
            let exact = (f64::from(x) + 3.0) / f64::from(0.1f32) * 64.0;
            let (down, up) = (scale.down(0, x, 64) as f64, scale.up(0, x, 64) as f64);
            assert!(down <= exact && exact <= up && up - down <= 1.0, "{x}: {down} {up}");
        }
        assert_eq!(scale.down(0, f32::MAX, 8192), scale.up(0, f32::INFINITY, 8192));
    }
}
