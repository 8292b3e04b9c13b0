//! From the index of a pair to the pair (Avril 3.2 and 3.3): every root and every correction.

mod kernels;
mod paper;
mod times;

use super::study::{Cell, Point, Study, Table};
use crate::output::Failure;
use pbig_core::gpu::study::Bench;
use pbig_harness::index::{CORRECTIONS, Counterexample, MOST_EXHAUSTIVE, Sample, Tally, WAYS, Way};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use rayon::prelude::*;
use times::{Times, label};

pub(super) fn run(quick: bool) -> Result<Study, Failure> {
    let every: Vec<Every> = WAYS.iter().map(|way| Every::of(way, quick)).collect();
    check(&every)?;
    let sizes = if quick { vec![1000, 1 << 20] } else { vec![1000, 5000, 10_000, 100_000, 1 << 20] };
    let times = sizes.iter().map(|&n| Times::measure(n, quick)).collect::<Result<Vec<_>, _>>()?;
    let found = counterexamples(quick);
    let (kernels, adapter) = kernels(quick)?;
    let mut notes = notes(&every, &found, quick);
    let table_3 = paper::table_3(quick);
    notes.extend([paper::table_3_note(&table_3), fastest_note(&every, &times), adapter]);
    let tables = [every_table(&every, quick), sizes_table(quick), counterexample_table(&found)];
    let rest = [times::table(&times), paper::table_2(&times), table_3, paper::table_4(quick)];
    Ok(Study {
        name: "index",
        title: "From the index of a pair to the pair",
        notes,
        tables: tables.into_iter().chain(rest).chain(kernels).collect(),
        time: "ns per pair, one thread, 5,000 boxes (1,000 with --quick)",
        error: "wrong pairs, %, of all n looked at",
        points: points(&every, &times),
        joined: true,
    })
}

/// What comes of all pairs, for many n.
struct Every {
    way: Way,
    values: u64,
    most: i64,
    /// As it is, by the rules, by integers.
    tallies: [Tally; 3],
    /// The smallest n with a wrong pair.
    first: [Option<i64>; 3],
}

/// Every n up to this, and how far apart they are beyond. One step of Newton leaves most pairs of many boxes wrong,
/// each of which is looked at in turn: thirty times the time of the others.
fn boxes(way: &Way, quick: bool) -> Vec<i64> {
    match (quick, way.steps) {
        (true, _) => (2..=250).chain([1000]).collect(),
        (false, Some(1)) => (2..=1000).chain((1050..=5000).step_by(50)).collect(),
        (false, _) => (2..=5000).collect(),
    }
}

impl Every {
    fn of(way: &Way, quick: bool) -> Self {
        let boxes = boxes(way, quick);
        let most = boxes.last().copied().unwrap_or(0);
        let zero = || Self { way: *way, values: 0, most, tallies: Default::default(), first: [None; 3] };
        let one = |mut sum: Self, &n: &i64| {
            let tallies = (way.tally)(n);
            sum.values += 1;
            for (k, tally) in tallies.into_iter().enumerate() {
                sum.tallies[k] += tally;
                sum.first[k] = sum.first[k].or((tally.wrong > 0).then_some(n));
            }
            sum
        };
        boxes.par_iter().fold(zero, one).reduce(zero, Self::and)
    }

    /// With what comes of others.
    fn and(mut self, other: Self) -> Self {
        self.values += other.values;
        for k in 0..3 {
            self.tallies[k] += other.tallies[k];
            self.first[k] = [self.first[k], other.first[k]].into_iter().flatten().min();
        }
        self
    }

    fn percent(&self, correction: usize) -> f64 {
        percent(self.tallies[correction].wrong, self.tallies[correction].pairs)
    }
}

fn percent(part: u64, all: u64) -> f64 {
    part as f64 / all.max(1) as f64 * 100.0
}

/// After the correction by integers, nothing may be wrong.
fn check(every: &[Every]) -> Result<(), Failure> {
    let wrong = every.iter().find_map(|every| every.first[2].map(|n| (label(&every.way), n)));
    wrong.map_or(Ok(()), |(name, n)| {
        Err(Failure::Check(format!("{name}: a pair of {n} boxes is wrong after the correction by integers")))
    })
}

fn every_table(every: &[Every], quick: bool) -> Table {
    let title = if quick { "All pairs, n up to 250, and 1,000" } else { "All pairs, n up to 5,000" };
    let columns = [
        "root",
        "correction",
        "largest_n",
        "values_of_n",
        "pairs",
        "wrong",
        "wrong_percent",
        "first_wrong_n",
        "worst_row",
        "missed",
        "doubled",
    ];
    let mut table = Table::new("all_pairs", title, &columns);
    for every in every {
        for (k, correction) in CORRECTIONS.into_iter().enumerate() {
            let tally = every.tallies[k];
            table.row([
                label(&every.way).into(),
                correction.into(),
                (every.most as u64).into(),
                every.values.into(),
                tally.pairs.into(),
                tally.wrong.into(),
                every.percent(k).into(),
                every.first[k].map(|n| n as u64).into(),
                tally.worst_row.into(),
                tally.missed.into(),
                tally.doubled.into(),
            ]);
        }
    }
    table
}

/// From 2 to 2^20; beyond [`MOST_EXHAUSTIVE`] a sample.
fn sizes_table(quick: bool) -> Table {
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
        "wrong_by_the_rules_percent",
        "worst_row_by_the_rules",
        "missed_by_the_rules",
    ];
    let mut table = Table::new("sizes", title, &columns);
    let all: &[i64] = if quick { &[2, 1000] } else { &[2, 16, 128, 1024, 4096, 8192, MOST_EXHAUSTIVE] };
    // 46,341 is where 32-bit signed products of n with itself end, 92,683 where unsigned ones of pairs do.
    let large: &[i64] = if quick {
        &[1 << 20]
    } else {
        &[1 << 15, 46_342, 1 << 16, 92_683, 1 << 17, 1 << 18, 1 << 19, 1 << 20]
    };
    let all = all.iter().flat_map(|&n| WAYS.iter().map(move |way| (n, way)));
    // A step of Newton leaves a hundred million wrong pairs there, and lists of them.
    let all: Vec<_> = all.filter(|&(n, way)| n <= 5000 || way.steps != Some(1)).collect();
    let rows: Vec<_> = all.par_iter().map(|&(n, way)| row_of_all(n, way)).collect();
    rows.into_iter().for_each(|row| table.row(row));
    for &n in large {
        let indices = indices(n, if quick { 10_000 } else { 1_000_000 });
        let rows: Vec<_> = WAYS.par_iter().map(|way| row_of_sample(n, way, &indices)).collect();
        rows.into_iter().for_each(|row| table.row(row));
    }
    table
}

fn row_of_all(n: i64, way: &Way) -> Vec<Cell> {
    let [as_it_is, rules, _] = (way.tally)(n);
    let share = |tally: Tally| Cell::from(percent(tally.wrong, tally.pairs));
    vec![
        (n as u64).into(),
        label(way).into(),
        "all".into(),
        share(as_it_is),
        Cell::Nothing,
        as_it_is.worst_row.into(),
        as_it_is.missed.into(),
        as_it_is.doubled.into(),
        share(rules),
        rules.worst_row.into(),
        rules.missed.into(),
    ]
}

/// Evenly at random, the same in every run.
fn indices(n: i64, count: usize) -> Vec<i64> {
    let mut rng = StdRng::seed_from_u64(n as u64);
    (0..count).map(|_| rng.random_range(0..n * (n - 1) / 2)).collect()
}

fn row_of_sample(n: i64, way: &Way, indices: &[i64]) -> Vec<Cell> {
    let [as_it_is, rules, _] = (way.sample)(n, indices);
    let share = |sample: Sample| Cell::from(percent(sample.wrong_inner, sample.inner));
    vec![
        (n as u64).into(),
        label(way).into(),
        format!("ends of rows, {} others", as_it_is.inner).into(),
        share(as_it_is),
        percent(as_it_is.wrong_ends, as_it_is.ends).into(),
        as_it_is.worst_row.into(),
        Cell::Nothing,
        Cell::Nothing,
        share(rules),
        rules.worst_row.into(),
        Cell::Nothing,
    ]
}

/// How far counterexamples are searched.
const MOST_SEARCHED: i64 = 1 << 20;

fn counterexamples(quick: bool) -> Vec<(Way, i64, Option<Counterexample>)> {
    // Of two steps it takes seconds.
    let most = if quick { 1 << 16 } else { MOST_SEARCHED };
    WAYS.par_iter().map(|way| (*way, most, (way.counterexample)(most))).collect()
}

fn counterexample_table(found: &[(Way, i64, Option<Counterexample>)]) -> Table {
    let title = "The smallest n for which the paper's rules give a wrong pair, counted from 0";
    let columns = ["root", "searched_up_to", "boxes", "index", "given", "right"];
    let mut table = Table::new("counterexamples", title, &columns);
    for (way, most, found) in found {
        let pair = |(a, b): (i64, i64)| format!("({a}, {b})");
        table.row([
            label(way).into(),
            (*most as u64).into(),
            found.map(|it| it.n as u64).into(),
            found.map(|it| it.k as u64).into(),
            found.map_or("none".into(), |it| pair(it.given).into()),
            found.map(|it| pair(it.right)).into(),
        ]);
    }
    table
}

/// The table, where there is an adapter, and which it is or why there is none.
fn kernels(quick: bool) -> Result<(Option<Table>, String), Failure> {
    let adapter = pbig_core::GpuFinder::new().map(|gpu| (gpu.adapter().to_owned(), gpu.is_software()));
    match (Bench::new(), adapter) {
        (Ok(bench), Ok((name, software))) => {
            let what =
                if software { ", software: its times would mean nothing and are left out" } else { "" };
            let scope = "indices from eight parts of all; no f64 there, and no lazy way";
            Ok((
                Some(kernels::table(&bench, software, quick)?),
                format!("As kernels on {name}{what}; {scope}."),
            ))
        }
        (Err(why), _) | (_, Err(why)) => Ok((None, format!("Not run as kernels: {why}."))),
    }
}

fn points(every: &[Every], times: &[Times]) -> Vec<Point> {
    let Some(at) = times.iter().find(|times| times.n == 5000).or(times.first()) else { return vec![] };
    let of = |way: usize, fix: usize| {
        let name = every[way].way.name;
        let error = every[way].percent(fix);
        Point { series: format!("{name}, {}", CORRECTIONS[fix]), time: at.ways[way][fix], error }
    };
    let ways = (0..every.len()).flat_map(|way| (0..CORRECTIONS.len()).map(move |fix| (way, fix)));
    let exact = at.exact().map(|(name, time)| Point { series: name.into(), time, error: 0.0 });
    ways.map(|(way, fix)| of(way, fix)).chain(exact).collect()
}

fn notes(every: &[Every], found: &[(Way, i64, Option<Counterexample>)], quick: bool) -> Vec<String> {
    let mut notes = vec![
        "What stands under the root is an exact 64-bit integer, rounded once; the row is what is left without the fraction. \
         By integers nothing was wrong, whatever the root: that is checked in every run."
            .to_owned(),
        "`Carmack 2` is two steps of Newton from Carmack's constant. Missed: pairs that no index gives. Doubled: indices \
         that give a pair (a, b), a < b, which another gives, too; most wrong ones give b <= a instead."
            .to_owned(),
        "Beyond 16,384 boxes the first and last index of every row are looked at, where a wrong row begins, and others \
         evenly at random; missed and doubled pairs are not counted there."
            .to_owned(),
    ];
    if !quick {
        notes.push("One step: every n up to 1,000, then every fiftieth.".to_owned());
    }
    notes.push(sign_note());
    notes.extend(rules_notes(every, found));
    notes.push(table_2_note());
    notes.push(
        "Table 4 does not say how many steps were taken; roots of whole numbers from 1 on, four or more at once where \
         the compiler does that."
            .to_owned(),
    );
    notes
}

/// The text of 3.3 adds 8k under the root, equation 1 subtracts it.
fn sign_note() -> String {
    let (n, m) = (1000i64, 1999i64);
    let pairs = n * (n - 1) / 2;
    let row = |k: i64| ((m as f64 - ((m * m + 8 * k) as f64).sqrt()) / 2.0) as i64;
    let right = |k: i64| pbig_core::pair_index::pair_of(k as u64, n as u64).0 as i64;
    let wrong = (0..pairs).filter(|&k| row(k) != right(k)).count();
    let share = super::study::plain(percent(wrong as u64, pairs as u64));
    format!(
        "With `+ 8k` under the root, as the text of 3.3 has it, {share}% of the pairs of {n} boxes are wrong; equation 1 has the right sign."
    )
}

fn rules_notes(every: &[Every], found: &[(Way, i64, Option<Counterexample>)]) -> Vec<String> {
    let wrong = |it: &&(Way, i64, Option<Counterexample>)| it.2.is_some();
    let told = found.iter().filter(wrong).filter_map(|(way, _, it)| Some((label(way), (*it)?)));
    let told = told.map(|(name, it)| format!("{name} from n = {} on (index {})", it.n, it.k));
    let told: Vec<_> = told.collect();
    let most = found.first().map_or(0, |it| it.1);
    let none: Vec<_> = found.iter().filter(|it| it.2.is_none()).map(|(way, ..)| label(way)).collect();
    let worst = every.iter().filter(|every| every.tallies[1].wrong > 0);
    let worst: Vec<_> = worst
        .map(|every| {
            let share = super::study::plain(every.percent(1));
            format!(
                "{} {share}% of all pairs looked at, {} missed",
                label(&every.way),
                every.tallies[1].missed
            )
        })
        .collect();
    vec![
        format!(
            "The paper's rules are not always right: they mend a row that is off by one, and no other. Wrong: {}. No wrong \
             pair up to n = {most}: {}.",
            told.join(", "),
            none.join(", ")
        ),
        format!(
            "Left wrong by the rules: {}.",
            if worst.is_empty() { "none".into() } else { worst.join("; ") }
        ),
    ]
}

/// What is never wrong up to 5,000 boxes, by time.
fn fastest_note(every: &[Every], times: &[Times]) -> String {
    let points = points(every, times);
    let mut right: Vec<&Point> = points.iter().filter(|point| point.error == 0.0).collect();
    right.sort_by(|a, b| a.time.total_cmp(&b.time));
    let told = right.iter().take(6).map(|point| format!("{} {:.1} ns", point.series, point.time));
    format!("Never wrong in the chart, fastest first: {}.", told.collect::<Vec<_>>().join("; "))
}

/// Times that grow with the objects cannot be of all their pairs.
fn table_2_note() -> String {
    let [first, .., last] = paper::TABLE_2;
    let ratio = |a: f64, b: f64| super::study::plain(b / a);
    let pairs = ratio(paper::pairs(first.0) as f64, paper::pairs(last.0) as f64);
    let objects = ratio(first.0 as f64, last.0 as f64);
    format!(
        "Table 2 of the paper: from {} to {} objects there are {objects} times the objects and {pairs} times the pairs, and its \
         time grows {} times. So it cannot be the time for n (n - 1) / 2 pairs at each of these sizes.",
        first.0,
        last.0,
        ratio(first.1, last.1)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_over_n_do_not_depend_on_how_they_are_split() {
        let way = WAYS.iter().find(|way| label(way) == "Carmack 1").expect("a way");
        let every = Every::of(way, true);
        let mut slow = [Tally::default(); 3];
        for n in boxes(way, true) {
            for (sum, tally) in slow.iter_mut().zip((way.tally)(n)) {
                *sum += tally;
            }
        }
        assert_eq!(every.tallies, slow);
        assert_eq!(every.values, 250);
        let first = (2..).find(|&n| (way.tally)(n)[0].wrong > 0);
        assert_eq!(every.first[0], first);
    }

    #[test]
    fn a_wrong_pair_after_integers_is_a_failed_check() {
        let mut every = Every::of(&WAYS[0], true);
        assert!(check(std::slice::from_ref(&every)).is_ok());
        every.first[2] = Some(7);
        assert!(check(&[every]).is_err_and(|failure| failure.to_string().contains("7 boxes")));
    }
}
