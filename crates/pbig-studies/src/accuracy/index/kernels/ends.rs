//! Kernels at the ends of all rows, for every n: what all pairs of every n would be too many for.
//!
//! A row is estimated from a number that falls with the index, so that an error shows where the row begins or ends before it
//! shows within; `super::super::ends` tells how far that held on the CPU. What is missed and doubled ends cannot tell.

use super::super::percent;
use super::{Root, run_kernel};
use crate::index::{AsItIs, Correction, Rules, lazy_pair};
use pbig_core::layout::Params;
use pbig_harness::cells;
use pbig_harness::kernels::Bench;
use pbig_harness::output::Failure;
use pbig_harness::pair_index::index_of;
use pbig_harness::table::{Cell, Table};
use rayon::prelude::*;
use std::ops::Range;

/// The most places of a call.
const MOST_PLACES: u32 = 1 << 20;

/// The counts of some estimates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Found {
    places: u64,
    wrong: u64,
    /// By how many rows the worst is off.
    worst_row: u64,
    /// Values of n with a wrong one, and the smallest of them.
    values: u64,
    first: Option<u32>,
    /// Rows that the CPU estimates otherwise, before any correction.
    otherwise: u64,
}

impl Found {
    fn note(&mut self, given: (i64, i64), right: (i64, i64)) {
        self.places += 1;
        self.wrong += u64::from(given != right);
        self.worst_row = self.worst_row.max(given.0.abs_diff(right.0));
    }

    /// Once all places of an n are noted.
    fn of(self, n: u32) -> Self {
        let is_wrong = self.wrong > 0;
        Self { values: is_wrong.into(), first: is_wrong.then_some(n), ..self }
    }

    fn and(self, other: Self) -> Self {
        Self {
            places: self.places + other.places,
            wrong: self.wrong + other.wrong,
            worst_row: self.worst_row.max(other.worst_row),
            values: self.values + other.values,
            first: self.first.into_iter().chain(other.first).min(),
            otherwise: self.otherwise + other.otherwise,
        }
    }

    fn cells(&self) -> Vec<Cell> {
        cells![self.wrong, percent(self.wrong, self.places), self.values, self.first, self.worst_row]
    }
}

/// One root, or the lazy way, for every n up to `most`.
struct Ends {
    name: String,
    as_it_is: Found,
    /// Of ways that estimate a row: those that the CPU has, too.
    by_rules: Option<Found>,
}

/// On the best adapter. A pair that is wrong after the correction by integers is a failed check.
fn looked_at(bench: &Bench, quick: bool) -> Result<Vec<Ends>, Failure> {
    let most = if quick { 250 } else { super::MOST_WHOLE };
    let roots = Root::all().map(|root| of_root(bench, &root, most));
    roots.chain([lazily(bench, most)]).collect()
}

fn of_root(bench: &Bench, root: &Root, most: u32) -> Result<Ends, Failure> {
    let kernel = (&crate::study::ROW_ENDS, root.number);
    let mut sums = [Found::default(); 2];
    for batch in batches(most, 2) {
        let params = params(&batch, 2);
        let words = run_kernel(bench, kernel, params, params.cells, 3)?;
        let of_n = batch.into_par_iter().zip(words.par_chunks_exact(3 * params.split as usize));
        let found = of_n.map(|(n, words)| judged(n, words, root)).collect::<Result<Vec<_>, _>>()?;
        sums = found.into_iter().fold(sums, |[a, b], [c, d]| [a.and(c), b.and(d)]);
    }
    let [as_it_is, rules] = sums;
    Ok(Ends { name: root.name.clone(), as_it_is, by_rules: root.row.map(|_| rules) })
}

fn lazily(bench: &Bench, most: u32) -> Result<Ends, Failure> {
    let mut places = 0;
    for batch in batches(most, COLUMNS) {
        let params = params(&batch, COLUMNS);
        let words = run_kernel(bench, (&crate::study::LAZY_ENDS, 0), params, params.cells, 2)?;
        let of_n = batch.into_par_iter().zip(words.par_chunks_exact(2 * params.split as usize));
        let counts = of_n.map(|(n, words)| counted(n, words)).collect::<Result<Vec<_>, _>>()?;
        places += counts.iter().sum::<u64>();
    }
    let as_it_is = Found { places, ..Found::default() };
    Ok(Ends { name: "lazy way".to_owned(), as_it_is, by_rules: None })
}

/// Values of n that are looked at in one call, with so many places for each row.
fn batches(most: u32, of_row: u32) -> Vec<Range<u32>> {
    let (mut batches, mut low) = (vec![], 2);
    while low <= most {
        let fits = |high: &u32| of_row * (high - 1) * (high - low + 1) <= MOST_PLACES;
        let high = (low..=most).take_while(fits).last().unwrap_or(low);
        batches.push(low..high + 1);
        low = high + 1;
    }
    batches
}

/// All of a batch have as many places as the largest, so that a thread finds its n by a division.
fn params(batch: &Range<u32>, of_row: u32) -> Params {
    let split = of_row * (batch.end - 2);
    Params { boxes: batch.start, split, cells: split * batch.len() as u32, ..Params::default() }
}

/// Estimates at both ends of each row, as they are and by the rules.
fn judged(n: u32, words: &[u32], root: &Root) -> Result<[Found; 2], Failure> {
    let [mut as_it_is, mut rules] = [Found::default(); 2];
    let ends = (0..n - 1).flat_map(|row| [(row, row + 1), (row, n - 1)]);
    for (right, words) in ends.zip(words.chunks_exact(3)) {
        if words[1..] != [right.0, right.1] {
            return Err(wrong(n, right, &words[1..]));
        }
        let (estimate, n) = (i64::from(words[0]), i64::from(n));
        let k = index_of(right.0.into(), right.1.into(), n as u64) as i64;
        let right = (right.0.into(), right.1.into());
        as_it_is.note(AsItIs::pair(estimate, k, n), right);
        rules.note(Rules::pair(estimate, k, n), right);
        as_it_is.otherwise += u64::from(root.row.is_some_and(|row| on_the_cpu(row, k, n) != estimate));
    }
    Ok([as_it_is.of(n), rules.of(n)])
}

fn wrong(n: u32, right: (u32, u32), given: &[u32]) -> Failure {
    Failure::Check(format!("{right:?} of {n} boxes: the kernel gives {given:?}"))
}

/// Kept among the rows that there are, as kernels keep it.
fn on_the_cpu(row: fn(i64, i64) -> i64, k: i64, n: i64) -> i64 {
    let m = 2 * n - 1;
    row(m, m * m - 8 * k).clamp(0, n - 2)
}

/// Identifiers of a row that are looked at: the first and the last, and those about the diagonal.
const COLUMNS: u32 = 5;

/// Returns the number of words, if each gives its pair, or none.
fn counted(n: u32, words: &[u32]) -> Result<u64, Failure> {
    let columns = |row: u32| [0, row.saturating_sub(1), row, row + 1, n - 1].map(|column| (row, column));
    for ((row, column), words) in (0..n - 1).flat_map(columns).zip(words.chunks_exact(2)) {
        let given = (words != [u32::MAX; 2]).then(|| (words[0].into(), words[1].into()));
        if given != lazy_pair((row * n + column).into(), n.into()) {
            return Err(wrong(n, (row, column), words));
        }
    }
    Ok(u64::from(COLUMNS * (n - 1)))
}

/// Estimates at both ends of each row, every n from 2 on, as they are and by the paper's rules.
pub(in super::super) fn table(bench: &Bench, quick: bool) -> Result<Table, Failure> {
    let columns = [
        "root",
        "looked_at",
        "wrong",
        "wrong_percent",
        "values_of_n_with_wrong_ones",
        "first_wrong_n",
        "worst_row",
        "wrong_by_the_rules",
        "wrong_by_the_rules_percent",
        "values_of_n_with_wrong_ones_by_the_rules",
        "first_wrong_n_by_the_rules",
        "worst_row_by_the_rules",
        "rows_other_than_on_the_CPU",
    ];
    let mut table = Table::new("kernels_at_ends", columns);
    for Ends { name, as_it_is, by_rules } in looked_at(bench, quick)? {
        let rules = by_rules.map_or(vec![Cell::Nothing; 5], |found| found.cells());
        let otherwise = cells![by_rules.map(|_| as_it_is.otherwise)];
        table.row([cells![name, as_it_is.places], as_it_is.cells(), rules, otherwise].concat());
    }
    Ok(table)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_n_is_in_one_batch_and_no_batch_is_too_large() {
        for (most, of_row) in [(2, 2), (250, 2), (5000, 2), (5000, COLUMNS)] {
            let batches = batches(most, of_row);
            assert!(batches.iter().cloned().flatten().eq(2..=most), "{most}, {of_row}");
            assert!(batches.iter().all(|batch| params(batch, of_row).cells <= MOST_PLACES));
        }
    }

    /// Of 4 boxes, by a root that the CPU has estimate row 1 everywhere.
    #[test]
    fn wrong_estimates_are_counted_and_a_wrong_pair_is_a_failure() {
        let root = Root { number: 0, name: String::new(), row: Some(|_, _| 1) };
        let mut words = [[1, 0, 1], [0, 0, 3], [1, 1, 2], [1, 1, 3], [0, 2, 3], [2, 2, 3]].concat();
        let [as_it_is, rules] = judged(4, &words, &root).expect("right pairs");
        assert_eq!(
            (as_it_is.wrong, as_it_is.worst_row, as_it_is.otherwise, as_it_is.first),
            (2, 2, 3, Some(4))
        );
        assert_eq!((rules.wrong, rules.worst_row, rules.first), (1, 1, Some(4)));
        words[4] = 1;
        assert!(judged(4, &words, &root).is_err());
    }
}
