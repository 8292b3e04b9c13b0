//! Conversion of the index of a pair to the pair and back, without memory access (Avril et al. 2012, 3.2).
//!
//! All pairs `(a, b)`, `a < b < n`, are numbered row by row: `(0, 1), (0, 2), .., (n-2, n-1)`.
//! Everything here is 0-based; the paper numbers boxes from 1 and pairs from 0.
//!
//! Two forms: the triangle ([`pair_of`], for small cells) gives each thread one pair, the balanced
//! rows ([`row_len`], [`row_pair`], PBIG 5.1, for large cells) give each thread one box and equally
//! many partners.
//!
//! ```
//! use pbig_harness::pair_index::{index_of, pair_of};
//! // The paper's example, n = 1000: pair 71452 is (75, 303) counted from 1.
//! assert_eq!(pair_of(71_452, 1000), (74, 302));
//! assert_eq!(index_of(74, 302, 1000), 71_452);
//! ```

/// Returns the number of pairs of `n <= 2^32` boxes.
#[inline]
pub const fn pair_count(n: u64) -> u64 {
    // One of n, n - 1 is even: halve that one, so that the product stays below 2^63.
    if n.is_multiple_of(2) { n / 2 * n.saturating_sub(1) } else { (n - 1) / 2 * n }
}

/// Returns the index of the first pair of row `a < n <= 2^32` (the paper's S_a): `a (2n - a - 1) / 2`.
#[inline]
pub fn row_start(a: u64, n: u64) -> u64 {
    assert!(a < n, "row {a} of {n} boxes");
    let other = 2 * n - a - 1;
    if a.is_multiple_of(2) { a / 2 * other } else { other / 2 * a }
}

/// Returns the index of the pair `(a, b)`, `a < b < n <= 2^32` (equation 2, solved for k).
#[inline]
pub fn index_of(a: u64, b: u64, n: u64) -> u64 {
    assert!(a < b && b < n, "pair ({a}, {b}) of {n} boxes");
    row_start(a, n) + (b - a - 1)
}

/// Returns the pair with index `k < pair_count(n)`, for every `2 <= n <= 2^32` (equations 1 and 2).
///
/// The square root gives the row to within one or two, however it is rounded. The integer
/// correction makes it exact. The paper corrects from the resulting pair instead,
/// and has its sign of `8k` wrong in the text (section 3.3), right in equation 1.
#[inline]
pub fn pair_of(k: u64, n: u64) -> (u64, u64) {
    let m = u128::from(2 * n - 1);
    let root = ((m * m - 8 * u128::from(k)) as f64).sqrt();
    let mut a = (((m as f64 - root) / 2.0) as u64).min(n - 2);
    while row_start(a, n) > k {
        a -= 1;
    }
    while a + 2 < n && row_start(a + 1, n) <= k {
        a += 1;
    }
    (a, a + 1 + (k - row_start(a, n)))
}

/// Returns the number of partners in balanced row `i` of `n` boxes: PBIG's equation 7 with `m = n`, less the diagonal, where a
/// box meets itself.
#[inline]
pub fn row_len(i: u32, n: u32) -> u32 {
    let longer = n.is_multiple_of(2) && i < n / 2;
    n.saturating_sub(1) / 2 + u32::from(longer)
}

/// Returns the `k`-th pair of row `i`, `k < row_len(i, n)`: the next boxes, around the end (the shifted
/// elements of PBIG's figure 3).
#[inline]
pub fn row_pair(i: u32, k: u32, n: u32) -> (u32, u32) {
    let (j, n) = (u64::from(i) + 1 + u64::from(k), u64::from(n));
    (i, (if j >= n { j - n } else { j }) as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pair_of_every_small_n_once_in_order() {
        for n in 0..130u64 {
            let wanted: Vec<_> = (0..n).flat_map(|a| (a + 1..n).map(move |b| (a, b))).collect();
            let got: Vec<_> = (0..pair_count(n)).map(|k| pair_of(k, n)).collect();
            assert_eq!(got, wanted, "n = {n}");
            assert!(wanted.iter().enumerate().all(|(k, p)| index_of(p.0, p.1, n) == k as u64));
        }
    }

    #[test]
    fn exact_at_both_ends_of_every_row_up_to_two_to_the_32() {
        // The ends of rows are where a rounded root is wrong; odd, even and extreme n.
        for n in [4609, 46_342, 65_536, 92_683, 1 << 20, (1 << 31) + 1, (1 << 32) - 1, 1 << 32] {
            for a in rows_worth_trying(n) {
                let (first, last) = (row_start(a, n), index_of(a, n - 1, n));
                assert_eq!(pair_of(first, n), (a, a + 1), "first of row {a}, n = {n}");
                assert_eq!(pair_of(last, n), (a, n - 1), "last of row {a}, n = {n}");
            }
        }
    }

    fn rows_worth_trying(n: u64) -> impl Iterator<Item = u64> {
        let spread = (0..4096).map(move |i| i * (n - 2) / 4095);
        (0..2000).chain(n - 2000..n - 1).chain(spread).filter(move |a| a + 1 < n)
    }

    #[test]
    fn balanced_rows_cover_each_pair_once_and_differ_by_one() {
        for n in 0..70u32 {
            let mut seen: Vec<_> = (0..n)
                .flat_map(|i| (0..row_len(i, n)).map(move |k| row_pair(i, k, n)))
                .map(|(i, j)| (i.min(j), i.max(j)))
                .collect();
            seen.sort_unstable();
            let wanted: Vec<_> = (0..n).flat_map(|a| (a + 1..n).map(move |b| (a, b))).collect();
            assert_eq!(seen, wanted, "n = {n}");
        }
    }

    #[test]
    fn balanced_rows_of_the_paper_figure_3() {
        // Eight threads: five pairs each in the top half, four in the bottom, diagonal included.
        let with_diagonal: Vec<_> = (0..8).map(|i| row_len(i, 8) + 1).collect();
        assert_eq!(with_diagonal, [5, 5, 5, 5, 4, 4, 4, 4]);
        // (0, 5) is shifted to (5, 0).
        assert_eq!(row_pair(5, 2, 8), (5, 0));
    }
}
