//! The ends of rows as a sample of all pairs. The CPU tests both; kernels test the ends alone, for every n.

use crate::index::{Tally, Way};
use pbig_harness::table::Cell;

/// Of values of n whose pairs were all looked at, by one way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Shown {
    /// Those with a wrong pair.
    pub(super) wrong: u64,
    /// Of these, those with none at an end of a row.
    pub(super) inside: u64,
    /// By how many rows the worst end is off.
    pub(super) worst_row: u64,
}

impl Shown {
    pub(super) fn and(self, other: Self) -> Self {
        Self {
            wrong: self.wrong + other.wrong,
            inside: self.inside + other.inside,
            worst_row: self.worst_row.max(other.worst_row),
        }
    }

    pub(super) fn cells(self) -> [Cell; 3] {
        [self.wrong, self.inside, self.worst_row].map(Cell::from)
    }
}

/// Of one n. Where no pair is wrong, none is at an end.
pub(super) fn shown(way: &Way, n: i64, tallies: &[Tally; 3]) -> [Shown; 3] {
    if tallies.iter().all(|tally| tally.wrong == 0) {
        return Default::default();
    }
    let at_ends = (way.sample)(n, &[]);
    std::array::from_fn(|fix| {
        let (is_wrong, ends) = (tallies[fix].wrong > 0, at_ends[fix]);
        let is_inside = is_wrong && ends.wrong_ends == 0;
        Shown { wrong: is_wrong.into(), inside: is_inside.into(), worst_row: ends.worst_row }
    })
}
