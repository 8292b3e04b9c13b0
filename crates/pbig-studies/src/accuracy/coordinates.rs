//! Coordinates in f32, in 16 bits and in codes: what a search's tests take, and what they let through.

use super::report;
use crate::precision::{Candidates, Code, Coordinates, Exact, Fixed, Found, Half};
use pbig_core::{Config, Finder, Limits};
use pbig_harness::bench::{Contest, Effort, medians};
use pbig_harness::boxes::BoxSet;
use pbig_harness::cells;
use pbig_harness::output::Failure;
use pbig_harness::report::Report;
use pbig_harness::runner::{Spread, milliseconds};
use pbig_harness::table::{Cell, Table};
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
pub(super) fn run(quick: bool) -> Result<Report, Failure> {
    let sizes: &[usize] = if quick { &[3000] } else { &[10_000, 100_000, 1_000_000] };
    let mut rows = Vec::new();
    for (boxes, set) in sizes.iter().flat_map(|&boxes| SETS.map(|set| (boxes, set))) {
        rows.extend(measure(set, boxes, quick)?);
    }
    let axes = ["time, ns per test with its exact test", "spurious candidates, % of the pairs"];
    // The largest sets alone: a point for each set.
    let largest = rows.iter().filter(|row| Some(&row.boxes) == sizes.last());
    let points = largest.map(|row| (row.kind.name.into(), row.ns_per_test(), row.spurious_percent()));
    let tables = vec![table(&rows), means(&rows)];
    let mut report = report("coordinates", tables, ("Coordinates in fewer bits", axes), points);
    // Sets have no order.
    report.charts[0].plots[0].is_joined = false;
    Ok(report)
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
    let mut table = Table::new("tests", columns);
    for row in rows {
        let (kind, found) = (row.kind, &row.found);
        let counts = cells![kind.bytes, found.tests, found.pairs, row.missed, row.spurious_percent()];
        let (bytes, both) = (row.bytes() as f64 / 1e6, row.test + row.recheck);
        let times = cells![bytes, row.encode, row.test, row.recheck, both];
        table.row([cells![row.set, row.boxes, kind.name], counts, times].concat());
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
    let columns =
        ["coordinates", "time_of_tests", "with_the_rounding", "bytes_read", "largest_spurious_percent"];
    let mut table = Table::new("means", columns);
    for (k, kind) in KINDS.iter().enumerate() {
        let mean = mean(rows, k);
        let values = [mean.time, mean.time_with_rounding, mean.bytes, mean.worst_spurious];
        table.row([Cell::from(kind.name)].into_iter().chain(values.map(Cell::from)));
    }
    table
}
