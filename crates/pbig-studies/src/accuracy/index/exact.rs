//! Ways without an estimate: whether they are as right as they should be.

use crate::index::{EXACT, Exact, Tally};
use rayon::prelude::*;

/// The counts of all pairs, for some n.
pub(super) struct Exactly {
    pub(super) name: &'static str,
    pub(super) values: u64,
    pub(super) most: i64,
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
    Exactly { name: way.name, values: boxes.len() as u64, most, tally, first }
}
