//! PBIG's table III and figure 10: the pairs, the checks and the output by DoC, "degree of coverage". Records are counted, not sent:
//! they take more bytes than a list but in crowds, and more time to decode than a bus saves.
//!
//! Equation 11 is the sum of the volumes of all boxes over that of the space. By it `n` equal cubes, and boxes whose lengths are
//! independent on each axis, have `4 n DoC` pairs: `n^2 / 2` times the chance `(2 e / L)^3`. The table has an eighth of that.

use super::model::{Model, Space};
use super::printed::{Coverage, MOST_BOXES, SPACE, TABLE_III, WARP};
use super::sides::{Setup, Way, effort, once, race};
use crate::UNSORTED;
use crate::pbig_grid::{CellRule, PbigPlan, record_words};
use pbig_core::Aabb;
use pbig_gpu::GpuOptions;
use pbig_gpu::pbig::Summary;
use pbig_harness::prelude::*;

pub(super) fn tables(setup: &Setup) -> Result<Vec<Table>, Failure> {
    Ok(vec![counted(setup)?])
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
    let both: f64 = (0..(length / cell).ceil().max(1.0) as u64).map(|i| touched(i as f64).powi(2)).sum();
    let n = n as f64;
    0.5 * n * (n - 1.0) * both.powi(3)
}

/// Returns equation 6 among the powers of two: the shortest cell with at least a warp of boxes. A box touches one cell more
/// along an axis than it has cell lengths.
fn equation_6(model: &Model, n: usize) -> Option<f64> {
    let alpha = |cell: f64| 1.0 + model.mean_length() / cell;
    let objective = |cell: f64| n as f64 * (alpha(cell) * cell / length(model)).powi(3);
    (0..14).map(|k| f64::from(1 << k)).find(|&cell| objective(cell) >= WARP)
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
    let by_rule = || equation_6(&fitting(MOST_BOXES, row.doc), MOST_BOXES);
    row.cell.or_else(by_rule).unwrap_or(1.0)
}

/// The table itself, counted. Our grid makes none of the checks; PBIG's time is of one call that also allocates.
fn counted(setup: &Setup) -> Result<Table, Failure> {
    let columns = "DoC | pairs printed (N = 10^7) | pairs | off what is expected, standard deviations | \
        checks printed (N = 10^7) | checks in such cells | of them unnecessary | of them redundant | ms printed | \
        ms, our grid, CPU | ms, PBIG's grid, CPU, one thread | output printed, MB | bytes a pair, MB = 2^20 | records, bytes a pair";
    let mut table = Table::new("PBIG table III and figure 10: density", columns);
    let n = setup.numbers.iter().copied().max().unwrap_or_default();
    let scale = (MOST_BOXES as f64 / n as f64).cbrt();
    for row in &TABLE_III {
        let model = fitting(n, row.doc);
        let boxes = model.draw(n, 1);
        let options = options_for(&boxes, scale * cell(row));
        let words = record_words(&boxes, &options);
        let pbig = once(Way::Pbig(options), &boxes)?;
        let ours = &race(&[Way::Finder(UNSORTED)], None, boxes, 1.0, effort(n))?[0];
        let (pairs, theirs) = (ours.report.pairs, pbig.report.pairs);
        check(pairs == theirs, || format!("DoC {}: {pairs} pairs, by PBIG's grid {theirs}", row.doc))?;
        let times = cells!["< 1000", ours.median, pbig.ms];
        let counts = cells![row.doc, row.pairs, pairs, model.off(n, pairs), row.checks];
        let printed = row.output * f64::from(1 << 20) / row.pairs as f64;
        let output = cells![row.output, printed, 4.0 * words as f64 / pairs as f64];
        table.row(cells![..counts, ..pbig.checks(), ..times, ..output]);
    }
    Ok(table)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_printed_counts_fit_lower_corners_and_lengths_rounded_up_alone() {
        // Standard deviations by which the worst of the printed counts is off what a reading expects.
        let furthest_off = |law: fn(f64) -> Model| {
            let off = TABLE_III.iter().map(|row| law(edge(MOST_BOXES, row.doc)).off(MOST_BOXES, row.pairs));
            off.map(f64::abs).fold(0.0, f64::max)
        };
        let mean = furthest_off(|e| Model::boxes(0.0, 2.0 * e));
        let largest = furthest_off(|e| Model::boxes(0.0, e));
        assert!(mean > 10.0 && largest > 10.0, "{mean} {largest}");
        assert!((1.0..3.0).contains(&furthest_off(|e| Model::boxes(0.0, e.ceil()))));
        assert!(furthest_off(by_lower_corner) < 1.0);
    }

    #[test]
    fn the_rule_gives_the_printed_cells_and_the_printed_checks() {
        for row in &TABLE_III {
            let model = fitting(MOST_BOXES, row.doc);
            let by_rule = equation_6(&model, MOST_BOXES);
            assert!(row.cell.is_none() || by_rule == row.cell, "DoC {}: {by_rule:?}", row.doc);
            let expected = expected_checks(&model, MOST_BOXES, cell(row));
            assert!((expected / row.checks as f64 - 1.0).abs() < 0.01, "DoC {}: {expected}", row.doc);
        }
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
