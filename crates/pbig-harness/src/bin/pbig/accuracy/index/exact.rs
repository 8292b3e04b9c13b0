//! Ways without an estimate: whether they are as right as they should be.

use pbig_harness::index::{EXACT, Exact, Tally};
use rayon::prelude::*;

/// What comes of all pairs, for some n.
pub(super) struct Exactly {
    pub(super) name: &'static str,
    pub(super) values: u64,
    pub(super) most: i64,
    pub(super) tally: Tally,
    /// The smallest n with a wrong pair.
    pub(super) first: Option<i64>,
}

/// Fewer than of the others: these take up to ten times as long for a pair.
fn boxes(quick: bool) -> Vec<i64> {
    if quick {
        (2..=100).chain([1000]).collect()
    } else {
        (2..=500).chain((1000..=5000).step_by(1000)).collect()
    }
}

pub(super) fn tallied(quick: bool) -> Vec<Exactly> {
    EXACT.iter().map(|way| of(way, &boxes(quick))).collect()
}

fn of(way: &Exact, boxes: &[i64]) -> Exactly {
    let tallies: Vec<Tally> = boxes.par_iter().map(|&n| (way.tally)(n)).collect();
    let (mut tally, mut first) = (Tally::default(), None);
    for (&n, one) in boxes.iter().zip(tallies) {
        tally += one;
        first = first.or((one.wrong > 0).then_some(n));
    }
    let most = boxes.last().copied().unwrap_or(0);
    Exactly { name: way.name, values: boxes.len() as u64, most, tally, first }
}

/// Which n they are, in words.
pub(super) fn told(quick: bool) -> &'static str {
    if quick {
        "every n up to 100, and 1,000"
    } else {
        "every n up to 500, and 1,000, 2,000 and so on to 5,000"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_way_that_is_wrong_is_seen_to_be() {
        let wrong = |n: i64| Tally { pairs: 3, wrong: u64::from(n > 4), ..Tally::default() };
        let found = of(&Exact { name: "some way", tally: wrong }, &[2, 4, 7, 9]);
        assert_eq!((found.first, found.tally.wrong, found.tally.pairs), (Some(7), 2, 12));
        assert_eq!((found.values, found.most), (4, 9));
    }
}
