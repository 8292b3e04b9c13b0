//! Square roots, and the rows that they estimate.

/// Carmack's constant, as Avril 3.3 has it.
pub const CARMACK: u32 = 0x5f37_59df;
/// Lomont's (Avril 3.3).
pub const LOMONT: u32 = 0x5f37_5a86;

/// A square root by which a row is estimated: equation 1, 0-based, `(2n - 1 - sqrt((2n - 1)^2 - 8k)) / 2`
/// without its fraction. What stands under the root is an exact integer and rounded once, but for [`AllSingle`] and
/// [`Printed`].
pub trait Root {
    /// The estimate from `m = 2n - 1` and `x = m^2 - 8k`.
    fn row(m: i64, x: i64) -> i64;

    /// The largest relative error of the root.
    fn worst_relative() -> f64;
}

/// A square root in f32.
pub trait SingleRoot {
    /// The root of a number from 1 on.
    fn root(x: f32) -> f32;
}

/// The processor's, in f32.
pub struct Single;

impl SingleRoot for Single {
    #[inline(always)]
    fn root(x: f32) -> f32 {
        x.sqrt()
    }
}

/// A root from the inverse root: the exponent halved by integer arithmetic, then Newton's steps (Avril 3.3).
pub struct Newton<const MAGIC: u32, const STEPS: u32>;

impl<const MAGIC: u32, const STEPS: u32> SingleRoot for Newton<MAGIC, STEPS> {
    #[inline(always)]
    fn root(x: f32) -> f32 {
        let half = x * 0.5;
        let mut y = f32::from_bits(MAGIC - (x.to_bits() >> 1));
        for _ in 0..STEPS {
            y *= 1.5 - half * y * y;
        }
        x * y
    }
}

/// Newton steps, each computed in f64 and rounded to f32 once, as processors do that compute in wider registers.
/// The paper's figures for two steps are those of this one, digit by digit.
pub struct WideNewton<const MAGIC: u32, const STEPS: u32>;

impl<const MAGIC: u32, const STEPS: u32> SingleRoot for WideNewton<MAGIC, STEPS> {
    #[inline(always)]
    fn root(x: f32) -> f32 {
        let half = f64::from(x * 0.5);
        let mut y = f32::from_bits(MAGIC - (x.to_bits() >> 1));
        for _ in 0..STEPS {
            let wide = f64::from(y);
            y = (wide * (1.5 - half * wide * wide)) as f32;
        }
        x * y
    }
}

impl<R: SingleRoot> Root for R {
    #[inline(always)]
    fn row(m: i64, x: i64) -> i64 {
        ((m as f32 - R::root(x as f32)) * 0.5) as i64
    }

    /// Over all floats from 1 to 4, as every root treats a number and four times that number alike.
    fn worst_relative() -> f64 {
        let floats = (1f32.to_bits()..4f32.to_bits()).map(f32::from_bits);
        floats.map(|x| (f64::from(R::root(x)) / f64::from(x).sqrt() - 1.0).abs()).fold(0.0, f64::max)
    }
}

/// The processor's, in f64.
pub struct Double;

impl Root for Double {
    #[inline(always)]
    fn row(m: i64, x: i64) -> i64 {
        ((m as f64 - (x as f64).sqrt()) * 0.5) as i64
    }

    fn worst_relative() -> f64 {
        f64::EPSILON
    }
}

/// As [`Single`], with what stands under the root in f32, too: equation 1 on a device that has no 64-bit integers.
pub struct AllSingle;

impl AllSingle {
    #[inline(always)]
    fn estimate(m: f32, eight_k: f32) -> f32 {
        (m - (m * m - eight_k).sqrt()) * 0.5
    }
}

impl Root for AllSingle {
    #[inline(always)]
    fn row(m: i64, x: i64) -> i64 {
        Self::estimate(m as f32, (m * m - x) as f32) as i64
    }

    /// Two large numbers are subtracted: nothing of a small root need be left.
    fn worst_relative() -> f64 {
        f64::INFINITY
    }
}

/// Equation 1 as it is printed, in that order and all in f32: rows are counted from 1 there, indices from 0.
pub struct Printed;

impl Printed {
    #[inline(always)]
    fn estimate(n: f32, k: f32) -> f32 {
        (-(2.0 * n + 1.0) + (4.0 * n * n - 4.0 * n - 8.0 * k + 1.0).sqrt()) / -2.0 - 1.0
    }
}

impl Root for Printed {
    #[inline(always)]
    fn row(m: i64, x: i64) -> i64 {
        Self::estimate(((m + 1) / 2) as f32, ((m * m - x) / 8) as f32).floor() as i64
    }

    /// As of [`AllSingle`].
    fn worst_relative() -> f64 {
        f64::INFINITY
    }
}

/// The row by integers alone: `2a <= m - sqrt(x)` holds when it holds for the root rounded up.
#[inline(always)]
pub(super) fn integer_row(m: i64, x: i64) -> i64 {
    let x = x as u64;
    let root = x.isqrt();
    let up = root + u64::from(root * root < x);
    (m - up as i64) / 2
}

#[cfg(test)]
mod tests {
    use super::super::{discriminant, pairs_of};
    use super::*;
    use pbig_harness::pair_index::pair_of;

    #[test]
    fn the_integer_root_gives_every_row() {
        for n in (2..80).chain([1000, 4609]) {
            for k in 0..pairs_of(n) {
                let row = integer_row(2 * n - 1, discriminant(k, n));
                assert_eq!(row as u64, pair_of(k as u64, n as u64).0, "n {n}, k {k}");
            }
        }
    }

    #[test]
    fn relative_errors_are_those_of_the_literature() {
        // Lomont: 0.00175233 for Carmack's constant after one step, a little less for his own.
        let carmack = Newton::<CARMACK, 1>::worst_relative();
        assert!((carmack - 0.001_752).abs() < 1e-6, "{carmack}");
        assert!(Newton::<LOMONT, 1>::worst_relative() < carmack);
        assert!(Single::worst_relative() < 6e-8);
    }
}
