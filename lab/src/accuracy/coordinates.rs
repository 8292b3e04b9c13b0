//! Coordinates in f32, in 16 bits and in codes: what a search's tests take, and what they let through.

use super::{mean, report};
use crate::UNLIMITED;
use crate::precision::{Candidates, Code, Coordinates, Exact, Fixed, Found, Half};
use pbig_core::Finder;
use pbig_harness::prelude::*;
use std::time::Duration;

/// One kind of coordinates.
struct Format {
    name: &'static str,
    bytes: usize,
    is_exact: bool,
    find: fn(&Candidates, &mut Vec<[u32; 2]>) -> Found,
}

const fn kind<C: Coordinates>() -> Format {
    Format { name: C::NAME, bytes: size_of::<C>(), is_exact: C::EXACT, find: Candidates::find::<C> }
}

const KINDS: [Format; 5] =
    [kind::<Exact>(), kind::<Fixed<true>>(), kind::<Fixed<false>>(), kind::<Half>(), kind::<Code>()];

const SETS: [&str; 5] = ["uniform", "gaussian", "unit", "mixed", "pile"];

pub(super) fn run(quick: bool) -> Result<BenchReport, Failure> {
    let sizes: &[usize] = if quick { &[3000] } else { &[10_000, 100_000, 1_000_000] };
    let columns = "set | boxes | coordinates | bytes_per_box | tests | pairs | missed | spurious_percent | read_MB | round_ms | \
        test_ms | exact_test_ms | test_and_exact_test_ms";
    let mut table = Table::new("tests", columns);
    for (&boxes, set) in sizes.iter().flat_map(|boxes| SETS.map(|set| (boxes, set))) {
        measure(set, boxes, quick, &mut table)?;
    }
    let axes = ["time, ns per test with its exact test", "spurious candidates, % of the pairs"];
    // The largest sets alone: a point for each set.
    let largest = &table.rows[table.rows.len() - SETS.len() * KINDS.len()..];
    let number = |row: &[_], column| table.number(row, column).unwrap_or_default();
    let points = largest.iter().map(|row| {
        let ns = number(row, "test_and_exact_test_ms") * 1e6 / number(row, "tests").max(1.0);
        (row[2].as_str().unwrap_or_default().to_owned(), ns, number(row, "spurious_percent"))
    });
    let tables = vec![table.clone(), means(&table)];
    let mut report = report("coordinates", tables, ("Coordinates in fewer bits", axes), points);
    // Sets have no order.
    report.charts[0].plots[0].is_joined = false;
    Ok(report)
}

/// Appends the rows of all kinds on the same candidates, in turn.
fn measure(set: &str, n: usize, quick: bool, table: &mut Table) -> Result<(), Failure> {
    let boxes = BoxSet::named(set).expect("a set of the harness").boxes(n, 1);
    let candidates = Candidates::new(&boxes);
    let (rounds, ms) = if quick { (7, 250) } else { (31, 4000) };
    let effort = Effort { warm_up: 2, rounds, budget: Duration::from_millis(ms) };
    let (mut kept, mut found) = (vec![], [(); KINDS.len()].map(|()| Vec::<Found>::new()));
    measured(&mut found, KINDS.len(), effort, unprepared, |found, side| {
        let one = (KINDS[side].find)(&candidates, &mut kept);
        found[side].push(one);
        Ok(one.test + one.recheck)
    })?;
    // As pbig counts them, by another search.
    let mut finder = Finder::new(UNLIMITED);
    let pairs = finder.find(&boxes)?.len() as u64;
    for (kind, found) in KINDS.iter().zip(&found) {
        table.row(row(set, n, kind, found, pairs)?);
    }
    Ok(())
}

fn row(set: &str, n: usize, kind: &Format, found: &[Found], pairs: u64) -> Result<Vec<Value>, Failure> {
    let last = found.last().copied().unwrap_or_default();
    check(last.pairs == pairs, || format!("{set} {n}, {}: {} pairs of {pairs}", kind.name, last.pairs))?;
    let ms = |of: fn(&Found) -> f64| Spread::of(found.iter().map(of)).median;
    let (encode, test, recheck) = (ms(|f| f.encode), ms(|f| f.test), ms(|f| f.recheck));
    // Read by the tests, and by the exact tests of what they let through.
    let rechecked = if kind.is_exact { 0 } else { last.candidates };
    let bytes = last.tests * kind.bytes as u64 + rechecked * 48;
    let spurious = super::percent(last.candidates - last.pairs, last.pairs);
    let counts = [last.tests, last.pairs, pairs - last.pairs];
    let times = [encode, test, recheck, test + recheck];
    Ok(cells![set, n, kind.name, kind.bytes, ..counts, spurious, bytes as f64 / 1e6, ..times])
}

/// Returns geometric means over all sets of what a kind takes, relative to f32 on the same boxes.
fn means(tests: &Table) -> Table {
    let columns = "coordinates | time_of_tests | with_the_rounding | bytes_read | largest_spurious_percent";
    let mut table = Table::new("means", columns);
    let [time, rounding, bytes, spurious] =
        ["test_and_exact_test_ms", "round_ms", "read_MB", "spurious_percent"].map(|name| tests.numbers(name));
    let with_rounding: Vec<f64> =
        time.iter().zip(&rounding).map(|(time, rounding)| time + rounding).collect();
    for (k, kind) in KINDS.iter().enumerate() {
        let of = |values: &[f64]| {
            let logs = values.chunks(KINDS.len()).map(|set| (set[k] / set[0]).ln());
            mean(&logs.collect::<Vec<_>>()).exp()
        };
        let largest = spurious.chunks(KINDS.len()).map(|set| set[k]).fold(0.0, f64::max);
        table.row(cells![kind.name, of(&time), of(&with_rounding), of(&bytes), largest]);
    }
    table
}
