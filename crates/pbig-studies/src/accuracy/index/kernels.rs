//! The same roots as kernels: the row that a device estimates, and the exact pair; and the lazy way.

pub(super) mod ends;
mod lazy;

use super::percent;
use super::times::label;
use crate::index::{AsItIs, Correction, Rules, Tally, WAYS, Way, tally_of};
use pbig_core::GpuOptions;
use pbig_core::layout::{LANES, Params};
use pbig_harness::bench::timed;
use pbig_harness::cells;
use pbig_harness::kernels::Bench;
use pbig_harness::output::Failure;
use pbig_harness::pair_index::{pair_count, pair_of};
use pbig_harness::table::{Cell, Table};
use pbig_shaders::Kernel;

/// Up to so many boxes all indices are looked at.
const MOST_WHOLE: u32 = 5000;
/// Parts of all indices that are looked at beyond, evenly spread, and the most indices of a call.
const PARTS: u64 = 8;
const MOST: u32 = 1 << 17;

/// A root by the kernel's number (`GpuOptions::root`), with our name for it.
struct Root {
    number: u32,
    name: String,
    /// The same on the CPU, of ways that estimate a row ([`Way::row`]).
    row: Option<fn(i64, i64) -> i64>,
}

const BISECTION: u32 = 9;

impl Root {
    fn all() -> impl Iterator<Item = Self> {
        let of_way = |way: &Way| Some(Self { number: number(way)?, name: label(way), row: Some(way.row) });
        let bisection = Self { number: BISECTION, name: "bisection over rows".to_owned(), row: None };
        WAYS.iter().filter_map(of_way).chain([bisection])
    }

    /// The most boxes for which the kernel's 32-bit integers suffice: with a root for `(2n - 1)^2`, by bisection for
    /// `n (n - 1)`.
    fn most_boxes(&self) -> u32 {
        if self.number == BISECTION { 1 << 16 } else { 1 << 15 }
    }
}

fn number(way: &Way) -> Option<u32> {
    match (way.name, way.steps) {
        ("f32 sqrt", _) => Some(0),
        ("Carmack", steps) => steps,
        ("Lomont", steps) => steps.map(|steps| steps + 4),
        _ => None,
    }
}

/// The rows that a root estimates for some boxes.
pub(super) struct Estimates {
    n: u32,
    name: String,
    /// As it is. Unless all indices were looked at, without what is missed, doubled and no pair.
    tally: Tally,
    /// The same by the rules, of ways that estimate a row.
    by_rules: Option<Tally>,
    /// Milliseconds for all these indices.
    ms: Option<f64>,
}

/// Estimates and exact pairs on the best adapter; times where it is no software.
fn estimates(bench: &Bench, software: bool, quick: bool) -> Result<Vec<Estimates>, Failure> {
    let sizes: &[u32] =
        if quick { &[2, 300] } else { &[2, 300, 1000, 2000, MOST_WHOLE, 16_384, 1 << 15, 1 << 16] };
    let all = sizes.iter().flat_map(|&n| Root::all().map(move |root| (n, root)));
    let within = all.filter(|(n, root)| *n <= root.most_boxes());
    let rows = within.map(|(n, root)| Estimates::of(bench, n, root, software));
    let lazy = sizes.iter().filter(|n| **n <= lazy::MOST_BOXES).map(|&n| lazy::estimates(bench, n, software));
    rows.chain(lazy).collect()
}

impl Estimates {
    fn of(bench: &Bench, n: u32, Root { number, name, .. }: Root, software: bool) -> Result<Self, Failure> {
        let (mut rows, mut ms) = (Vec::new(), 0.0);
        for indices in parts(n, pair_count(n.into())) {
            let (words, took) =
                timed_run(software, |cells| run(bench, number, &indices, cells), indices.count)?;
            rows.extend(estimated(&indices, &words)?);
            ms += took;
        }
        let (tally, by_rules) = (judged::<AsItIs>(n, &rows), Some(judged::<Rules>(n, &rows)));
        Ok(Self { n, name, tally, by_rules, ms: (!software && ms > 0.0).then_some(ms) })
    }

    fn row(&self) -> Vec<Cell> {
        let indices = self.tally.pairs;
        let ns = self.ms.map(|ms| ms * 1e6 / indices as f64);
        let counts = [Some(self.tally), self.by_rules].map(|tally| self.counts(tally)).concat();
        [cells![self.n, &self.name, indices], counts, cells![ns]].concat()
    }

    fn counts(&self, tally: Option<Tally>) -> Vec<Cell> {
        let Some(tally) = tally else { return vec![Cell::Nothing; 5] };
        let [missed, doubled, none] =
            [tally.missed, tally.doubled, tally.none].map(|count| self.is_whole().then_some(count));
        cells![percent(tally.wrong, tally.pairs), tally.worst_row, missed, doubled, none]
    }

    fn is_whole(&self) -> bool {
        self.n <= MOST_WHOLE
    }
}
/// Estimated rows, as they are and by the paper's rules. A pair that is wrong by integers is a failed check.
pub(super) fn table(bench: &Bench, software: bool, quick: bool) -> Result<Table, Failure> {
    let columns = [
        "boxes",
        "root",
        "indices",
        "wrong_percent",
        "worst_row",
        "missed",
        "doubled",
        "no_pair",
        "wrong_by_the_rules_percent",
        "worst_row_by_the_rules",
        "missed_by_the_rules",
        "doubled_by_the_rules",
        "no_pair_by_the_rules",
        "ns_per_pair",
    ];
    let mut table = Table::new("kernels", columns);
    estimates(bench, software, quick)?.iter().for_each(|one| table.row(one.row()));
    Ok(table)
}

/// Consecutive indices.
struct Indices {
    n: u32,
    first: u32,
    count: u32,
}

impl Indices {
    fn between(n: u32, first: u64, end: u64) -> Self {
        Self { n, first: first as u32, count: ((end - first) as u32).min(MOST) }
    }

    /// For so many of them.
    fn params(&self, cells: u32) -> Params {
        Params { boxes: self.n, split: self.first, cells, ..Params::default() }
    }
}

/// All of so many, or some of each part of all.
fn parts(n: u32, all: u64) -> Vec<Indices> {
    if n <= MOST_WHOLE {
        (0..all).step_by(MOST as usize).map(|first| Indices::between(n, first, all)).collect()
    } else {
        let start = |part: u64| all * part / PARTS;
        (0..PARTS).map(|part| Indices::between(n, start(part), start(part + 1))).collect()
    }
}

/// Returns the output of a kernel and the shortest time of several runs, less the time of runs that compute nothing.
fn timed_run(
    software: bool,
    run: impl Fn(u32) -> Result<Vec<u32>, Failure>,
    count: u32,
) -> Result<(Vec<u32>, f64), Failure> {
    let mut best = [f64::MAX; 2];
    let mut out = Vec::new();
    for _ in 0..if software { 1 } else { 3 } {
        let (none, idle) = timed(|| run(0));
        let (words, busy) = timed(|| run(count));
        (_, out) = (none?, words?);
        best = [best[0].min(idle), best[1].min(busy)];
    }
    Ok((out, best[1] - best[0]))
}

/// With room for all indices, of which `cells` are computed.
fn run(bench: &Bench, root: u32, indices: &Indices, cells: u32) -> Result<Vec<u32>, Failure> {
    run_kernel(bench, (&crate::study::INDEX_PAIRS, root), indices.params(cells), indices.count, 3)
}

/// A kernel with a root, and room for so many cells of so many words each.
fn run_kernel(
    bench: &Bench,
    (kernel, root): (&'static Kernel, u32),
    params: Params,
    room: u32,
    words: usize,
) -> Result<Vec<u32>, Failure> {
    let options = GpuOptions { root, ..GpuOptions::DEFAULT };
    let bindings = [bytemuck::bytes_of(&params).to_vec(), vec![0; 4 * words * room as usize]];
    let found = bench.run(kernel, &options, false, &bindings, room.div_ceil(LANES));
    let found = found.map_err(|error| Failure::Input(format!("{}: {error}", kernel.name)))?;
    Ok(bytemuck::pod_collect_to_vec(&found[1]))
}

/// Each index with its estimated row. A pair that is wrong after the correction by integers is a failed check.
fn estimated(&Indices { n, first, .. }: &Indices, words: &[u32]) -> Result<Vec<(u32, u32)>, Failure> {
    let row = |(k, words): (u32, &[u32])| {
        let right = pair_of(k.into(), n.into());
        if right != (words[1].into(), words[2].into()) {
            let given = &words[1..];
            return Err(Failure::Check(format!("index {k} of {n} boxes: the kernel gives {given:?}")));
        }
        Ok((k, words[0]))
    };
    (first..).zip(words.chunks_exact(3)).map(row).collect()
}

/// The pairs that a correction makes of estimated rows.
fn judged<C: Correction>(n: u32, rows: &[(u32, u32)]) -> Tally {
    let given = rows.iter().map(|&(k, row)| (k, C::pair(row.into(), k.into(), n.into())));
    if n <= MOST_WHOLE { tally_of(n.into(), given.map(|(_, pair)| pair)) } else { sampled(n, given) }
}

fn sampled(n: u32, given: impl Iterator<Item = (u32, (i64, i64))>) -> Tally {
    let mut tally = Tally::default();
    for (k, pair) in given {
        let (a, b) = pair_of(k.into(), n.into());
        let right = (a as i64, b as i64);
        tally.pairs += 1;
        tally.wrong += u64::from(pair != right);
        tally.worst_row = tally.worst_row.max(pair.0.abs_diff(right.0));
    }
    tally
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_pair_is_a_failure_and_what_is_missed_and_doubled_is_counted() {
        let indices = |count| Indices { n: 4, first: 0, count };
        assert_eq!(estimated(&indices(2), &[0, 0, 1, 7, 0, 2]).expect("right pairs"), [(0, 0), (1, 7)]);
        assert!(estimated(&indices(1), &[0, 0, 2]).is_err());
        // As it is, index 1 gives (1, 0), which index 0 tests, 2 gives (1, 1), 3 gives (3, 1), which 4 tests, 5 gives (0, 6).
        let rows = [(0, 0), (1, 1), (2, 1), (3, 3), (4, 1), (5, 0)];
        let counts = |tally: Tally| [tally.wrong, tally.worst_row, tally.missed, tally.doubled, tally.none];
        assert_eq!(counts(judged::<AsItIs>(4, &rows)), [4, 2, 4, 2, 2]);
        assert_eq!(counts(judged::<Rules>(4, &rows)), [2, 1, 1, 0, 1]);
    }

    #[test]
    fn as_many_boxes_as_32_bits_suffice_for() {
        for root in Root::all() {
            let largest = |n: u64| if root.number == BISECTION { n * (n - 1) } else { (2 * n - 1).pow(2) };
            let most = u64::from(root.most_boxes());
            assert!(largest(most) < 1 << 32 && largest(most + 1) >= 1 << 32, "{}", root.name);
        }
    }
}
