//! From the index of a pair to the pair (Avril 3.2 and 3.3): every root and every correction.

mod ends;
mod exact;
mod kernels;
mod notes;
mod paper;
mod roundings;
mod rules;
mod sizes;
mod times;

use super::study::{Cell, Point, Study, Table};
use crate::output::Failure;
use ends::Shown;
use exact::Exactly;
use pbig_harness::index::{CORRECTIONS, Tally, WAYS, Way};
use pbig_harness::kernels::Bench;
use rayon::prelude::*;
use times::{Times, label};

pub(super) fn run(quick: bool) -> Result<Study, Failure> {
    let every: Vec<Every> = WAYS.iter().map(|way| Every::of(way, quick)).collect();
    let (exact, sizes) = (exact::tallied(quick), sizes::looked_at(quick));
    check(&every, &exact, &sizes)?;
    let at = if quick { vec![1000, 1 << 20] } else { vec![16, 128, 1000, 5000, 10_000, 100_000, 1 << 20] };
    let times = at.iter().map(|&n| Times::measure(n, quick)).collect::<Result<Vec<_>, _>>()?;
    let (kernels, of_kernels) = kernels(quick)?;
    let found = Found {
        exact,
        sizes,
        counterexamples: rules::counterexamples(quick),
        table_3: paper::table_3(quick),
        table_4: paper::table_4(quick),
        every,
        times,
        quick,
    };
    let notes = notes::notes(&found).into_iter().chain(of_kernels).collect();
    let points = points(&found);
    Ok(Study {
        name: "index",
        title: "From the index of a pair to the pair",
        notes,
        tables: found.tables().into_iter().chain(kernels).collect(),
        time: "ns per pair, one thread, 5,000 boxes (1,000 with --quick)",
        error: "wrong pairs, %, of all n looked at",
        points,
        joined: true,
    })
}

/// All that is found on the CPU.
struct Found {
    /// In the order of [`WAYS`].
    every: Vec<Every>,
    /// In the order of [`pbig_harness::index::EXACT`].
    exact: Vec<Exactly>,
    sizes: Vec<sizes::Size>,
    times: Vec<Times>,
    counterexamples: Vec<rules::Searched>,
    table_3: Table,
    table_4: Table,
    quick: bool,
}

impl Found {
    fn tables(self) -> [Table; 7] {
        [
            every_table(&self),
            sizes::table(&self.sizes),
            rules::table(&self.counterexamples),
            times::table(&self.times),
            paper::table_2(&self.times),
            self.table_3,
            self.table_4,
        ]
    }
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

    fn most(&self) -> i64 {
        self.boxes.last().copied().unwrap_or(0)
    }

    fn percent(&self, correction: usize) -> f64 {
        percent(self.tallies[correction].wrong, self.tallies[correction].pairs)
    }
}

fn percent(part: u64, all: u64) -> f64 {
    part as f64 / all.max(1) as f64 * 100.0
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

fn every_table(found: &Found) -> Table {
    let title = if found.quick { "All pairs, n up to 250, and 1,000" } else { "All pairs, n up to 5,000" };
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
    let mut table = Table::new("all_pairs", title, &columns);
    for every in &found.every {
        for (k, correction) in CORRECTIONS.into_iter().enumerate() {
            let head = [label(&every.way), correction.to_owned()];
            let values = every.boxes.len() as u64;
            let row = every_row(head, every.most(), values, &every.tallies[k], every.first[k]);
            table.row(row.into_iter().chain(every.at_ends[k].cells()));
        }
    }
    for one in &found.exact {
        let head = [one.name, "as it is"].map(str::to_owned);
        let row = every_row(head, one.most, one.values, &one.tally, one.first);
        table.row(row.into_iter().chain([const { Cell::Nothing }; 3]));
    }
    table
}

fn every_row(head: [String; 2], most: i64, values: u64, tally: &Tally, first: Option<i64>) -> Vec<Cell> {
    let rest = [
        (most as u64).into(),
        values.into(),
        tally.pairs.into(),
        tally.wrong.into(),
        percent(tally.wrong, tally.pairs).into(),
        first.map(|n| n as u64).into(),
        tally.worst_row.into(),
        tally.missed.into(),
        tally.doubled.into(),
        tally.none.into(),
    ];
    head.map(Cell::from).into_iter().chain(rest).collect()
}

/// The tables, where there is an adapter; and which it is, or why there is none.
fn kernels(quick: bool) -> Result<(Vec<Table>, Vec<String>), Failure> {
    let adapter = pbig_core::GpuFinder::new().map(|gpu| (gpu.adapter().to_owned(), gpu.is_software()));
    match (Bench::new(), adapter) {
        (Ok(bench), Ok((name, software))) => {
            let what =
                if software { ", software: its times would mean nothing and are left out" } else { "" };
            let estimates = kernels::estimates(&bench, software, quick)?;
            let ends = kernels::ends::looked_at(&bench, quick)?;
            let head = format!("As kernels on {name}{what}.");
            let notes =
                [head].into_iter().chain(kernels::notes(&estimates)).chain([kernels::ends::note(&ends)]);
            Ok((vec![kernels::table(&estimates), kernels::ends::table(&ends)], notes.collect()))
        }
        (Err(why), _) | (_, Err(why)) => Ok((vec![], vec![format!("Not run as kernels: {why}.")])),
    }
}

fn points(Found { every, exact, times, .. }: &Found) -> Vec<Point> {
    let Some(at) = times.iter().find(|times| times.n == 5000).or(times.first()) else { return vec![] };
    let of = |way: usize, fix: usize| {
        let name = every[way].way.name;
        let error = every[way].percent(fix);
        Point { series: format!("{name}, {}", CORRECTIONS[fix]), time: at.ways[way][fix], error }
    };
    let ways = (0..every.len()).flat_map(|way| (0..CORRECTIONS.len()).map(move |fix| (way, fix)));
    let exact = exact.iter().zip(at.exact).map(|(one, time)| Point {
        series: one.name.into(),
        time,
        error: percent(one.tally.wrong, one.tally.pairs),
    });
    ways.map(|(way, fix)| of(way, fix)).chain(exact).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_over_n_do_not_depend_on_how_they_are_split() {
        let way = WAYS.iter().find(|way| label(way) == "Carmack 1").expect("a way");
        let every = Every::of(way, true);
        let mut slow = [Tally::default(); 3];
        for n in boxes(true) {
            for (sum, tally) in slow.iter_mut().zip((way.tally)(n)) {
                *sum += tally;
            }
        }
        assert_eq!(every.tallies, slow);
        assert_eq!(every.boxes.len(), 250);
        let first = (2..).find(|&n| (way.tally)(n)[0].wrong > 0);
        assert_eq!(every.first[0], first);
    }

    #[test]
    fn a_wrong_pair_after_integers_is_a_failed_check() {
        let tells = |checked: Result<(), Failure>, of: &str| {
            checked.is_err_and(|failure| failure.to_string().contains(of))
        };
        let (mut every, mut exact) = (Every::of(&WAYS[0], true), exact::tallied(true));
        assert!(check(std::slice::from_ref(&every), &exact, &sizes::looked_at(true)).is_ok());
        every.first[2] = Some(7);
        assert!(tells(check(&[every], &exact, &[]), "7 boxes"));
        exact[0].first = Some(8);
        assert!(tells(check(&[], &exact, &[]), "8 boxes"));
        let large = sizes::Size::planted(1 << 20);
        assert!(tells(check(&[], &[], &[large]), "1048576 boxes"));
    }
}
