//! The corrections of an estimated row: none, the paper's rules, or integers; and the lazy way, which needs no row.

use super::row_start;

/// From an estimated row to a pair.
pub trait Correction {
    /// The pair, or what comes out instead.
    fn pair(row: i64, k: i64, n: i64) -> (i64, i64);
}

/// Equation 2 and nothing else.
pub struct AsItIs;

impl Correction for AsItIs {
    #[inline(always)]
    fn pair(row: i64, k: i64, n: i64) -> (i64, i64) {
        (row, row + 1 + k - row_start(row, n))
    }
}

/// The two rules of Avril 3.3, word by word and so 1-based between the first line and the last.
pub struct Rules;

impl Correction for Rules {
    #[inline(always)]
    fn pair(row: i64, k: i64, n: i64) -> (i64, i64) {
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

/// Pbig's: the row is moved until it contains the index.
pub struct Integers;

impl Correction for Integers {
    #[inline(always)]
    fn pair(row: i64, k: i64, n: i64) -> (i64, i64) {
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

/// The largest row that starts at or before `k`, by bisection.
#[inline(always)]
pub(super) fn searched_row(k: i64, n: i64) -> i64 {
    let (mut low, mut high) = (0, n - 1);
    while high - low > 1 {
        let middle = (low + high) / 2;
        if row_start(middle, n) <= k { low = middle } else { high = middle }
    }
    low
}

/// So many identifiers has the lazy way (Avril 3.2.2): the last row of the square has no pair.
pub const fn lazy_ids(n: i64) -> i64 {
    n * n - n
}

/// The lazy way (Avril 3.2.2): of [`lazy_ids`] identifiers, those above the diagonal are pairs.
#[inline(always)]
pub fn lazy_pair(id: i64, n: i64) -> Option<(i64, i64)> {
    let (a, b) = (id / n, id % n);
    (a < b).then_some((a, b))
}

#[cfg(test)]
mod tests {
    use super::super::pairs_of;
    use super::*;
    use pbig_harness::pair_index::pair_of;

    fn right(k: i64, n: i64) -> (i64, i64) {
        let (a, b) = pair_of(k as u64, n as u64);
        (a as i64, b as i64)
    }

    #[test]
    fn rules_mend_a_row_that_is_off_by_one_and_no_other() {
        let mut mended_by_two = 0;
        for n in 2..60 {
            for k in 0..pairs_of(n) {
                let row = right(k, n).0;
                for off in -1..=1 {
                    assert_eq!(Rules::pair(row + off, k, n), right(k, n), "n {n}, k {k}, off {off}");
                }
                mended_by_two += u32::from(Rules::pair(row + 2, k, n) == right(k, n));
                assert_ne!(Rules::pair(row - 2, k, n), right(k, n), "n {n}, k {k}");
            }
        }
        assert_eq!(mended_by_two, 0);
    }

    #[test]
    fn integers_mend_any_row() {
        for n in 2..40 {
            for k in 0..pairs_of(n) {
                assert_eq!(searched_row(k, n), right(k, n).0);
                for row in [i64::MIN, -3, 0, 1, n / 2, n, i64::MAX] {
                    assert_eq!(Integers::pair(row, k, n), right(k, n), "n {n}, k {k}, from {row}");
                }
            }
        }
    }
}
