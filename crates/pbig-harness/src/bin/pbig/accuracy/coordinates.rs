//! Coordinates in f32, in 16 bits and in codes: what a search's tests take, and what they let through.

use super::study::{Cell, Point, Study, Table};
use crate::bench::measure::{Contest, Effort, medians};
use crate::output::Failure;
use pbig_core::{Config, Finder, Limits};
use pbig_harness::boxes::BoxSet;
use pbig_harness::precision::{Candidates, Code, Coordinates, Exact, Fixed, Found, Half};
use pbig_harness::runner::{Spread, milliseconds};
use std::time::Duration;

/// One kind of coordinates.
struct Kind {
    name: &'static str,
    bytes: usize,
    is_exact: bool,
    find: fn(&Candidates, &mut Vec<[u32; 2]>) -> Found,
}

const fn kind<C: Coordinates>() -> Kind {
    Kind { name: C::NAME, bytes: size_of::<C>(), is_exact: C::EXACT, find: Candidates::find::<C> }
}

const KINDS: [Kind; 5] =
    [kind::<Exact>(), kind::<Fixed<true>>(), kind::<Fixed<false>>(), kind::<Half>(), kind::<Code>()];

const SETS: [&str; 5] = ["uniform", "gaussian", "unit", "mixed", "pile"];

pub(super) fn run(quick: bool) -> Result<Study, Failure> {
    let sizes: &[usize] = if quick { &[3000] } else { &[10_000, 100_000, 1_000_000] };
    let mut rows = Vec::new();
    for &boxes in sizes {
        for set in SETS {
            rows.extend(measure(set, boxes, quick)?);
        }
    }
    let mut tables = vec![table(&rows)];
    tables.push(means(&rows));
    Ok(Study {
        name: "coordinates",
        title: "Coordinates in fewer bits",
        notes: notes(&rows),
        tables,
        time: "ns per test, tests and exact tests of what they let through",
        error: "spurious candidates, % of the pairs",
        points: rows.iter().map(point).collect(),
        // Sets have no order.
        joined: false,
    })
}

/// One kind on one set.
struct Row {
    set: &'static str,
    boxes: usize,
    kind: &'static Kind,
    found: Found,
    /// Pairs that the kind's tests ended; 0, or the run has failed.
    missed: u64,
    /// Milliseconds, medians.
    encode: f64,
    test: f64,
    recheck: f64,
}

impl Row {
    fn spurious_percent(&self) -> f64 {
        (self.found.candidates - self.found.pairs) as f64 / self.found.pairs.max(1) as f64 * 100.0
    }

    /// Read by the tests, and by the exact tests of what they let through.
    fn bytes(&self) -> u64 {
        let rechecked = if self.kind.is_exact { 0 } else { self.found.candidates };
        self.found.tests * self.kind.bytes as u64 + rechecked * 48
    }

    fn ns_per_test(&self) -> f64 {
        (self.test + self.recheck) * 1e6 / self.found.tests.max(1) as f64
    }
}

/// All kinds on the same candidates, in turn.
struct Sides {
    candidates: Candidates,
    kept: Vec<[u32; 2]>,
    found: [Vec<Found>; KINDS.len()],
}

impl Contest for Sides {
    fn sides(&self) -> usize {
        KINDS.len()
    }

    fn prepare(&mut self, _: usize) {}

    fn run(&mut self, side: usize) -> Result<f64, Failure> {
        let found = (KINDS[side].find)(&self.candidates, &mut self.kept);
        self.found[side].push(found);
        Ok(milliseconds(found.test + found.recheck))
    }
}

fn measure(set: &'static str, n: usize, quick: bool) -> Result<Vec<Row>, Failure> {
    let boxes = BoxSet::named(set).map(|set| set.boxes(n, 1)).unwrap_or_default();
    let candidates = Candidates::new(&boxes);
    let candidates = candidates.ok_or_else(|| Failure::Input(format!("{set}: a box is not finite")))?;
    let mut sides = Sides { candidates, kept: vec![], found: Default::default() };
    let effort = if quick { (7, 250) } else { (31, 4000) };
    let (rounds, budget) = (effort.0, Duration::from_millis(effort.1));
    medians(&mut sides, Effort { warm_up: 2, rounds, budget })?;
    let pairs = pairs(set, &boxes)?;
    KINDS.iter().zip(&sides.found).map(|(kind, found)| row(set, n, kind, found, pairs)).collect()
}

/// As pbig counts them, by another search.
fn pairs(set: &str, boxes: &[pbig_core::Aabb]) -> Result<u64, Failure> {
    let mut finder = Finder::new(Config { limits: Limits::UNLIMITED, ..Config::DEFAULT });
    let pairs = finder.find(boxes).map(|pairs| pairs.len() as u64);
    pairs.map_err(|error| Failure::Input(format!("{set} {}: {error}", boxes.len())))
}

fn row(
    set: &'static str,
    boxes: usize,
    kind: &'static Kind,
    found: &[Found],
    pairs: u64,
) -> Result<Row, Failure> {
    let median = |of: fn(&Found) -> Duration| Spread::of(found.iter().map(|f| milliseconds(of(f)))).median;
    let last = found.last().copied().unwrap_or_default();
    if last.pairs != pairs {
        let what = format!("{set} {boxes}, {}: {} pairs of {pairs}", kind.name, last.pairs);
        return Err(Failure::Check(what));
    }
    let (encode, test, recheck) = (median(|f| f.encode), median(|f| f.test), median(|f| f.recheck));
    let recheck = if kind.is_exact { 0.0 } else { recheck };
    Ok(Row { set, boxes, kind, found: last, missed: pairs - last.pairs, encode, test, recheck })
}

fn point(row: &Row) -> Point {
    Point { series: row.kind.name.into(), time: row.ns_per_test(), error: row.spurious_percent() }
}

fn table(rows: &[Row]) -> Table {
    let columns = [
        "set",
        "boxes",
        "coordinates",
        "bytes_per_box",
        "tests",
        "pairs",
        "missed",
        "spurious_percent",
        "read_MB",
        "round_ms",
        "test_ms",
        "exact_test_ms",
        "test_and_exact_test_ms",
    ];
    let mut table = Table::new("tests", "Tests of one search, on one thread", &columns);
    for row in rows {
        table.row([
            row.set.into(),
            row.boxes.into(),
            row.kind.name.into(),
            row.kind.bytes.into(),
            row.found.tests.into(),
            row.found.pairs.into(),
            row.missed.into(),
            row.spurious_percent().into(),
            (row.bytes() as f64 / 1e6).into(),
            row.encode.into(),
            row.test.into(),
            row.recheck.into(),
            Cell::from(row.test + row.recheck),
        ]);
    }
    table
}

/// Against f32 on the same boxes: geometric means.
struct Mean {
    time: f64,
    time_with_rounding: f64,
    bytes: f64,
    worst_spurious: f64,
}

fn mean(rows: &[Row], kind: usize) -> Mean {
    let (sets, count) = (rows.chunks(KINDS.len()), (rows.len() / KINDS.len()).max(1) as f64);
    let of = |ratio: fn(&Row) -> f64| {
        let logs = sets.clone().map(|set| (ratio(&set[kind]) / ratio(&set[0])).ln());
        (logs.sum::<f64>() / count).exp()
    };
    Mean {
        time: of(|row| row.test + row.recheck),
        time_with_rounding: of(|row| row.encode + row.test + row.recheck),
        bytes: of(|row| row.bytes() as f64),
        worst_spurious: sets.map(|set| set[kind].spurious_percent()).fold(0.0, f64::max),
    }
}

fn means(rows: &[Row]) -> Table {
    let title = "Over all sets, times those of f32 (geometric means)";
    let columns =
        ["coordinates", "time_of_tests", "with_the_rounding", "bytes_read", "largest_spurious_percent"];
    let mut table = Table::new("means", title, &columns);
    for (k, kind) in KINDS.iter().enumerate() {
        let mean = mean(rows, k);
        let values = [mean.time, mean.time_with_rounding, mean.bytes, mean.worst_spurious];
        table.row([Cell::from(kind.name)].into_iter().chain(values.map(Cell::from)));
    }
    table
}

fn notes(rows: &[Row]) -> Vec<String> {
    let times = |k: usize| (KINDS[k].name, mean(rows, k));
    let told = (1..KINDS.len()).map(times).map(|(name, mean)| {
        let Mean { time, time_with_rounding: rounded, bytes, worst_spurious } = mean;
        format!(
            "{name} {time:.2} times the time ({rounded:.2} with the rounding) and {bytes:.2} times the bytes, at most \
             {worst_spurious:.2}% spurious"
        )
    });
    vec![
        "One grid by lower corners, its cell the largest extent; each box is tested against those in the half \
         neighbourhood. Boxes are records in the order of cells, one test at a time, whatever the coordinates. \
         Spurious: let through and then ended by the exact test, as a share of the pairs."
            .to_owned(),
        "No kind misses a pair: a run in which the pairs differ from pbig's fails. What is stored of a minimum is \
         never above it and of a maximum never below (or all is rounded down by one monotone function, which \
         keeps their order): `tests/suite/precision.rs` holds each rule of that against 100,000 random cases, \
         every magnitude as likely, zeros, denormals and infinities among them, and against all 2^32 floats (tests that \
         are ignored, as they take minutes): for f16, and for fixed point and the code at four sizes and origins of cells."
            .to_owned(),
        format!("Against f32, on the CPU: {}.", told.collect::<Vec<_>>().join("; ")),
        verdict(rows),
    ]
}

/// Says if 16 bits are faster than the present codes with the exact test behind them.
fn verdict(rows: &[Row]) -> String {
    let best = (1..KINDS.len() - 1).min_by(|&a, &b| mean(rows, a).time.total_cmp(&mean(rows, b).time));
    let best = best.unwrap_or(1);
    let (ours, code) = (mean(rows, best).time, mean(rows, KINDS.len() - 1).time);
    let (name, ratio) = (KINDS[best].name, ours / code);
    let pays = if ratio < 0.95 {
        "a `Precision` to choose would pay"
    } else {
        "a `Precision` to choose would gain nothing"
    };
    format!(
        "On the CPU pbig already tests 64-bit codes, eight bytes a box, and f32 only for what they let through. \
         The fastest of 16 bits, {name}, takes {ratio:.2} times the time of codes: {pays} there."
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quick_study_has_every_kind_on_every_set_and_misses_nothing() {
        let study = run(true).expect("no failure");
        assert_eq!(study.tables[0].rows.len(), SETS.len() * KINDS.len());
        assert_eq!(study.points.len(), SETS.len() * KINDS.len());
        let exact = study.tables[0].rows.iter().filter(|row| row[2] == Cell::from("f32"));
        assert!(exact.into_iter().all(|row| row[7] == Cell::Number(0.0)));
    }

    #[test]
    fn a_missing_pair_is_a_failed_check() {
        let found = [Found { pairs: 4, candidates: 9, ..Found::default() }];
        let failed = row("unit", 10, &KINDS[1], &found, 5);
        assert!(failed.is_err_and(|failure| failure.to_string().contains("4 pairs of 5")));
        let found = row("unit", 10, &KINDS[1], &found, 4).expect("as many");
        assert_eq!(found.spurious_percent(), 125.0);
    }
}
