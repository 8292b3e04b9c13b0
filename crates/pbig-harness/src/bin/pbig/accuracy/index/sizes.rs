//! From 2 to 2^20 boxes: all pairs, or the ends of rows and a sample.

use super::super::study::{Cell, Table};
use super::percent;
use super::times::label;
use pbig_harness::index::{MOST_EXHAUSTIVE, Sample, Tally, WAYS};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use rayon::prelude::*;

/// As it is, by the rules, by integers.
enum Looked {
    AtAll([Tally; 3]),
    AtSome([Sample; 3]),
}

/// One way at one number of boxes.
pub(super) struct Size {
    pub(super) n: i64,
    /// In [`WAYS`].
    pub(super) way: usize,
    looked: Looked,
}

impl Size {
    fn of(n: i64, way: usize, count: usize) -> Self {
        let looked = if n <= MOST_EXHAUSTIVE {
            Looked::AtAll((WAYS[way].tally)(n))
        } else {
            Looked::AtSome((WAYS[way].sample)(n, &indices(n, count)))
        };
        Self { n, way, looked }
    }

    /// With a wrong row after every correction.
    #[cfg(test)]
    pub(super) fn planted(n: i64) -> Self {
        let wrong = Sample { wrong_ends: 1, ..Sample::default() };
        Self { n, way: 0, looked: Looked::AtSome([wrong; 3]) }
    }

    /// Returns true if no tested pair is wrong after a correction.
    pub(super) fn is_right(&self, correction: usize) -> bool {
        match &self.looked {
            Looked::AtAll(tallies) => tallies[correction].wrong == 0,
            Looked::AtSome(samples) => samples[correction].wrong_ends + samples[correction].wrong_inner == 0,
        }
    }
}

pub(super) fn looked_at(quick: bool) -> Vec<Size> {
    // 46,341 is where 32-bit signed products of n with itself end, 92,683 where unsigned ones of pairs do.
    let sizes: &[i64] = if quick {
        &[2, 1000, 1 << 20]
    } else {
        &[
            2,
            16,
            128,
            1024,
            4096,
            8192,
            MOST_EXHAUSTIVE,
            1 << 15,
            46_342,
            1 << 16,
            92_683,
            1 << 17,
            1 << 18,
            1 << 19,
            1 << 20,
        ]
    };
    let count = if quick { 10_000 } else { 1_000_000 };
    let all: Vec<_> = sizes.iter().flat_map(|&n| (0..WAYS.len()).map(move |way| (n, way))).collect();
    all.par_iter().map(|&(n, way)| Size::of(n, way, count)).collect()
}

/// Evenly at random, the same in every run and for every way.
fn indices(n: i64, count: usize) -> Vec<i64> {
    let mut rng = StdRng::seed_from_u64(n as u64);
    (0..count).map(|_| rng.random_range(0..n * (n - 1) / 2)).collect()
}

pub(super) fn table(sizes: &[Size]) -> Table {
    let title = "From 2 to 2^20 boxes, as it is and by the paper's rules";
    let columns = [
        "boxes",
        "root",
        "looked_at",
        "wrong_percent",
        "wrong_ends_of_rows_percent",
        "worst_row",
        "missed",
        "doubled",
        "no_pair",
        "wrong_by_the_rules_percent",
        "wrong_ends_by_the_rules_percent",
        "worst_row_by_the_rules",
        "missed_by_the_rules",
    ];
    let mut table = Table::new("sizes", title, &columns);
    for Size { n, way, looked } in sizes {
        let head = [Cell::from(*n as u64), label(&WAYS[*way]).into()];
        let rest = match looked {
            Looked::AtAll(tallies) => row_of_all(tallies),
            Looked::AtSome(samples) => row_of_sample(samples),
        };
        table.row(head.into_iter().chain(rest));
    }
    table
}

fn row_of_all([as_it_is, rules, _]: &[Tally; 3]) -> [Cell; 11] {
    let share = |tally: &Tally| Cell::from(percent(tally.wrong, tally.pairs));
    [
        "all".into(),
        share(as_it_is),
        Cell::Nothing,
        as_it_is.worst_row.into(),
        as_it_is.missed.into(),
        as_it_is.doubled.into(),
        as_it_is.none.into(),
        share(rules),
        Cell::Nothing,
        rules.worst_row.into(),
        rules.missed.into(),
    ]
}

fn row_of_sample([as_it_is, rules, _]: &[Sample; 3]) -> [Cell; 11] {
    let share = |sample: &Sample| Cell::from(percent(sample.wrong_inner, sample.inner));
    let ends = |sample: &Sample| Cell::from(percent(sample.wrong_ends, sample.ends));
    [
        format!("ends of rows, {} others", as_it_is.inner).into(),
        share(as_it_is),
        ends(as_it_is),
        as_it_is.worst_row.into(),
        Cell::Nothing,
        Cell::Nothing,
        Cell::Nothing,
        share(rules),
        ends(rules),
        rules.worst_row.into(),
        Cell::Nothing,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_way_is_looked_at_in_every_size() {
        let sizes = looked_at(true);
        assert_eq!(sizes.len(), 3 * WAYS.len());
        assert!(sizes.iter().all(|size| size.is_right(2)), "by integers");
        let right: Vec<i64> =
            sizes.iter().filter(|size| size.way == 0 && size.is_right(0)).map(|s| s.n).collect();
        assert_eq!(right, [2, 1000], "an f32 root is wrong from 4098 on");
    }
}
