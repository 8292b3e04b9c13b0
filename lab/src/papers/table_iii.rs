//! PBIG's table III and figure 10: what DoC, "degree of coverage", can mean; the cells of the paper's rule; and what was counted.
//!
//! Equation 11 is the sum of the volumes of all boxes over that of the space. By it `n` equal cubes, and boxes whose lengths are
//! independent on each axis, have `4 n DoC` pairs: `n^2 / 2` times the chance `(2 e / L)^3`. The table has an eighth of that.

use super::model::{Model, Space, UNIFORM};
use super::printed::{Coverage, MOST_BOXES, SPACE, TABLE_III, WARP};
use super::sides::{SearchCall, Setup, Way, effort, once, race};
use crate::UNSORTED;
use crate::pbig_grid::{CellRule, PbigPlan};
use pbig_core::Aabb;
use pbig_gpu::pbig::Summary;
use pbig_gpu::{Coding, GpuOptions};
use pbig_harness::prelude::*;

pub(super) fn tables(setup: &Setup) -> Result<Vec<Table>, Failure> {
    Ok(vec![readings(), rule(), counted(setup)?, on_device(setup)?])
}

/// Returns the edge of `n` equal cubes in the paper's space that have this DoC by equation 11.
fn edge(n: usize, doc: f64) -> f64 {
    SPACE * (doc / n as f64).cbrt()
}

/// Returns the reading that fits: lower corners uniform in the space, lengths uniform from 0 to the edge by equation 11 rounded
/// up to a whole number. So DoC counts each box as if it were as large as it may be.
fn fitting(n: usize, doc: f64) -> Model {
    by_lower_corner(edge(n, doc))
}

fn by_lower_corner(edge: f64) -> Model {
    Model { has_corners: true, ..Model::boxes(0.0, edge.ceil()) }
}

/// One way to understand what the experiment draws: the law for an edge by equation 11.
type Reading = (&'static str, fn(f64) -> Model);

const READINGS: [Reading; 14] = [
    ("equal cubes by equation 11", |e| Model::cubes(e, e)),
    ("lengths uniform from 0, mean by equation 11", |e| Model::boxes(0.0, 2.0 * e)),
    ("lengths uniform from 1 (section 6.1), mean by equation 11", |e| Model::boxes(1.0, 2.0 * e - 1.0)),
    // The mean of e^3 is a quarter of the largest.
    ("cubes of random size from 0, volumes by equation 11", |e| Model::cubes(0.0, 4f64.cbrt() * e)),
    ("lengths 1 to 100 (section 6.1), the space by equation 11", |e| Model {
        space: Space::Even(SPACE * UNIFORM.mean_length() / e),
        ..UNIFORM
    }),
    ("the edge by equation 11 is a half extent", |e| Model::cubes(2.0 * e, 2.0 * e)),
    ("equation 11 with half extents for lengths", |e| Model::cubes(0.5 * e, 0.5 * e)),
    ("equation 11 with half extents for lengths, rounded up", |e| {
        Model::cubes(0.5 * e.ceil(), 0.5 * e.ceil())
    }),
    ("coordinates to both sides of 0: eight times the space", |e| Model {
        space: Space::Even(2.0 * SPACE),
        ..Model::boxes(0.0, 2.0 * e)
    }),
    ("lengths uniform from 1, the largest by equation 11", |e| Model::boxes(1.0, e)),
    ("lengths uniform from 1, the largest by equation 11 rounded up", |e| Model::boxes(1.0, e.ceil())),
    ("lengths uniform from 0, the largest by equation 11", |e| Model::boxes(0.0, e)),
    ("lengths uniform from 0, the largest by equation 11 rounded up", |e| Model::boxes(0.0, e.ceil())),
    (
        "lower corners uniform instead of centres, lengths uniform from 0, the largest by equation 11 rounded up",
        by_lower_corner,
    ),
];

/// Returns by how many standard deviations the worst of the printed counts is off what a reading expects.
fn furthest_off(law: fn(f64) -> Model) -> f64 {
    let off = TABLE_III.iter().map(|row| law(edge(MOST_BOXES, row.doc)).off(MOST_BOXES, row.pairs));
    off.max_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or(0.0)
}

/// Returns the expected pairs of every reading by calculation, the border of the space included.
fn readings() -> Table {
    let columns = "reading | pairs / (N DoC) at DoC 1 | DoC 0.001 | DoC 0.01 | DoC 0.1 | DoC 1 | DoC 10 | \
        furthest off, standard deviations";
    let mut table = Table::new("PBIG table III: what DoC can mean", columns);
    let mut row = |name: &str, pairs: [f64; 5], off: Option<f64>| {
        let counts = pairs.map(|pairs| pairs.round() as u64);
        table.row(cells![name, pairs[3] / MOST_BOXES as f64, ..counts, off]);
    };
    row("printed", TABLE_III.each_ref().map(|row| row.pairs as f64), None);
    for (name, law) in READINGS {
        let pairs = TABLE_III.each_ref().map(|row| law(edge(MOST_BOXES, row.doc)).pairs(MOST_BOXES));
        row(name, pairs, Some(furthest_off(law)));
    }
    table
}

/// Returns the number of cells along an axis of even boxes, of which the last may be cut off.
fn along(length: f64, cell: f64) -> f64 {
    (length / cell).ceil().max(1.0)
}

/// Returns the length of the space of a law whose boxes lie evenly; of another the width of four deviations.
fn length(model: &Model) -> f64 {
    match model.space {
        Space::Even(length) => length,
        Space::Normal([_, deviation]) => 4.0 * deviation,
    }
}

/// Returns the expected checks of `n` even boxes placed by their lower corners: two boxes are tested in each cell that
/// both touch. Axes are independent, so it is half of `n^2` times the third power of a sum over the cells of
/// one axis: a box touches the first if its corner lies there, the others also if it reaches there from
/// below, and what lies beyond the space counts as the last.
pub(super) fn expected_checks(model: &Model, n: usize, cell: f64) -> f64 {
    let (length, mean) = (length(model), model.mean_length());
    let touched = |i: f64| {
        let own = (length - i * cell).min(cell);
        let reach = if i > 0.0 { mean } else { 0.0 };
        ((own + reach) / length).min(1.0)
    };
    let both: f64 = (0..along(length, cell) as u64).map(|i| touched(i as f64).powi(2)).sum();
    let n = n as f64;
    0.5 * n * (n - 1.0) * both.powi(3)
}

/// `alpha`: the cells that a box touches along an axis on average; and the number of cells along the space.
type Alpha = (fn(&Model, f64) -> f64, fn(f64, f64) -> f64);

/// The cells that a box does touch, wherever it lies: one more than it has cell lengths.
const TOUCHED: Alpha = (|model, cell| 1.0 + model.mean_length() / cell, |length, cell| length / cell);

/// By equation 5: a box's length in cells, rounded up.
const EQUATION_5: Alpha = (mean_of_ceilings, along);

/// Returns the mean of `ceil(e / cell)` for lengths uniform between two.
fn mean_of_ceilings(model: &Model, cell: f64) -> f64 {
    // The integral of the ceiling from 0 to e.
    let whole = |e: f64| {
        let full = (e / cell).floor();
        cell * full * (full + 1.0) / 2.0 + (e - full * cell) * (full + 1.0)
    };
    let [low, high] = model.lengths;
    (whole(high) - whole(low)) / (high - low)
}

/// Returns `f` of equation 2.
fn objective((alpha, cells): Alpha, model: &Model, n: usize, cell: f64) -> f64 {
    n as f64 * (alpha(model, cell) / cells(length(model), cell)).powi(3)
}

/// Returns equation 6 among the powers of two: the shortest cell with at least a warp of boxes.
fn equation_6(alpha: Alpha, model: &Model, n: usize) -> Option<f64> {
    (0..14).map(|k| f64::from(1 << k)).find(|&cell| objective(alpha, model, n, cell) >= WARP)
}

/// Returns options with which PBIG's grid has cells as close to `cell` as its rule can be made to give.
pub(super) fn options_for(boxes: &[Aabb], cell: f64) -> GpuOptions {
    let summary = Summary::of(boxes);
    let with = |wanted: f64| GpuOptions { boxes_per_cell: wanted as f32, ..GpuOptions::DEFAULT };
    let (mut low, mut high) = (1.0, boxes.len().max(2) as f64);
    for _ in 0..40 {
        let middle: f64 = (low * high).sqrt();
        let given = f64::from(PbigPlan::new(&summary, &with(middle), CellRule::Objective).cell);
        if given < cell { low = middle } else { high = middle }
    }
    with(high)
}

/// Returns the cell length of a row: as printed, or by the paper's rule where it is not.
fn cell(row: &Coverage) -> f64 {
    let by_rule = || equation_6(TOUCHED, &fitting(MOST_BOXES, row.doc), MOST_BOXES);
    row.cell.or_else(by_rule).unwrap_or(1.0)
}

/// Returns cells of equation 6 among the powers of two, and their checks, n (n - 1) / 2 in each; also if the printed numbers
/// were numbers of cells along an axis, not lengths.
fn rule() -> Table {
    let columns = "DoC | cell printed | cell by equation 6, cells touched | f | cell by equation 6, equation 5 | \
        checks printed | checks expected | off, % | off if they are numbers of cells, %";
    let mut table = Table::new("PBIG table III: cells and checks by calculation", columns);
    for row in &TABLE_III {
        let (model, cell) = (fitting(MOST_BOXES, row.doc), cell(row));
        let expected = |cell: f64| expected_checks(&model, MOST_BOXES, cell);
        let off = |cell: f64| 100.0 * (expected(cell) / row.checks as f64 - 1.0);
        let by = |alpha| equation_6(alpha, &model, MOST_BOXES);
        let rule = cells![by(TOUCHED), objective(TOUCHED, &model, MOST_BOXES, cell), by(EQUATION_5)];
        let checks = [row.checks, expected(cell).round() as u64];
        let numbers = row.cell.map(|n| off(SPACE / n));
        table.row(cells![row.doc, row.cell, ..rule, ..checks, off(cell), numbers]);
    }
    table
}

/// The table itself, counted. Our grid makes none of the checks; PBIG's time is of one call that also allocates.
fn counted(setup: &Setup) -> Result<Table, Failure> {
    let columns = "DoC | pairs printed (N = 10^7) | pairs | off what is expected, standard deviations | \
        checks printed (N = 10^7) | checks in such cells | of them unnecessary | of them redundant | ms printed | \
        ms, our grid, CPU | ms, PBIG's grid, CPU, one thread";
    let mut table = Table::new("PBIG table III and figure 10: density", columns);
    let n = setup.numbers.iter().copied().max().unwrap_or_default();
    let scale = (MOST_BOXES as f64 / n as f64).cbrt();
    for row in &TABLE_III {
        let model = fitting(n, row.doc);
        let boxes = model.draw(n, 1);
        let pbig = once(Way::Pbig(options_for(&boxes, scale * cell(row))), &boxes)?;
        let ours = &race(&[Way::Finder(UNSORTED)], None, boxes, 1.0, effort(n))?[0];
        let (pairs, theirs) = (ours.report.pairs, pbig.report.pairs);
        check(pairs == theirs, || format!("DoC {}: {pairs} pairs, by PBIG's grid {theirs}", row.doc))?;
        let times = cells!["< 1000", ours.median, pbig.ms];
        let counts = cells![row.doc, row.pairs, pairs, model.off(n, pairs), row.checks];
        table.row(cells![..counts, ..pbig.checks(), ..times]);
    }
    Ok(table)
}

/// Counts, times and bytes of the output on a device: as a list and as records in cells as our plan has them, and as records in
/// cells as the paper's `W` gives them, by rows of segments.
fn on_device(setup: &Setup) -> Result<Table, Failure> {
    let columns = "DoC | output printed, MB | bytes a pair, MB = 2^20 | bytes a pair, MB = 10^6 | boxes | pairs, ours | \
        checks, our W | ms, our W, records | checks, the paper's W | ms, the paper's W, records | bytes written a pair, ours: list | \
        records | records, the paper's W, rows of segments | bytes fetched a pair, ours: records";
    let mut table = Table::new("PBIG table III and figure 10: density and bytes of output, GPU", columns);
    let n = if setup.quick || setup.is_software() { setup.on_device() } else { MOST_BOXES };
    let with = |coding| GpuOptions { coding, ..GpuOptions::DEFAULT };
    let rows = GpuOptions { boxes_per_cell: WARP as f32, small_cell: 1, ..with(Coding::Packed) };
    let ways = [with(Coding::Plain), with(Coding::Packed), rows].map(Way::Gpu);
    for row in &TABLE_III {
        let printed = |unit: f64| row.output * unit / row.pairs as f64;
        let printed = [row.output, printed(f64::from(1 << 20)), printed(1e6)];
        let calls = setup.run(&ways, &fitting(n, row.doc).draw(n, 1), 1.0)?;
        table.row(cells![row.doc, ..printed, n, ..of_output(&calls)]);
    }
    Ok(table)
}

fn of_output(calls: &[SearchCall]) -> Vec<Value> {
    let [list, packed, rows] = calls else { return vec![] };
    let pairs = list.report.pairs;
    let a_pair = |bytes: Option<u64>| bytes.filter(|_| pairs > 0).map(|bytes| bytes as f64 / pairs as f64);
    let [ours, papers] = [packed, rows].map(|call| cells![call.checks()[0], call.ms]);
    let written = [list, packed, rows].map(|call| a_pair(call.written()));
    cells![
        pairs,
        ..ours,
        ..papers,
        ..written,
        a_pair(packed.report.device.as_ref().map(|gpu| gpu.downloaded))
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_printed_counts_fit_lower_corners_alone() {
        let (others, fits) = READINGS.split_at(READINGS.len() - 2);
        assert!(others.iter().all(|(_, law)| furthest_off(*law).abs() > 10.0));
        assert!(furthest_off(fits[1].1).abs() < 1.0 && (1.0..3.0).contains(&furthest_off(fits[0].1).abs()));
    }

    #[test]
    fn the_rule_gives_the_printed_cells_and_the_printed_checks() {
        for row in &TABLE_III {
            let by_rule = equation_6(TOUCHED, &fitting(MOST_BOXES, row.doc), MOST_BOXES);
            assert!(row.cell.is_none() || by_rule == row.cell, "DoC {}: {by_rule:?}", row.doc);
            let expected = expected_checks(&fitting(MOST_BOXES, row.doc), MOST_BOXES, cell(row));
            assert!((expected / row.checks as f64 - 1.0).abs() < 0.01, "DoC {}: {expected}", row.doc);
        }
        // Lengths 0 to 10 in cells of 4: 1, 2 and 3 cells for 4, 4 and 2 of 10.
        assert!((mean_of_ceilings(&Model::boxes(0.0, 10.0), 4.0) - 1.8).abs() < 1e-12);
    }

    #[test]
    fn the_expected_checks_are_those_of_the_grid() {
        let model = Model { space: Space::Even(100.0), lengths: [0.0, 10.0], ..fitting(1000, 1.0) };
        let boxes = model.draw(20_000, 1);
        let call = once(Way::Pbig(options_for(&boxes, 10.0)), &boxes).expect("found");
        let given = f64::from(call.cell.expect("a cell"));
        assert!((given / 10.0 - 1.0).abs() < 0.06, "{given}");
        // The grid's border lies where the boxes end, not where the space does.
        let expected = expected_checks(&model, 20_000, given);
        let made = call.report.checks.made;
        assert!((made as f64 / expected - 1.0).abs() < 0.1, "{made} of {expected}");
    }
}
