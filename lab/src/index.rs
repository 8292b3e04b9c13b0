//! Ways from the index of a pair to the pair (Avril et al. 2012, 3.2 and 3.3): roots that estimate the row, and corrections of the
//! estimate. Rows, columns and indices count from 0, as in [`pbig_harness::pair_index`], which is pbig's own way.

/// Carmack's constant, as Avril 3.3 has it.
const CARMACK: u32 = 0x5f37_59df;

/// A pair, or what comes out instead.
pub(crate) type Given = (i64, i64);

/// Returns the index of the first pair of row `a`, also of rows that do not exist.
#[inline(always)]
const fn row_start(a: i64, n: i64) -> i64 {
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
const fn discriminant(k: i64, n: i64) -> i64 {
    let m = 2 * n - 1;
    m * m - 8 * k
}

/// An estimate of the row: from an index and the number of boxes.
pub(crate) trait RowEstimate: Fn(i64, i64) -> i64 + Copy + Send + Sync + 'static {}

impl<R: Fn(i64, i64) -> i64 + Copy + Send + Sync + 'static> RowEstimate for R {}

/// Returns the row by equation 1, `(2n - 1 - sqrt((2n - 1)^2 - 8k)) / 2` without its fraction, with a root in f32. The number under
/// the root is an exact integer.
#[inline(always)]
pub(crate) fn row_by(root: impl Fn(f32) -> f32 + Copy + Send + Sync + 'static) -> impl RowEstimate {
    move |k, n| (((2 * n - 1) as f32 - root(discriminant(k, n) as f32)) * 0.5) as i64
}

/// Returns the largest relative error of a root in f32. Every root treats a number and four times that number alike, so floats
/// from 1 to 4 are enough.
pub(crate) fn worst_relative(root: impl Fn(f32) -> f32) -> f64 {
    let floats = (1f32.to_bits()..4f32.to_bits()).map(f32::from_bits);
    floats.map(|x| (f64::from(root(x)) / f64::from(x).sqrt() - 1.0).abs()).fold(0.0, f64::max)
}

/// Returns the root of a number from 1 on, by the inverse root: the exponent halved by integers, then Newton's steps (Avril 3.3).
/// `WIDE`: a step is computed in f64 and rounded once, which gives the paper's figures for two steps.
#[inline(always)]
pub(crate) fn newton<const STEPS: u32, const WIDE: bool>(x: f32) -> f32 {
    let half = x * 0.5;
    let mut y = f32::from_bits(CARMACK - (x.to_bits() >> 1));
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

/// Returns the row by the processor's root in f64.
#[inline(always)]
pub(crate) fn row_in_f64(k: i64, n: i64) -> i64 {
    (((2 * n - 1) as f64 - (discriminant(k, n) as f64).sqrt()) * 0.5) as i64
}

/// Returns the row by equation 1 as it is printed, in that order and all in f32: rows count from 1 there, indices from 0.
#[inline(always)]
pub(crate) fn row_as_printed(k: i64, n: i64) -> i64 {
    let (n, k) = (n as f32, k as f32);
    let row = (-(2.0 * n + 1.0) + (4.0 * n * n - 4.0 * n - 8.0 * k + 1.0).sqrt()) / -2.0;
    (row - 1.0).floor() as i64
}

/// Makes a pair from an estimated row, the index and the number of boxes. A right row stays as it is.
type Correct = fn(i64, i64, i64) -> Given;

/// The corrections, in the order of counts and times.
pub(crate) const CORRECTIONS: [(&str, Correct); 3] =
    [("as it is", as_it_is), ("the paper's rules", rules), ("integers", integers)];

/// Makes the pair by equation 2 and nothing else.
#[inline(always)]
pub(crate) fn as_it_is(row: i64, k: i64, n: i64) -> Given {
    (row, row + 1 + k - row_start(row, n))
}

/// Makes the pair by the two rules of Avril 3.3, word by word, and so counted from 1 between the first line and the last.
#[inline(always)]
pub(crate) fn rules(row: i64, k: i64, n: i64) -> Given {
    let (mut a, mut b) = as_it_is(row, k, n);
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

/// Makes the pair by pbig's correction: the row is moved until it contains the index.
#[inline(always)]
pub(crate) fn integers(row: i64, k: i64, n: i64) -> Given {
    let mut a = row.clamp(0, n - 2);
    while row_start(a, n) > k {
        a -= 1;
    }
    while a + 2 < n && row_start(a + 1, n) <= k {
        a += 1;
    }
    as_it_is(a, k, n)
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
    fn rules_mend_a_row_off_by_one_and_integers_mend_any() {
        for n in 2..50 {
            for k in 0..pairs_of(n) {
                let (a, b) = pair_of(k as u64, n as u64);
                let (row, right) = (a as i64, (a as i64, b as i64));
                assert!((-1..=1).all(|off| rules(row + off, k, n) == right), "n {n}, k {k}");
                assert!([-2, 2].iter().all(|off| rules(row + off, k, n) != right), "n {n}, k {k}");
                let rows = [i64::MIN, -3, 0, 1, n / 2, n, i64::MAX];
                assert!(rows.iter().all(|row| integers(*row, k, n) == right), "n {n}, k {k}");
            }
        }
    }

    #[test]
    fn integers_are_right_at_both_ends_of_a_million_rows() {
        let n = 1 << 20;
        for row in 0..n - 1 {
            let [first, last] = ends(row, n);
            let wanted = [(row, row + 1), (row, n - 1)];
            assert_eq!([first, last].map(|k| integers(row_by(f32::sqrt)(k, n), k, n)), wanted);
        }
    }

    #[test]
    fn the_relative_error_is_that_of_the_literature() {
        // 0.00175233 for Carmack's constant after one step.
        let carmack = worst_relative(newton::<1, false>);
        assert!((carmack - 0.001_752).abs() < 1e-6 && worst_relative(f32::sqrt) < 6e-8, "{carmack}");
    }
}
