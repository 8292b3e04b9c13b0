//! Ways that estimate nothing, and so should never be wrong: what becomes of all pairs.

use super::tally::{self, Tally};
use super::{AsItIs, Correction, correct, discriminant, lazy_ids, lazy_pair, pairs_of, root, row_start};

/// A way without an estimate.
pub struct Exact {
    /// Its name.
    pub name: &'static str,
    /// Over all pairs of some boxes.
    pub tally: fn(i64) -> Tally,
    /// Returns the number of first and last indices of rows, or identifiers, that give a wrong pair.
    pub wrong_ends: fn(i64) -> u64,
}

/// All of them.
pub const EXACT: [Exact; 3] = [
    Exact {
        name: "bisection over rows",
        tally: |n| by_rows(n, |k| correct::searched_row(k, n)),
        wrong_ends: |n| wrong_ends(n, |k| correct::searched_row(k, n)),
    },
    Exact {
        name: "integer root",
        tally: |n| by_rows(n, |k| root::integer_row(2 * n - 1, discriminant(k, n))),
        wrong_ends: |n| wrong_ends(n, |k| root::integer_row(2 * n - 1, discriminant(k, n))),
    },
    Exact { name: "lazy way", tally: lazily, wrong_ends: |n| wrong_identifiers(n, |id| lazy_pair(id, n)) },
];

fn by_rows(n: i64, row: impl Fn(i64) -> i64) -> Tally {
    tally::of(n, (0..pairs_of(n)).map(|k| AsItIs::pair(row(k), k, n)))
}

fn wrong_ends(n: i64, row: impl Fn(i64) -> i64) -> u64 {
    let wrong = |a: &i64| row(row_start(*a, n)) != *a || row(row_start(a + 1, n) - 1) != *a;
    (0..n - 1).filter(wrong).count() as u64
}

/// The first and last of each row of the square but the last, and those about the diagonal.
fn wrong_identifiers(n: i64, pair: impl Fn(i64) -> Option<(i64, i64)>) -> u64 {
    let places = (0..n - 1).flat_map(|a| [0, a - 1, a, a + 1, n - 1].map(|b| (a, b.clamp(0, n - 1))));
    places.filter(|&(a, b)| pair(a * n + b) != (a < b).then_some((a, b))).count() as u64
}

fn lazily(n: i64) -> Tally {
    tally::of(n, (0..lazy_ids(n)).filter_map(|id| lazy_pair(id, n)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn none_of_them_is_wrong_and_a_wrong_row_would_be_seen() {
        for n in (2..40).chain([300]) {
            let right = Tally { pairs: pairs_of(n) as u64, ..Tally::default() };
            for way in EXACT {
                assert_eq!((way.tally)(n), right, "{} {n}", way.name);
            }
        }
        let off = by_rows(30, |k| correct::searched_row(k, 30) + i64::from(k == 5));
        assert_eq!((off.wrong, off.worst_row), (1, 1));
        for n in (2..40).chain([300, 4999, 5000]) {
            EXACT.iter().for_each(|way| assert_eq!((way.wrong_ends)(n), 0, "{} {n}", way.name));
        }
        let last_of_row_0 = |k| correct::searched_row(k, 30) + i64::from(k == 28);
        assert_eq!(wrong_ends(30, last_of_row_0), 1);
        assert_eq!(wrong_identifiers(30, |id| lazy_pair(id, 30).filter(|_| id != 29)), 1);
    }
}
