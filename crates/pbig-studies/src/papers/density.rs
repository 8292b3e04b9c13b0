//! PBIG's table III and figure 10: the cells of the paper's rule, and what was counted.

use super::device::{Device, on_gpu, written};
use super::finders::Finders;
use super::model::{Edges, Model, Space};
use super::printed::{Coverage, MOST_BOXES, SPACE, TABLE_III, WARP};
use super::readings::{self, fitting};
use super::{Once, Scale, UNSORTED, effort, once};
use crate::study::{ALL_PAIRS_UP_TO, PbigCells, PbigSettings, SETTINGS, with_gpu_grid};
use pbig_core::{Aabb, Coding, GpuOptions};
use pbig_harness::boxes::moved;
use pbig_harness::cells;
use pbig_harness::output::Failure;
use pbig_harness::table::{Cell, Table};

pub(super) fn tables(scale: &Scale, device: &Device) -> Result<Vec<Table>, Failure> {
    let calculated = [readings::table(), readings::experiment(scale)?, rule()];
    let counted = [counted(scale)?, on_device(scale, device)?, bytes(scale, device)?];
    Ok(calculated.into_iter().chain(counted).collect())
}

/// Cells from 0 on along an axis of even boxes, of which the last may be cut off.
fn along(length: f64, cell: f64) -> f64 {
    (length / cell).ceil().max(1.0)
}

/// The length of the space of a law whose boxes lie evenly; of another the width of four deviations.
fn length(model: &Model) -> f64 {
    match model.space {
        Space::Even(length) => length,
        Space::Normal([_, deviation]) => 4.0 * deviation,
    }
}

/// Expected checks of `n` even boxes placed by their lower corners: two boxes are tested in each cell that
/// both touch. Axes are independent, so it is half of `n^2` times the third power of a sum over the cells of
/// one axis: a box touches the first if its corner lies there, the others also if it reaches there from
/// below, and what lies beyond the space counts as the last.
pub(super) fn expected_checks(model: &Model, n: usize, cell: f64) -> f64 {
    let (length, mean) = (length(model), model.edges.mean());
    let touched = |i: f64| {
        let own = (length - i * cell).min(cell);
        let reach = if i > 0.0 { mean } else { 0.0 };
        ((own + reach) / length).min(1.0)
    };
    let both: f64 = (0..along(length, cell) as u64).map(|i| touched(i as f64).powi(2)).sum();
    let n = n as f64;
    0.5 * n * (n - 1.0) * both.powi(3)
}

/// `alpha`, the cells that a box touches on average.
#[derive(Clone, Copy, Debug)]
enum Alpha {
    /// Those it does touch, wherever it lies: one more than it has cell lengths.
    Touched,
    /// Equation 5: its length in cells, rounded up.
    Equation5,
}

impl Alpha {
    /// `f` of equation 2.
    fn objective(self, model: &Model, n: usize, cell: f64) -> f64 {
        let (on_axis, cells) = match self {
            Self::Touched => (1.0 + model.edges.mean() / cell, length(model) / cell),
            Self::Equation5 => (mean_of_ceilings(&model.edges, cell), along(length(model), cell)),
        };
        n as f64 * on_axis.powi(3) / cells.powi(3)
    }

    /// Equation 6 among the powers of two: the shortest cell with at least a warp of boxes.
    fn cell(self, model: &Model, n: usize) -> Option<f64> {
        (0..14).map(|k| f64::from(1 << k)).find(|&cell| self.objective(model, n, cell) >= WARP)
    }
}

/// The mean of `ceil(e / cell)` for lengths uniform between two.
fn mean_of_ceilings(edges: &Edges, cell: f64) -> f64 {
    let whole = |e: f64| {
        let full = (e / cell).floor();
        // The integral of the ceiling from 0 to e.
        cell * full * (full + 1.0) / 2.0 + (e - full * cell) * (full + 1.0)
    };
    match edges.high - edges.low {
        0.0 => (edges.low / cell).ceil(),
        width => (whole(edges.high) - whole(edges.low)) / width,
    }
}

/// Returns settings with which PBIG's grid has cells as close to `cell` as its rule can be made to give.
pub(super) fn settings_for(boxes: &[Aabb], cell: f64) -> PbigSettings {
    let cells = PbigCells::new(boxes);
    let with = |wanted: f64| PbigSettings { boxes_per_cell: wanted as f32, ..SETTINGS };
    let (mut low, mut high) = (1.0, boxes.len().max(2) as f64);
    for _ in 0..40 {
        let middle: f64 = (low * high).sqrt();
        let given = f64::from(cells.length(&with(middle)));
        if given < cell { low = middle } else { high = middle }
    }
    with(high)
}

/// The cell length of a row: as printed, or by the paper's rule where it is not.
fn cell(row: &Coverage) -> f64 {
    let by_rule = || Alpha::Touched.cell(&fitting(MOST_BOXES, row.doc), MOST_BOXES);
    row.cell.or_else(by_rule).unwrap_or(1.0)
}

/// Cells of equation 6 among the powers of two, and their checks, n (n - 1) / 2 in each; also if the printed numbers were
/// numbers of cells along an axis, not lengths.
fn rule() -> Table {
    let columns = [
        "DoC",
        "cell printed",
        "cell by equation 6, cells touched",
        "f",
        "cell by equation 6, equation 5",
        "checks printed",
        "checks expected",
        "off, %",
        "off if they are numbers of cells, %",
    ];
    let mut table = Table::new("PBIG table III: cells and checks by calculation", columns);
    for row in &TABLE_III {
        let (model, cell) = (fitting(MOST_BOXES, row.doc), cell(row));
        let expected = |cell: f64| expected_checks(&model, MOST_BOXES, cell);
        let off = |cell: f64| 100.0 * (expected(cell) / row.checks as f64 - 1.0);
        let touched = Alpha::Touched;
        let rule = cells![touched.cell(&model, MOST_BOXES), touched.objective(&model, MOST_BOXES, cell)];
        let by_equation_5 = Alpha::Equation5.cell(&model, MOST_BOXES);
        let checks =
            cells![row.checks, expected(cell).round() as u64, off(cell), row.cell.map(|n| off(SPACE / n))];
        table.row([cells![row.doc, row.cell], rule, cells![by_equation_5], checks].concat());
    }
    table
}

/// The table itself, counted. Our grid makes none of the checks; PBIG's time is of one call that also allocates.
fn counted(scale: &Scale) -> Result<Table, Failure> {
    let (n, mut table) = (scale.most_boxes, Table::new("PBIG table III and figure 10: density", COUNTED));
    for row in &TABLE_III {
        let model = fitting(n, row.doc);
        let (pairs, ms, pbig) = search(row, model.boxes(n, 1))?;
        let checks = pbig.checks;
        let counts = cells![row.doc, row.pairs, pairs, model.off(n, pairs), row.checks, checks.made];
        table.row([counts, cells![checks.unnecessary, checks.redundant, "< 1000", ms, pbig.ms]].concat());
    }
    Ok(table)
}

const COUNTED: [&str; 11] = [
    "DoC",
    "pairs printed (N = 10^7)",
    "pairs",
    "off what is expected, standard deviations",
    "checks printed (N = 10^7)",
    "checks in such cells",
    "of them unnecessary",
    "of them redundant",
    "ms printed",
    "ms, our grid, CPU",
    "ms, PBIG's grid, CPU, one thread",
];

/// Pairs and milliseconds of our grid, and what PBIG's did in cells that hold as much as the row's.
fn search(row: &Coverage, boxes: Vec<Aabb>) -> Result<(u64, f64, Once), Failure> {
    let scale = (MOST_BOXES as f64 / boxes.len() as f64).cbrt();
    let (pbig, effort) = (once(settings_for(&boxes, scale * cell(row)), &boxes)?, effort(boxes.len()));
    let mut finders = Finders::new([UNSORTED], None, [moved(&boxes, 1.0, 2), boxes]);
    let (ms, pairs) = (finders.times(effort)?[0], finders.pairs()?);
    if pairs == pbig.pairs {
        return Ok((pairs, ms, pbig));
    }
    Err(Failure::Check(format!("DoC {}: {pairs} pairs, by PBIG's grid {}", row.doc, pbig.pairs)))
}

/// The same on a device, with cells as our plan has them and as the paper's `W` gives them.
fn on_device(scale: &Scale, device: &Device) -> Result<Table, Failure> {
    let n = if device.is_software() { scale.on_device(device) } else { scale.most_boxes };
    let columns = [
        "DoC",
        "boxes",
        "pairs",
        "checks, our W",
        "ms, our W",
        "checks, the paper's W",
        "ms, the paper's W",
        "ms printed",
    ];
    let mut table = Table::new("PBIG table III and figure 10: density, GPU", columns);
    for row in &TABLE_III {
        let boxes = fitting(n, row.doc).boxes(n, 1);
        let pairs = once(UNSORTED, &boxes)?.pairs;
        let at = |wanted: f32| {
            let settings = PbigSettings { boxes_per_cell: wanted, ..SETTINGS };
            device.run_for(
                with_gpu_grid(on_gpu(GpuOptions::DEFAULT), &settings, ALL_PAIRS_UP_TO),
                &boxes,
                1.0,
                pairs,
            )
        };
        if let [Some((ms, ours)), Some((paper_ms, paper))] = [at(SETTINGS.boxes_per_cell)?, at(WARP as f32)?]
        {
            let [ours, paper] = [ours, paper].map(|report| report.checks.made);
            table.row(cells![row.doc, n, pairs, ours, ms, paper, paper_ms, "< 1000"]);
        }
    }
    Ok(table)
}

/// Bytes of the output, printed and ours: as a list, as records, and as records in the paper's cells by rows of segments.
fn bytes(scale: &Scale, device: &Device) -> Result<Table, Failure> {
    let columns = [
        "DoC",
        "pairs printed",
        "output printed, MB",
        "bytes a pair, MB = 2^20",
        "bytes a pair, MB = 10^6",
        "pairs, ours",
        "bytes written a pair, ours: list",
        "records",
        "records, the paper's W, rows of segments",
        "bytes fetched a pair, ours: records",
    ];
    let (n, mut table) = (scale.on_device(device), Table::new("PBIG table III: bytes of output", columns));
    let on = |coding| on_gpu(GpuOptions { coding, ..GpuOptions::DEFAULT });
    let in_rows = PbigSettings { boxes_per_cell: WARP as f32, small_cell: 1, ..SETTINGS };
    let rows = with_gpu_grid(on(Coding::Packed), &in_rows, ALL_PAIRS_UP_TO);
    for row in &TABLE_III {
        let a_pair = |unit: f64| row.output * unit / row.pairs as f64;
        let printed = cells![row.doc, row.pairs, row.output, a_pair(f64::from(1 << 20)), a_pair(1e6)];
        let boxes = fitting(n, row.doc).boxes(n, 1);
        let runs = device.run(&[on(Coding::Plain), on(Coding::Packed), rows], &boxes, 1.0)?;
        let ours = match &runs[..] {
            [(_, plain), (_, packed), (_, rows)] => {
                let fetched = packed.gpu.as_ref().map(|gpu| gpu.downloaded).filter(|_| packed.pairs > 0);
                let bytes = [written(plain), written(packed), written(rows), fetched];
                let bytes =
                    bytes.map(|bytes| Cell::from(bytes.map(|bytes| bytes as f64 / plain.pairs as f64)));
                [cells![plain.pairs], bytes.into()].concat()
            }
            _ => vec![Cell::Nothing; 5],
        };
        table.row([printed, ours].concat());
    }
    Ok(table)
}

#[cfg(test)]
mod tests {
    use super::super::model::Place;
    use super::super::readings::even;
    use super::*;

    #[test]
    fn the_rule_gives_the_printed_cells_and_the_printed_checks() {
        for row in &TABLE_III {
            let by_rule = Alpha::Touched.cell(&fitting(MOST_BOXES, row.doc), MOST_BOXES);
            assert!(row.cell.is_none() || by_rule == row.cell, "DoC {}: {by_rule:?}", row.doc);
            let expected = expected_checks(&fitting(MOST_BOXES, row.doc), MOST_BOXES, cell(row));
            assert!((expected / row.checks as f64 - 1.0).abs() < 0.01, "DoC {}: {expected}", row.doc);
        }
        // Lengths 0 to 10 in cells of 4: 1, 2 and 3 cells for 4, 4 and 2 of 10.
        assert!((mean_of_ceilings(&Edges::boxes(0.0, 10.0), 4.0) - 1.8).abs() < 1e-12);
    }

    /// Tests in each cell, counted box by box.
    fn counted(boxes: &[Aabb], length: f64, cell: f64) -> u64 {
        let last = along(length, cell) - 1.0;
        let index = |x: f32| (f64::from(x) / cell).floor().min(last) as usize;
        let mut cells = std::collections::HashMap::<[usize; 3], u64>::new();
        for b in boxes {
            let [xs, ys, zs] = [0, 1, 2].map(|k| index(b.min[k])..=index(b.max[k]));
            for (x, y) in xs.flat_map(|x| ys.clone().map(move |y| (x, y))) {
                zs.clone().for_each(|z| *cells.entry([x, y, z]).or_default() += 1);
            }
        }
        cells.values().map(|n| n * (n - 1) / 2).sum()
    }

    #[test]
    fn the_expected_checks_are_those_of_boxes_put_into_cells_of_the_wanted_length() {
        let model = Model { space: Space::Even(100.0), ..even(Place::LowerCorner, Edges::boxes(0.0, 10.0)) };
        for cell in [12.0, 33.0] {
            let counts = (0..4).map(|seed| counted(&model.boxes(3000, seed), 100.0, cell));
            let (mean, expected) = (counts.sum::<u64>() as f64 / 4.0, expected_checks(&model, 3000, cell));
            assert!((mean / expected - 1.0).abs() < 0.02, "cells of {cell}: {mean}, {expected} expected");
        }
        let boxes = model.boxes(20_000, 1);
        let given = f64::from(PbigCells::new(&boxes).length(&settings_for(&boxes, 10.0)));
        assert!((given / 10.0 - 1.0).abs() < 0.06, "{given}");
    }
}
