//! The same roots as kernels: the row that a device estimates at both ends of each row, for every n, and the exact pair. All pairs
//! of every n would be too many. An error shows where a row begins or ends before it shows within, as the estimated number falls
//! with the index: the table of all pairs has how far that holds.

use super::super::percent;
use super::times::label;
use crate::index::{AsItIs, Correction, Rules, WAYS, Way};
use crate::study::{INDEX_PAIRS, ROW_ENDS};
use pbig_core::GpuOptions;
use pbig_core::layout::{LANES, Params};
use pbig_harness::bench::timed;
use pbig_harness::cells;
use pbig_harness::kernels::Bench;
use pbig_harness::output::Failure;
use pbig_harness::pair_index::index_of;
use pbig_harness::table::{Cell, Table};
use pbig_shaders::Kernel;
use std::ops::Range;

/// The most places of a call, two for each row.
const MOST_PLACES: u32 = 1 << 20;

/// A root by the kernel's number (`GpuOptions::root`), with our name for it; of ways that estimate a row, the same on the CPU.
type Root = (u32, String, Option<fn(i64, i64) -> i64>);

fn roots() -> impl Iterator<Item = Root> {
    let number = |way: &Way| match (way.name, way.steps) {
        ("f32 sqrt", _) => Some(0),
        ("Carmack", steps) => steps,
        ("Lomont", steps) => steps.map(|steps| steps + 4),
        _ => None,
    };
    let of_way = move |way: &Way| Some((number(way)?, label(way), Some(way.row)));
    WAYS.iter().filter_map(of_way).chain([(9, "bisection over rows".to_owned(), None)])
}

/// What was found at the ends of rows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Found {
    wrong: u64,
    /// The number of rows by which the worst place is off.
    worst_row: u64,
    /// Values of n with a wrong place, and the smallest of them.
    values: u64,
    first: Option<u32>,
}

impl Found {
    /// Adds the wrong places of one n, which ascends.
    fn add(&mut self, n: u32, (wrong, worst_row): (u64, u64)) {
        self.wrong += wrong;
        self.worst_row = self.worst_row.max(worst_row);
        self.values += u64::from(wrong > 0);
        self.first = self.first.or((wrong > 0).then_some(n));
    }

    fn cells(&self, places: u64) -> Vec<Cell> {
        cells![self.wrong, percent(self.wrong, places), self.values, self.first, self.worst_row]
    }
}

const COLUMNS: [&str; 14] = [
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
    "ns_per_pair",
];

/// Returns the table. A pair that is wrong by integers is a failed check. Times are of a call for 2^17 pairs of 5000 boxes, less that
/// of a call which computes nothing, where the adapter is no software.
pub(super) fn table(bench: &Bench, software: bool, quick: bool) -> Result<Table, Failure> {
    let (most, mut table) = (if quick { 250 } else { 5000 }, Table::new("kernels_at_ends", COLUMNS));
    for (number, name, row) in roots() {
        let (mut places, mut otherwise, mut found) = (0, 0, [Found::default(); 2]);
        for batch in batches(most) {
            let params = params(&batch);
            let words = run(bench, &ROW_ENDS, number, params, params.cells)?;
            for (n, words) in batch.zip(words.chunks_exact(3 * params.split as usize)) {
                let (wrong, others) = judged(n, words, row)?;
                found.iter_mut().zip(wrong).for_each(|(found, wrong)| found.add(n, wrong));
                (places, otherwise) = (places + 2 * u64::from(n - 1), otherwise + others);
            }
        }
        let rules = row.map_or(vec![Cell::Nothing; 5], |_| found[1].cells(places));
        let rest =
            cells![row.map(|_| otherwise), if software { None } else { Some(ns_per_pair(bench, number)?) }];
        table.row([cells![name, places], found[0].cells(places), rules, rest].concat());
    }
    Ok(table)
}

/// Returns the values of n that are looked at in one call.
fn batches(most: u32) -> Vec<Range<u32>> {
    let (mut batches, mut low) = (vec![], 2);
    while low <= most {
        let fits = |high: &u32| 2 * (high - 1) * (high - low + 1) <= MOST_PLACES;
        let high = (low..=most).take_while(fits).last().unwrap_or(low);
        batches.push(low..high + 1);
        low = high + 1;
    }
    batches
}

/// All of a batch have as many places as the largest, so that a thread finds its n by a division.
fn params(batch: &Range<u32>) -> Params {
    let split = 2 * (batch.end - 2);
    Params { boxes: batch.start, split, cells: split * batch.len() as u32, ..Params::default() }
}

/// Runs a kernel with a root, with room for so many cells of three words.
fn run(
    bench: &Bench,
    kernel: &'static Kernel,
    root: u32,
    params: Params,
    room: u32,
) -> Result<Vec<u32>, Failure> {
    let options = GpuOptions { root, ..GpuOptions::DEFAULT };
    let bindings = [bytemuck::bytes_of(&params).to_vec(), vec![0; 12 * room as usize]];
    let found = bench.run(kernel, &options, false, &bindings, room.div_ceil(LANES));
    let found = found.map_err(|error| Failure::Input(format!("{}: {error}", kernel.name)))?;
    Ok(bytemuck::pod_collect_to_vec(&found[1]))
}

fn ns_per_pair(bench: &Bench, root: u32) -> Result<f64, Failure> {
    let (count, mut best) = (1 << 17, [f64::MAX; 2]);
    for (k, cells) in [0, count, 0, count, 0, count].into_iter().enumerate() {
        let params = Params { boxes: 5000, cells, ..Params::default() };
        let (done, ms) = timed(|| run(bench, &INDEX_PAIRS, root, params, count));
        done?;
        best[k % 2] = best[k % 2].min(ms);
    }
    Ok((best[1] - best[0]) * 1e6 / f64::from(count))
}

/// The wrong places of one n and by how many rows the worst is off, as it is and by the rules; and estimates other than the CPU's.
type Judged = ([(u64, u64); 2], u64);

fn judged(n: u32, words: &[u32], row: Option<fn(i64, i64) -> i64>) -> Result<Judged, Failure> {
    let (mut found, mut otherwise) = ([(0, 0); 2], 0);
    let ends = (0..n - 1).flat_map(|row| [(row, row + 1), (row, n - 1)]);
    for (right, words) in ends.zip(words.chunks_exact(3)) {
        if words[1..] != [right.0, right.1] {
            let given = &words[1..];
            return Err(Failure::Check(format!("{right:?} of {n} boxes: the kernel gives {given:?}")));
        }
        let (estimate, n) = (i64::from(words[0]), i64::from(n));
        let k = index_of(right.0.into(), right.1.into(), n as u64) as i64;
        let right = (right.0.into(), right.1.into());
        for ((wrong, worst), given) in
            found.iter_mut().zip([AsItIs::pair(estimate, k, n), Rules::pair(estimate, k, n)])
        {
            *wrong += u64::from(given != right);
            *worst = given.0.abs_diff(right.0).max(*worst);
        }
        let m = 2 * n - 1;
        // Kept among the rows that there are, as kernels keep it.
        let is_other = |row: fn(i64, i64) -> i64| row(m, m * m - 8 * k).clamp(0, n - 2) != estimate;
        otherwise += u64::from(row.is_some_and(is_other));
    }
    Ok((found, otherwise))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of 4 boxes, by a root that the CPU has estimate row 1 everywhere.
    #[test]
    fn wrong_estimates_are_counted_and_a_wrong_pair_is_a_failure() {
        let mut words = [[1, 0, 1], [0, 0, 3], [1, 1, 2], [1, 1, 3], [0, 2, 3], [2, 2, 3]].concat();
        let row: fn(i64, i64) -> i64 = |_, _| 1;
        assert_eq!(judged(4, &words, Some(row)).expect("right pairs"), ([(2, 2), (1, 1)], 3));
        words[4] = 1;
        assert!(judged(4, &words, None).is_err());
        for most in [2, 250, 5000] {
            assert!(batches(most).iter().cloned().flatten().eq(2..=most));
            assert!(batches(most).iter().all(|batch| params(batch).cells <= MOST_PLACES));
        }
    }
}
