//! The roots as kernels: the row that a device estimates at both ends of each row, for every n, and the exact pair. The table of
//! all pairs says how far the ends stand for all pairs, which would be too many.

use super::tally::{Tally, WAYS, Way};
use crate::accuracy::percent;
use crate::index::{AsItIs, Correction, Rules, discriminant, ends};
use pbig_core::GpuOptions;
use pbig_core::layout::{LANES, Params};
use pbig_harness::kernels::Bench;
use pbig_harness::prelude::*;
use pbig_shaders::Kernel;
use pbig_shaders::study::{INDEX_PAIRS, ROW_ENDS};
use std::ops::Range;

/// Most ends of rows that one call looks at.
const MOST_PLACES: u32 = 1 << 20;

/// Counts of one correction over ascending n.
#[derive(Default)]
struct Found {
    tally: Tally,
    values: u64,
    first: Option<u32>,
}

impl Found {
    fn add(&mut self, n: u32, tally: Tally) {
        self.tally += tally;
        self.values += u64::from(tally.wrong > 0);
        self.first = self.first.or((tally.wrong > 0).then_some(n));
    }

    fn cells(&self) -> Vec<Value> {
        let Tally { looked, wrong, worst_row, .. } = self.tally;
        cells![wrong, percent(wrong, looked), self.values, self.first, worst_row]
    }
}

/// Returns the table. A pair that is wrong by integers is a failed check. Software adapters are not timed.
pub(super) fn table(bench: &Bench, is_software: bool, quick: bool) -> Result<Table, Failure> {
    let columns = "root | looked_at | wrong | wrong_percent | values_of_n_with_wrong_ones | first_wrong_n | worst_row | \
        wrong_by_the_rules | wrong_by_the_rules_percent | values_of_n_with_wrong_ones_by_the_rules | \
        first_wrong_n_by_the_rules | worst_row_by_the_rules | rows_other_than_on_the_CPU | ns_per_pair";
    let mut table = Table::new("kernels_at_ends", columns);
    for (way, number) in WAYS.iter().filter_map(|way| Some((way, way.kernel?))) {
        let (mut otherwise, mut found) = (0, [Found::default(), Found::default()]);
        for batch in batches(if quick { 250 } else { 5000 }) {
            let params = params(&batch);
            let words = run(bench, &ROW_ENDS, number, params, params.cells)?;
            for (n, words) in batch.zip(words.chunks_exact(3 * params.split as usize)) {
                let (tallies, others) = judged(way, n.into(), words)?;
                found.iter_mut().zip(tallies).for_each(|(found, tally)| found.add(n, tally));
                otherwise += others;
            }
        }
        let ns = if is_software { None } else { Some(ns_per_pair(bench, number)?) };
        let head = cells![way.name, found[0].tally.looked];
        table.row([head, found[0].cells(), found[1].cells(), cells![otherwise, ns]].concat());
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

/// Gives each n as many places as the largest one, so that a thread finds its n by a division.
fn params(batch: &Range<u32>) -> Params {
    let split = 2 * (batch.end - 2);
    Params { boxes: batch.start, split, cells: split * batch.len() as u32, ..Params::default() }
}

/// Runs a kernel with a root, with room for so many cells of three words.
pub(crate) fn run(
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

/// Returns the time of a call for 2^17 pairs of 5000 boxes, less that of a call that computes nothing; each the best of three.
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

/// Counts wrong pairs of the estimates as they are and by the rules, and estimates that differ from the CPU's.
fn judged(way: &Way, n: i64, words: &[u32]) -> Result<([Tally; 2], u64), Failure> {
    let (mut tallies, mut otherwise) = ([Tally::default(); 2], 0);
    let places = (0..n - 1).flat_map(|row| ends(row, n).map(|k| (row, k)));
    for ((row, k), words) in places.zip(words.chunks_exact(3)) {
        let [estimate, a, b] = [words[0], words[1], words[2]].map(i64::from);
        let right = AsItIs::pair(row, k, n);
        if (a, b) != right {
            return Err(Failure::Check(format!("{right:?} of {n} boxes: the kernel gives ({a}, {b})")));
        }
        let given = [AsItIs::pair(estimate, k, n), Rules::pair(estimate, k, n)];
        for (tally, given) in tallies.iter_mut().zip(given) {
            tally.looked += 1;
            tally.note(given, right);
        }
        // Kernels keep the estimate among the rows that exist.
        otherwise += u64::from((way.row)(2 * n - 1, discriminant(k, n)).clamp(0, n - 2) != estimate);
    }
    Ok((tallies, otherwise))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four boxes, with a root that estimates row 1 everywhere on the CPU.
    #[test]
    fn wrong_estimates_are_counted_and_a_wrong_pair_is_a_failure() {
        let mut words = [[1, 0, 1], [0, 0, 3], [1, 1, 2], [1, 1, 3], [0, 2, 3], [2, 2, 3]].concat();
        let way = Way { row: |_, _| 1, ..WAYS[0] };
        let ([as_it_is, rules], otherwise) = judged(&way, 4, &words).expect("right pairs");
        assert_eq!((as_it_is.wrong, as_it_is.worst_row, rules.wrong, rules.worst_row), (2, 2, 1, 1));
        assert_eq!(otherwise, 3);
        words[4] = 1;
        assert!(judged(&way, 4, &words).is_err());
        for most in [2, 250, 5000] {
            assert!(batches(most).into_iter().flatten().eq(2..=most));
            assert!(batches(most).iter().all(|batch| params(batch).cells <= MOST_PLACES));
        }
    }
}
