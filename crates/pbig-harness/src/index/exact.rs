//! Ways that estimate nothing, and so should never be wrong: what becomes of all pairs.

use super::tally::{self, Tally};
use super::{AsItIs, Correction, correct, discriminant, lazy_pair, pairs_of, root};

/// A way without an estimate.
pub struct Exact {
    /// What it is called.
    pub name: &'static str,
    /// Over all pairs of some boxes.
    pub tally: fn(i64) -> Tally,
}

/// All of them.
pub const EXACT: [Exact; 3] = [
    Exact { name: "bisection over rows", tally: by_bisection },
    Exact { name: "integer root", tally: by_integer_root },
    Exact { name: "lazy way", tally: lazily },
];

fn by_rows(n: i64, row: impl Fn(i64) -> i64) -> Tally {
    tally::of(n, (0..pairs_of(n)).map(|k| AsItIs::pair(row(k), k, n)))
}

fn by_bisection(n: i64) -> Tally {
    by_rows(n, |k| correct::searched_row(k, n))
}

fn by_integer_root(n: i64) -> Tally {
    by_rows(n, |k| root::integer_row(2 * n - 1, discriminant(k, n)))
}

fn lazily(n: i64) -> Tally {
    tally::of(n, (0..n * n).filter_map(|id| lazy_pair(id, n)))
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
    }
}
