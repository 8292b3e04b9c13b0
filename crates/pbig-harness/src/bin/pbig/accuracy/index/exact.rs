//! Ways without an estimate: whether they are as right as they should be.

use pbig_harness::index::{EXACT, Exact, Tally};
use rayon::prelude::*;

/// The counts of all pairs, for some n.
pub(super) struct Exactly {
    pub(super) name: &'static str,
    pub(super) values: u64,
    pub(super) most: i64,
    /// Up to this, the ends of the rows of every n.
    ends_up_to: i64,
    pub(super) tally: Tally,
    /// The smallest n with a wrong pair.
    pub(super) first: Option<i64>,
}

/// Up to this the ends of rows of every n; beyond, of powers of two up to 2^20.
const MOST_ENDS: i64 = 5000;

/// Of which all pairs are looked at; fewer than of the others: these take up to ten times as long for a pair.
fn boxes(quick: bool) -> Vec<i64> {
    if quick {
        (2..=100).chain([1000]).collect()
    } else {
        (2..=500).chain((1000..=5000).step_by(1000)).collect()
    }
}

pub(super) fn tallied(quick: bool) -> Vec<Exactly> {
    let ends_up_to = if quick { 250 } else { MOST_ENDS };
    EXACT.iter().map(|way| of(way, &boxes(quick), ends_up_to)).collect()
}

fn of(way: &Exact, boxes: &[i64], ends_up_to: i64) -> Exactly {
    let tallies: Vec<Tally> = boxes.par_iter().map(|&n| (way.tally)(n)).collect();
    let (mut tally, mut first) = (Tally::default(), None);
    for (&n, one) in boxes.iter().zip(tallies) {
        tally += one;
        first = first.or((one.wrong > 0).then_some(n));
    }
    let most = boxes.last().copied().unwrap_or(0);
    let powers = (13..=20).map(|power| 1i64 << power).filter(|_| ends_up_to == MOST_ENDS);
    let all: Vec<i64> = (2..=ends_up_to).chain(powers).collect();
    let by_ends = all.into_par_iter().filter(|&n| (way.wrong_ends)(n) > 0).min();
    let first = first.into_iter().chain(by_ends).min();
    Exactly { name: way.name, values: boxes.len() as u64, most, ends_up_to, tally, first }
}

/// Says which pairs were tested.
pub(super) fn told(exact: &[Exactly]) -> String {
    let names: Vec<&str> = exact.iter().map(|one| one.name).collect();
    let (values, most, ends_up_to) =
        exact.first().map_or((0, 0, 0), |one| (one.values, one.most, one.ends_up_to));
    format!(
        "Ways without an estimate ({}): all pairs of {values} values of n up to {most}, and the ends of the rows of every n \
         up to {ends_up_to}{}. These say what becomes of all pairs: the row that such a way gives never falls where the \
         index grows, so that it is right within a row where it is at both ends; the lazy way's is a division, and its \
         column what is left over. A run in which one is wrong fails.",
        names.join(", "),
        if ends_up_to == MOST_ENDS { " and of the powers of two from there to 2^20" } else { "" }
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_way_that_is_wrong_is_seen_to_be() {
        let tally = |n: i64| Tally { pairs: 3, wrong: u64::from(n > 4), ..Tally::default() };
        let way = |wrong_ends| Exact { name: "some way", tally, wrong_ends };
        let found = of(&way(|_| 0), &[2, 4, 7, 9], 9);
        assert_eq!((found.first, found.tally.wrong, found.tally.pairs), (Some(7), 2, 12));
        assert_eq!((found.values, found.most), (4, 9));
        let at_ends = of(&way(|n| u64::from(n == 5 || n == 6)), &[2, 4, 7, 9], 9);
        assert_eq!(at_ends.first, Some(5));
    }
}
