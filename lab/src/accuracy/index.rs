//! From the index of a pair to the pair (Avril 3.2 and 3.3): every root and every correction.

mod paper;
mod tally;

use super::{percent, report};
use crate::index::{CORRECTIONS, as_it_is, ends, lazy_ids, lazy_pair, pairs_of, rules};
use pbig_harness::prelude::*;
use rayon::prelude::*;
use std::hint::black_box;
use std::time::Duration;
use tally::{Block, RootWay, Tally, WAYS, lazy_pass};

/// The name of the way without a row.
const LAZY: &str = "lazy way";

pub(super) fn run(quick: bool) -> Result<BenchReport, Failure> {
    let every: Vec<Every> = WAYS.iter().map(|way| Every::of(way, quick)).collect();
    check_all(&every)?;
    let at = if quick { &[1000, 1 << 20][..] } else { &[1000, 5000, 10_000, 100_000, 1 << 20] };
    let columns = "boxes | root | as_it_is_ns_per_pair | by_the_rules_ns_per_pair | by_integers_ns_per_pair";
    let mut times = Table::new("times", columns);
    at.iter().try_for_each(|&n| add_times(n, quick, &mut times))?;
    let every = every_table(&every, quick)?;
    let axes = ["time, ns per pair (one thread, 5,000 boxes)", "wrong pairs, % of all n looked at"];
    let points = points(&every, &times);
    let paper = [paper::table_3(quick), paper::table_4(quick)];
    let tables = [every, counterexamples(quick), times].into_iter().chain(paper).collect();
    Ok(report("index", tables, ("From the index of a pair to the pair", axes), points))
}

/// The counts of all pairs, for many n.
struct Every {
    way: &'static RootWay,
    boxes: Vec<i64>,
    tallies: [Tally; 3],
    /// The smallest n with a wrong pair.
    first: [Option<i64>; 3],
}

/// Returns the numbers of boxes all of whose pairs are looked at: fewer for ways that are slow or mostly wrong.
fn boxes(has_few: bool, quick: bool) -> Vec<i64> {
    match (quick, has_few) {
        (true, false) => (2..=250).chain([1000]).collect(),
        (true, true) => (2..=100).chain([1000]).collect(),
        (false, false) => (2..=5000).collect(),
        (false, true) => (2..=700).chain((725..=5000).step_by(25)).collect(),
    }
}

impl Every {
    fn of(way: &'static RootWay, quick: bool) -> Self {
        let boxes = boxes(way.is_exact || way.is_coarse(), quick);
        let all: Vec<_> = boxes.par_iter().map(|&n| (n, (way.all)(n))).collect();
        let mut every = Self { way, boxes, tallies: Default::default(), first: [None; 3] };
        for (n, tallies) in all {
            for (c, tally) in tallies.into_iter().enumerate() {
                every.tallies[c] += tally;
                every.first[c] = every.first[c].or((tally.wrong > 0).then_some(n));
            }
        }
        every
    }
}

/// After the correction by integers nothing may be wrong, nor without an estimate.
fn check_all(every: &[Every]) -> Result<(), Failure> {
    let wrong = |every: &Every| every.first[2].or(every.first[0].filter(|_| every.way.is_exact));
    let found = every.iter().find_map(|every| Some((every.way.name, wrong(every)?)));
    check(found.is_none(), || format!("a pair is wrong by integers, or without an estimate: {found:?}"))
}

fn every_table(all: &[Every], quick: bool) -> Result<Table, Failure> {
    let columns = "root | correction | largest_n | values_of_n | pairs | wrong | wrong_percent | first_wrong_n | worst_row | \
        missed | doubled | no_pair";
    let mut table = Table::new("all_pairs", columns);
    for (every, c) in all.iter().flat_map(|every| (0..CORRECTIONS.len()).map(move |c| (every, c))) {
        let Tally { looked, wrong, worst_row, none, missed } = every.tallies[c];
        let counts = cells![looked, wrong, percent(wrong, looked), every.first[c], worst_row, missed];
        let head = cells![every.way.name, CORRECTIONS[c], every.boxes.last().copied(), every.boxes.len()];
        table.row(cells![..head, ..counts, missed - none, none]);
    }
    let boxes = boxes(true, quick);
    let wrong = boxes.par_iter().find_any(|n| !lazy_way_is_right(**n));
    check(wrong.is_none(), || format!("{LAZY}: a pair is wrong with this number of boxes: {wrong:?}"))?;
    let pairs: i64 = boxes.iter().map(|n| pairs_of(*n)).sum();
    let head = cells![LAZY, CORRECTIONS[0], boxes.last().copied(), boxes.len(), pairs];
    table.row(cells![..head, 0, 0.0, (), 0, 0, 0, 0]);
    Ok(table)
}

/// Returns true if the identifiers above the diagonal give every pair once, in order.
fn lazy_way_is_right(n: i64) -> bool {
    let all = (0..n).flat_map(|a| (a + 1..n).map(move |b| (a, b)));
    (0..lazy_ids(n)).filter_map(|id| lazy_pair(id, n)).eq(all)
}

/// The smallest n for which the rules give a wrong pair at an end of a row.
fn counterexamples(quick: bool) -> Table {
    let mut table = Table::new("counterexamples", "root | searched_up_to | boxes | index | given | right");
    let most = if quick { 1 << 16 } else { 1 << 20 };
    let ways: Vec<&RootWay> = WAYS.iter().filter(|way| !way.is_exact).collect();
    let found: Vec<_> = ways.par_iter().map(|way| counterexample(way, most)).collect();
    for (way, found) in ways.into_iter().zip(found) {
        let at = found.map(|(n, row, k)| {
            cells![n, k, format!("{:?}", by_rules(way, n, k)), format!("{:?}", as_it_is(row, k, n))]
        });
        table.row(cells![way.name, most, ..at.unwrap_or_else(|| cells![(), (), "none"])]);
    }
    table
}

fn by_rules(way: &RootWay, n: i64, k: i64) -> (i64, i64) {
    rules((way.row)(k, n), k, n)
}

/// Returns the smallest `n <= most <= 2^20` with its row and index. A root is wrong by more than one row only if it can be off by
/// more than 2; rounding to f32 adds an eighth at most. An index within a row could be wrong at an n a little smaller.
fn counterexample(way: &RootWay, most: i64) -> Option<(i64, i64, i64)> {
    let least = 1.875 / way.error;
    (((least / 2.0) as i64).max(2)..=most).find_map(|n| {
        // The root at the start of row `a` is `2n - 1 - 2a`.
        let rows = ((((2 * n - 1) as f64 - least) / 2.0).ceil() as i64 + 1).clamp(0, n - 1);
        let mut places = (0..rows).flat_map(|row| ends(row, n).map(|k| (n, row, k)));
        places.find(|&(n, row, k)| by_rules(way, n, k) != as_it_is(row, k, n))
    })
}

/// Blocks of indices that are timed, evenly spread, and the length of each.
const BLOCKS: i64 = 16;
const BLOCK: i64 = 2048;

fn blocks(all: i64, count: i64) -> Vec<Block> {
    (0..BLOCKS).map(|k| ((all - count) * k / (BLOCKS - 1), count)).collect()
}

/// Appends nanoseconds for a pair on one thread, by every way and correction in turn.
fn add_times(n: i64, quick: bool, table: &mut Table) -> Result<(), Failure> {
    let (pairs, ids) = (blocks(pairs_of(n), BLOCK), blocks(lazy_ids(n), 2 * BLOCK));
    let count: i64 = pairs.iter().map(|block| block.1).sum();
    let sides = 3 * WAYS.len() + 1;
    let rounds = if quick { 15 } else { 2 * sides };
    let effort = Effort { warm_up: 0, rounds, budget: Duration::from_secs(20) };
    let mut times = vec![vec![]; sides];
    measured(&mut times, sides, effort, unprepared, |times, side| {
        let ((found, _), ms) = match WAYS.get(side / 3) {
            Some(way) => timed(|| (count, black_box((way.passes[side % 3])(n, &pairs)))),
            None => timed(|| black_box(lazy_pass(n, &ids))),
        };
        times[side].push(ms * 1e6 / found.max(1) as f64);
        Ok(ms)
    })?;
    // Medians over all places in a round: there are too many places for a median of each.
    let ns: Vec<f64> = times.into_iter().map(|times| Spread::of(times).median).collect();
    for (way, ns) in WAYS.iter().zip(ns.chunks(3)) {
        table.row(cells![n, way.name, ns[0], ns[1], ns[2]]);
    }
    table.row(cells![n, LAZY, ns[sides - 1], None::<f64>, None::<f64>]);
    Ok(())
}

/// Lines of the chart: the name, the ways that it joins, and the corrections.
const LINES: [(&str, &str, &[usize]); 8] = [
    ("f32 sqrt, each correction", "f32 sqrt", &[0, 1, 2]),
    ("f64 sqrt, each correction", "f64 sqrt", &[0, 1, 2]),
    ("Carmack, as it is", "Carmack", &[0]),
    ("Carmack, the paper's rules", "Carmack", &[1]),
    ("Lomont, as it is", "Lomont", &[0]),
    ("without an estimate", "bisection", &[0]),
    ("without an estimate", "integer root", &[0]),
    ("without an estimate", LAZY, &[0]),
];

/// Returns time and error of roots as they are (of Newton's with one to four steps) and corrected.
fn points(errors: &Table, times: &Table) -> Vec<(String, f64, f64)> {
    let at = if times.rows.iter().any(|row| row[0] == 5000) { 5000 } else { 1000 };
    let mut points = vec![];
    for (name, way, corrections) in LINES {
        let is_of = |row: &&Vec<Value>| row[0] == at && row[1].as_str().is_some_and(|it| it.starts_with(way));
        let rows = times.rows.iter().filter(is_of);
        for (row, &c) in rows.flat_map(|row| corrections.iter().map(move |c| (row, c))) {
            let error = errors.rows.iter().find(|error| error[0] == row[1] && error[1] == CORRECTIONS[c]);
            let both = error.and_then(|error| row[2 + c].as_f64().zip(error[6].as_f64()));
            points.extend(both.map(|(time, error)| (name.to_owned(), time, error)));
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_pair_by_integers_is_a_failed_check() {
        let mut every = Every::of(&WAYS[2], true);
        let is_wrong = |n: &i64| (WAYS[2].all)(*n)[0].wrong > 0;
        assert_eq!(every.first[0], (2..100).find(is_wrong));
        assert!(check_all(&[Every::of(&WAYS[2], true)]).is_ok());
        every.first[2] = Some(7);
        assert!(check_all(&[every]).is_err_and(|failure| failure.to_string().contains("Carmack 1\", 7")));
    }

    #[test]
    fn before_a_counterexample_the_rules_mend_everything() {
        for way in WAYS[2..4].iter().chain(&WAYS[6..8]) {
            let (n, row, k) = counterexample(way, 1 << 18).expect("a counterexample");
            assert_ne!(by_rules(way, n, k), as_it_is(row, k, n));
            let mut tallies = (2..n).step_by(31).map(|n| (way.all)(n));
            assert!(n > 5000 || tallies.all(|tallies| tallies[1].wrong == 0));
        }
    }
}
