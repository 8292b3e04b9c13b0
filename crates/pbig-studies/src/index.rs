//! Ways from the index of a pair to the pair (Avril et al. 2012, 3.2 and 3.3): roots that estimate the row, and corrections of the
//! estimate. Rows, columns and indices count from 0, as in [`pbig_harness::pair_index`], which is pbig's own way.

/// Carmack's constant, as Avril 3.3 has it.
pub(crate) const CARMACK: u32 = 0x5f37_59df;
/// Lomont's constant (Avril 3.3).
pub(crate) const LOMONT: u32 = 0x5f37_5a86;

/// A pair, or what comes out instead.
pub(crate) type Given = (i64, i64);

/// Returns the index of the first pair of row `a`, also of rows that do not exist.
#[inline(always)]
pub(crate) const fn row_start(a: i64, n: i64) -> i64 {
    a * (2 * n - a - 1) / 2
}

/// Returns the first and the last index of row `a`.
pub(crate) const fn ends(a: i64, n: i64) -> [i64; 2] {
    [row_start(a, n), row_start(a + 1, n) - 1]
}

/// Returns the number of pairs of `n` boxes.
pub(crate) const fn pairs_of(n: i64) -> i64 {
    n * (n - 1) / 2
}

/// Returns the number under the root of equation 1.
#[inline(always)]
pub(crate) const fn discriminant(k: i64, n: i64) -> i64 {
    let m = 2 * n - 1;
    m * m - 8 * k
}

/// An estimate of the row by equation 1: `(2n - 1 - sqrt((2n - 1)^2 - 8k)) / 2` without its fraction. The number under the root is
/// an exact integer, but for [`AllSingle`] and [`Printed`].
pub(crate) trait Root {
    /// Estimates the row from `m = 2n - 1` and `x = m^2 - 8k`.
    fn row(m: i64, x: i64) -> i64;

    /// Returns the largest relative error of the root.
    fn worst_relative() -> f64 {
        f64::INFINITY
    }
}

/// A square root in f32, of numbers from 1 on.
pub(crate) trait SingleRoot {
    /// Returns the root.
    fn root(x: f32) -> f32;
}

impl<R: SingleRoot> Root for R {
    #[inline(always)]
    fn row(m: i64, x: i64) -> i64 {
        ((m as f32 - R::root(x as f32)) * 0.5) as i64
    }

    /// Every root treats a number and four times that number alike, so floats from 1 to 4 are enough.
    fn worst_relative() -> f64 {
        let floats = (1f32.to_bits()..4f32.to_bits()).map(f32::from_bits);
        floats.map(|x| (f64::from(R::root(x)) / f64::from(x).sqrt() - 1.0).abs()).fold(0.0, f64::max)
    }
}

/// The processor's root in f32.
pub(crate) struct Single;

impl SingleRoot for Single {
    #[inline(always)]
    fn root(x: f32) -> f32 {
        x.sqrt()
    }
}

/// A root from the inverse root: the exponent halved by integers, then Newton's steps (Avril 3.3). `WIDE`: a step is computed in
/// f64 and rounded once, which gives the paper's figures for two steps.
pub(crate) struct Newton<const MAGIC: u32, const STEPS: u32, const WIDE: bool = false>;

impl<const MAGIC: u32, const STEPS: u32, const WIDE: bool> SingleRoot for Newton<MAGIC, STEPS, WIDE> {
    #[inline(always)]
    fn root(x: f32) -> f32 {
        let half = x * 0.5;
        let mut y = f32::from_bits(MAGIC - (x.to_bits() >> 1));
        for _ in 0..STEPS {
            let wide = f64::from(y);
            y = if WIDE {
                (wide * (1.5 - f64::from(half) * wide * wide)) as f32
            } else {
                y * (1.5 - half * y * y)
            };
        }
        x * y
    }
}

/// The processor's root in f64.
pub(crate) struct Double;

impl Root for Double {
    #[inline(always)]
    fn row(m: i64, x: i64) -> i64 {
        ((m as f64 - (x as f64).sqrt()) * 0.5) as i64
    }

    fn worst_relative() -> f64 {
        f64::EPSILON
    }
}

/// Equation 1 on a device without 64-bit integers: the number under the root is f32, too. Two large numbers are subtracted, so
/// nothing of a small root need be left.
pub(crate) struct AllSingle;

impl Root for AllSingle {
    #[inline(always)]
    fn row(m: i64, x: i64) -> i64 {
        let (eight_k, m) = ((m * m - x) as f32, m as f32);
        ((m - (m * m - eight_k).sqrt()) * 0.5) as i64
    }
}

/// Equation 1 as it is printed, in that order and all in f32: rows count from 1 there, indices from 0.
pub(crate) struct Printed;

impl Root for Printed {
    #[inline(always)]
    fn row(m: i64, x: i64) -> i64 {
        let (n, k) = (((m + 1) / 2) as f32, ((m * m - x) / 8) as f32);
        let row = (-(2.0 * n + 1.0) + (4.0 * n * n - 4.0 * n - 8.0 * k + 1.0).sqrt()) / -2.0;
        (row - 1.0).floor() as i64
    }
}

/// The row by the root of an integer, rounded up: `2a <= m - sqrt(x)` holds when it holds for that.
pub(crate) struct IntegerRoot;

impl Root for IntegerRoot {
    #[inline(always)]
    fn row(m: i64, x: i64) -> i64 {
        let root = x.isqrt();
        (m - root - i64::from(root * root < x)) / 2
    }
}

/// The row by bisection over the starts of rows, as a kernel does it.
pub(crate) struct Bisection;

impl Root for Bisection {
    #[inline(always)]
    fn row(m: i64, x: i64) -> i64 {
        row_by_bisection((m * m - x) / 8, (m + 1) / 2)
    }
}

/// Returns the largest row that starts at or before `k`.
#[inline(always)]
pub(crate) fn row_by_bisection(k: i64, n: i64) -> i64 {
    let (mut low, mut high) = (0, n - 1);
    while high - low > 1 {
        let middle = (low + high) / 2;
        if row_start(middle, n) <= k { low = middle } else { high = middle }
    }
    low
}

/// A way from an estimated row to a pair. None changes a right row.
pub(crate) trait Correction {
    /// Returns the pair of index `k`, or what comes out instead.
    fn pair(row: i64, k: i64, n: i64) -> Given;
}

/// The names of the corrections, in the order in which they are counted and timed.
pub(crate) const CORRECTIONS: [&str; 3] = ["as it is", "the paper's rules", "integers"];

/// Equation 2 and nothing else.
pub(crate) struct AsItIs;

impl Correction for AsItIs {
    #[inline(always)]
    fn pair(row: i64, k: i64, n: i64) -> Given {
        (row, row + 1 + k - row_start(row, n))
    }
}

/// The two rules of Avril 3.3, word by word, and so counted from 1 between the first line and the last.
pub(crate) struct Rules;

impl Correction for Rules {
    #[inline(always)]
    fn pair(row: i64, k: i64, n: i64) -> Given {
        let (mut a, mut b) = AsItIs::pair(row, k, n);
        (a, b) = (a + 1, b + 1);
        if b > n {
            a += 1;
            b = a + (b - n);
        }
        if a >= b {
            b = n - (a - b);
            a -= 1;
        }
        (a - 1, b - 1)
    }
}

/// Pbig's correction: the row is moved until it contains the index.
pub(crate) struct Integers;

impl Correction for Integers {
    #[inline(always)]
    fn pair(row: i64, k: i64, n: i64) -> Given {
        let mut a = row.clamp(0, n - 2);
        while row_start(a, n) > k {
            a -= 1;
        }
        while a + 2 < n && row_start(a + 1, n) <= k {
            a += 1;
        }
        AsItIs::pair(a, k, n)
    }
}

/// Returns the number of identifiers of the lazy way (Avril 3.2.2): the last row of the square has no pair.
pub(crate) const fn lazy_ids(n: i64) -> i64 {
    n * n - n
}

/// Returns the pair of an identifier by the lazy way: those above the diagonal are pairs.
#[inline(always)]
pub(crate) fn lazy_pair(id: i64, n: i64) -> Option<Given> {
    let (a, b) = (id / n, id % n);
    (a < b).then_some((a, b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use pbig_harness::pair_index::pair_of;

    #[test]
    fn rules_mend_a_row_that_is_off_by_one_and_no_other_and_integers_mend_any() {
        for n in 2..50 {
            for k in 0..pairs_of(n) {
                let (a, b) = pair_of(k as u64, n as u64);
                let (row, right) = (a as i64, (a as i64, b as i64));
                assert!((-1..=1).all(|off| Rules::pair(row + off, k, n) == right), "n {n}, k {k}");
                assert!([-2, 2].iter().all(|off| Rules::pair(row + off, k, n) != right), "n {n}, k {k}");
                let rows = [i64::MIN, -3, 0, 1, n / 2, n, i64::MAX];
                assert!(rows.iter().all(|row| Integers::pair(*row, k, n) == right), "n {n}, k {k}");
                let (m, x) = (2 * n - 1, discriminant(k, n));
                assert_eq!([IntegerRoot::row(m, x), Bisection::row(m, x)], [row; 2], "n {n}, k {k}");
            }
        }
    }

    #[test]
    fn relative_errors_are_those_of_the_literature() {
        // Lomont: 0.00175233 for Carmack's constant after one step, a little less for his own.
        let carmack = Newton::<CARMACK, 1>::worst_relative();
        assert!((carmack - 0.001_752).abs() < 1e-6, "{carmack}");
        assert!(Newton::<LOMONT, 1>::worst_relative() < carmack && Single::worst_relative() < 6e-8);
    }
}
