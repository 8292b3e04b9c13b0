//! From the index of a pair to the pair (Avril 3.2 and 3.3): every root and every correction.

mod ends;
mod exact;
mod kernels;
mod paper;
mod roundings;
mod rules;
mod sizes;
mod times;

use super::{percent, report};
use crate::index::{CORRECTIONS, Tally, WAYS, Way};
use ends::Shown;
use exact::Exactly;
use pbig_harness::cells;
use pbig_harness::kernels::Bench;
use pbig_harness::output::Failure;
use pbig_harness::report::Report;
use pbig_harness::table::{Cell, Table};
use rayon::prelude::*;
use times::{Times, label};

pub(super) fn run(quick: bool) -> Result<Report, Failure> {
    let every: Vec<Every> = WAYS.iter().map(|way| Every::of(way, quick)).collect();
    let (exact, sizes) = (exact::tallied(quick), sizes::looked_at(quick));
    check(&every, &exact, &sizes)?;
    let at = if quick { vec![1000, 1 << 20] } else { vec![16, 128, 1000, 5000, 10_000, 100_000, 1 << 20] };
    let times = at.iter().map(|&n| Times::measure(n, quick)).collect::<Result<Vec<_>, _>>()?;
    let mut tables = vec![every_table(&every, &exact), sizes::table(&sizes), rules::counterexamples(quick)];
    tables.extend([times::table(&times), paper::table_3(quick), paper::table_4(quick), roundings::ways()]);
    let (kernels, adapter) = kernels(quick)?;
    tables.extend(kernels);
    let axes = ["time, ns per pair (one thread, 5,000 boxes)", "wrong pairs, % of all n looked at"];
    let points = points(&every, &exact, &times);
    let report = report("index", tables, ("From the index of a pair to the pair", axes), points);
    Ok(Report { head: vec![("adapter", adapter)], ..report })
}

/// The counts of all pairs, for many n.
struct Every {
    way: Way,
    /// Every n, ascending.
    boxes: Vec<i64>,
    /// As it is, by the rules, by integers.
    tallies: [Tally; 3],
    /// The smallest n with a wrong pair.
    first: [Option<i64>; 3],
    /// The counts of the ends of rows alone.
    at_ends: [Shown; 3],
}

fn boxes(quick: bool) -> Vec<i64> {
    if quick { (2..=250).chain([1000]).collect() } else { (2..=5000).collect() }
}

impl Every {
    fn of(way: &Way, quick: bool) -> Self {
        let boxes = boxes(quick);
        let all = boxes.par_iter().map(|&n| Self::of_one(way, n)).reduce(|| Self::of_none(way), Self::and);
        Self { boxes, ..all }
    }

    fn of_none(way: &Way) -> Self {
        Self {
            way: *way,
            boxes: vec![],
            tallies: Default::default(),
            first: [None; 3],
            at_ends: Default::default(),
        }
    }

    fn of_one(way: &Way, n: i64) -> Self {
        let tallies = (way.tally)(n);
        let first = tallies.map(|tally| (tally.wrong > 0).then_some(n));
        Self { tallies, first, at_ends: ends::shown(way, n, &tallies), ..Self::of_none(way) }
    }

    /// With what comes of others.
    fn and(mut self, other: Self) -> Self {
        for k in 0..3 {
            self.tallies[k] += other.tallies[k];
            self.first[k] = [self.first[k], other.first[k]].into_iter().flatten().min();
            self.at_ends[k] = self.at_ends[k].and(other.at_ends[k]);
        }
        self
    }
}

/// After the correction by integers nothing may be wrong, nor without an estimate.
fn check(every: &[Every], exact: &[Exactly], sizes: &[sizes::Size]) -> Result<(), Failure> {
    let estimated = every.iter().filter_map(|every| Some((label(&every.way), every.first[2]?)));
    let large = sizes.iter().filter(|size| !size.is_right(2)).map(|size| (label(&WAYS[size.way]), size.n));
    let exactly = exact.iter().filter_map(|way| Some((way.name.to_owned(), way.first?)));
    estimated.chain(large).chain(exactly).next().map_or(Ok(()), |(name, n)| {
        Err(Failure::Check(format!("{name}: a pair of {n} boxes is wrong, by integers")))
    })
}

/// Each root with each correction over all pairs of every n up to 5,000; ways without an estimate over those of some.
fn every_table(all: &[Every], exact: &[Exactly]) -> Table {
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
        "no_pair",
        "values_of_n_with_wrong_pairs",
        "of_these_with_right_ends_of_rows",
        "worst_row_at_ends",
    ];
    let mut table = Table::new("all_pairs", columns);
    for (every, k) in all.iter().flat_map(|every| (0..CORRECTIONS.len()).map(move |k| (every, k))) {
        let most = every.boxes.last().copied().unwrap_or(0);
        let head = cells![label(&every.way), CORRECTIONS[k], most as u64, every.boxes.len()];
        table
            .row([head, counts(&every.tallies[k], every.first[k]), every.at_ends[k].cells().into()].concat());
    }
    for one in exact {
        let head = cells![one.name, CORRECTIONS[0], one.most as u64, one.values];
        table.row([head, counts(&one.tally, one.first), vec![Cell::Nothing; 3]].concat());
    }
    table
}

fn counts(tally: &Tally, first: Option<i64>) -> Vec<Cell> {
    let (share, first) = (percent(tally.wrong, tally.pairs), first.map(|n| n as u64));
    let wrong = cells![tally.pairs, tally.wrong, share, first, tally.worst_row];
    [wrong, cells![tally.missed, tally.doubled, tally.none]].concat()
}

/// Returns the tables of kernels, where there is an adapter; and its name, or why there is none.
fn kernels(quick: bool) -> Result<(Vec<Table>, String), Failure> {
    let adapter = pbig_core::GpuFinder::new().map(|gpu| (gpu.adapter().to_owned(), gpu.is_software()));
    match (Bench::new(), adapter) {
        (Ok(bench), Ok((name, software))) => Ok((vec![kernels::table(&bench, software, quick)?], name)),
        (Err(why), _) | (_, Err(why)) => Ok((vec![], format!("none: {why}"))),
    }
}

/// Time and error of roots as they are (of Newton's with one to four steps) and corrected, and of ways without an estimate.
fn points(every: &[Every], exact: &[Exactly], times: &[Times]) -> Vec<(String, f64, f64)> {
    let Some(at) = times.iter().find(|times| times.n == 5000).or(times.first()) else { return vec![] };
    let point = |name: String, way: usize, fix: usize| {
        let tally = &every[way].tallies[fix];
        (name, at.ways[way][fix], percent(tally.wrong, tally.pairs))
    };
    let of = |name: &'static str, fixes: &'static [usize]| {
        let ways = every.iter().enumerate().filter(move |(_, every)| every.way.name == name);
        let all = ways.flat_map(move |(way, _)| fixes.iter().map(move |&fix| (way, fix)));
        all.map(move |(way, fix)| {
            let is_newton = every[way].way.steps.is_some();
            let fix_name = if is_newton { CORRECTIONS[fix] } else { "each correction" };
            point(format!("{name}, {fix_name}"), way, fix)
        })
    };
    let roots = of("f32 sqrt", &[0, 1, 2]).chain(of("f64 sqrt", &[0, 1, 2])).chain(of("Carmack", &[0]));
    let roots = roots.chain(of("Carmack", &[1])).chain(of("Lomont", &[0]));
    let without = exact.iter().zip(at.exact).map(|(one, time)| {
        ("without an estimate".to_owned(), time, percent(one.tally.wrong, one.tally.pairs))
    });
    roots.chain(without).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_over_n_do_not_depend_on_how_they_are_split_and_a_wrong_pair_is_a_failed_check() {
        let way = WAYS.iter().find(|way| label(way) == "Carmack 1").expect("a way");
        let mut every = Every::of(way, true);
        let mut slow = [Tally::default(); 3];
        for n in boxes(true) {
            slow.iter_mut().zip((way.tally)(n)).for_each(|(sum, tally)| *sum += tally);
        }
        assert_eq!(every.tallies, slow);
        assert_eq!(every.first[0], (2..).find(|&n| (way.tally)(n)[0].wrong > 0));
        every.first[2] = Some(7);
        let failed = check(&[every], &[], &[]);
        assert!(failed.is_err_and(|failure| failure.to_string().contains("7 boxes")));
    }
}
