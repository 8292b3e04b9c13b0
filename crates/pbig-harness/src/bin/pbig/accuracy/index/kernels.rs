//! The same roots as kernels: the row that a device estimates, and the exact pair; and the lazy way.

pub(super) mod ends;
mod lazy;

use super::super::study::{Cell, Table, plain};
use super::percent;
use super::times::label;
use crate::bench::measure::timed;
use crate::output::Failure;
use pbig_core::GpuOptions;
use pbig_core::layout::{LANES, Params};
use pbig_harness::index::{AsItIs, Correction, Rules, Tally, WAYS, Way, tally_of};
use pbig_harness::kernels::Bench;
use pbig_harness::pair_index::{pair_count, pair_of};
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
pub(super) fn estimates(bench: &Bench, software: bool, quick: bool) -> Result<Vec<Estimates>, Failure> {
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

    fn is_whole(&self) -> bool {
        self.n <= MOST_WHOLE
    }

    fn row(&self) -> impl Iterator<Item = Cell> {
        let indices = self.tally.pairs;
        let head = [u64::from(self.n).into(), self.name.as_str().into(), indices.into()];
        let ns = Cell::from(self.ms.map(|ms| ms * 1e6 / indices as f64));
        let counts = [Some(self.tally), self.by_rules].map(|tally| self.counts(tally));
        head.into_iter().chain(counts.into_iter().flatten()).chain([ns])
    }

    fn counts(&self, tally: Option<Tally>) -> [Cell; 5] {
        let Some(tally) = tally else { return [(); 5].map(|()| Cell::Nothing) };
        let if_whole = |count: u64| Cell::from(self.is_whole().then_some(count));
        let [missed, doubled, none] = [tally.missed, tally.doubled, tally.none].map(if_whole);
        [percent(tally.wrong, tally.pairs).into(), tally.worst_row.into(), missed, doubled, none]
    }
}

pub(super) fn table(estimates: &[Estimates]) -> Table {
    let title = "As kernels: estimated rows, as they are and by the paper's rules";
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
    let mut table = Table::new("kernels", title, &columns);
    estimates.iter().for_each(|one| table.row(one.row()));
    table
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
    run_kernel(bench, (&pbig_harness::study::INDEX_PAIRS, root), indices.params(cells), indices.count, 3)
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

/// Says which ways were tested as kernels, and which were not.
pub(super) fn notes(estimates: &[Estimates]) -> Vec<String> {
    let most = |number: u32| Root::all().find(|root| root.number == number).map_or(0, |r| r.most_boxes());
    let largest = estimates.iter().map(|one| one.n).filter(|n| *n <= MOST_WHOLE).max().unwrap_or(0);
    vec![
        format!(
            "Kernels, for some n: all indices up to {largest} boxes, beyond them {MOST} of each of {PARTS} parts of all. They \
             keep estimated rows from 0 to n - 2. The pair that integers make of the row is right for each index: a \
             run in which one is not fails."
        ),
        format!(
            "WGSL has 32-bit integers only: kernels end at {} boxes with a root, beyond which (2n - 1)^2 is 2^32 or \
             more, and at {} by bisection, beyond which n (n - 1) is. That is enough for pbig, which finds pairs by \
             index in small cells and among few boxes.",
            most(0),
            most(BISECTION)
        ),
        "No kernels: f64 sqrt and the integer root, as WGSL has neither f64 nor 64-bit integers nor a root of \
         integers; and equation 1 all in f32, as the exact integer under the root is as cheap there. The paper's rules \
         are applied on the CPU to the rows that kernels estimate: they are integers in either place."
            .to_owned(),
        lazy::note(),
        missed_note(estimates, largest),
    ]
}

/// Roots that lose pairs of the most boxes of which all indices were looked at.
fn missed_note(estimates: &[Estimates], n: u32) -> String {
    let missed = |tally: fn(&Estimates) -> Option<Tally>| {
        let of_n = estimates.iter().filter(|one| one.n == n);
        let told = of_n.filter_map(|one| {
            let Tally { missed, pairs, .. } = tally(one).filter(|tally| tally.missed > 0)?;
            Some(format!("{} {missed} ({}%)", one.name, plain(percent(missed, pairs))))
        });
        let told: Vec<_> = told.collect();
        if told.is_empty() { "none with any root".to_owned() } else { told.join(", ") }
    };
    format!(
        "Pairs of {n} boxes that kernels miss, as it is: {}; by the paper's rules: {}.",
        missed(|one| Some(one.tally)),
        missed(|one| one.by_rules)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn indices(n: u32, first: u32, count: u32) -> Indices {
        Indices { n, first, count }
    }

    #[test]
    fn a_wrong_pair_is_a_failure() {
        let right = [0u32, 0, 1, 7, 0, 2];
        assert_eq!(estimated(&indices(4, 0, 2), &right).expect("right pairs"), [(0, 0), (1, 7)]);
        assert!(estimated(&indices(4, 0, 1), &[0, 0, 2]).is_err());
    }

    /// Of 4 boxes. As it is, index 1 gives (1, 0), which index 0 tests, 2 gives (1, 1), 3 gives (3, 1), which 4 tests, and 5
    /// gives (0, 6). By the rules 3 gives (2, 1), which is its own pair the other way round, and 5 gives (1, 4).
    #[test]
    fn of_all_indices_it_is_counted_what_is_missed_and_doubled() {
        let rows = [(0, 0), (1, 1), (2, 1), (3, 3), (4, 1), (5, 0)];
        let counts = |tally: Tally| [tally.wrong, tally.worst_row, tally.missed, tally.doubled, tally.none];
        assert_eq!(counts(judged::<AsItIs>(4, &rows)), [4, 2, 4, 2, 2]);
        assert_eq!(counts(judged::<Rules>(4, &rows)), [2, 1, 1, 0, 1]);
        let some = sampled(4, [(1, (1, 0)), (4, (1, 3)), (3, (3, 1))].into_iter());
        assert_eq!((some.pairs, counts(some)), (3, [2, 2, 0, 0, 0]));
    }

    #[test]
    fn small_numbers_of_boxes_have_all_their_indices_looked_at() {
        let parts_of = |n: u32| parts(n, pair_count(n.into()));
        for n in [2, 3, 300, MOST_WHOLE] {
            let indices = parts_of(n).into_iter().flat_map(|part| part.first..part.first + part.count);
            assert!(indices.eq(0..pair_count(n.into()) as u32), "{n}");
        }
        let ends = parts_of(1 << 16).into_iter().map(|part| u64::from(part.first) + u64::from(part.count));
        assert!(ends.is_sorted() && parts_of(1 << 16).len() as u64 == PARTS);
        assert!(parts_of(1 << 16).iter().all(|part| part.count == MOST));
    }

    #[test]
    fn as_many_boxes_as_32_bits_suffice_for() {
        let fits = |root: &Root, n: u64| {
            let largest = if root.number == BISECTION { n * (n - 1) } else { (2 * n - 1).pow(2) };
            largest < 1 << 32
        };
        for root in Root::all() {
            let most = root.most_boxes().into();
            assert!(fits(&root, most) && !fits(&root, most + 1), "{}", root.name);
        }
    }

    /// With one box more an estimate is far off, and a pair by bisection is wrong: the limits are the kernel's own.
    #[test]
    fn kernels_are_right_up_to_their_most_boxes_and_no_further() {
        let Ok(bench) = Bench::new() else { return };
        let at = |root: u32, indices: &Indices| {
            estimated(indices, &run(&bench, root, indices, indices.count).expect("a kernel that runs"))
        };
        let first_row = |n: u32| at(0, &indices(n, 0, 1)).map(|rows| rows[0].1).expect("right pairs");
        assert_eq!(first_row(1 << 15), 0);
        assert!(first_row((1 << 15) + 1) > 1000);
        let last = |n: u32| at(BISECTION, &indices(n, (pair_count(n.into()) - 4) as u32, 4));
        assert!(last(1 << 16).is_ok() && last((1 << 16) + 1).is_err());
    }

    #[test]
    fn every_root_runs_and_lost_pairs_are_told() {
        let Ok(bench) = Bench::new() else { return };
        let found = estimates(&bench, true, true).expect("right pairs");
        assert_eq!(found.len(), 2 * (Root::all().count() + 1), "and the lazy way");
        let told = missed_note(&found, 300);
        let one_step = found.iter().find(|one| one.n == 300 && one.name == "Carmack 1").expect("one step");
        let lost = format!("as it is: Carmack 1 {} (", one_step.tally.missed);
        assert!(told.contains(&lost) && !told.contains("bisection"), "{told}");
        assert!(told.ends_with("by the paper's rules: none with any root."), "{told}");
    }
}
