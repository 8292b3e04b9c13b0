//! From 2 to 2^20 boxes: all pairs, or the ends of rows and a sample.

use super::percent;
use super::times::label;
use crate::index::{MOST_EXHAUSTIVE, Sample, Tally, WAYS};
use pbig_harness::cells;
use pbig_harness::table::{Cell, Table};
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
    let mut table = Table::new("sizes", columns);
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

fn row_of_all([as_it_is, rules, _]: &[Tally; 3]) -> Vec<Cell> {
    let share = |tally: &Tally| percent(tally.wrong, tally.pairs);
    let counts = cells![as_it_is.worst_row, as_it_is.missed, as_it_is.doubled, as_it_is.none];
    let by_rules = cells![share(rules), None::<f64>, rules.worst_row, rules.missed];
    [cells!["all", share(as_it_is), None::<f64>], counts, by_rules].concat()
}

fn row_of_sample([as_it_is, rules, _]: &[Sample; 3]) -> Vec<Cell> {
    let shares = |of: &Sample| {
        cells![percent(of.wrong_inner, of.inner), percent(of.wrong_ends, of.ends), of.worst_row]
    };
    let head = cells![format!("ends of rows, {} others", as_it_is.inner)];
    let nothing = |count| vec![Cell::Nothing; count];
    [head, shares(as_it_is), nothing(3), shares(rules), nothing(1)].concat()
}
