//! PBIG's table III and figure 10, by the reading of DoC that fits: pairs, checks, times; and the cells.

use super::cells::{Alpha, expected_checks, settings_for};
use super::density::fitting;
use super::device::{Device, on_gpu};
use super::printed::{Coverage, DOC_MS, MOST_BOXES, SPACE, TABLE_III, WARP};
use super::sheet::{Sheet, short};
use super::switches::count;
use super::{Once, Scale, UNSORTED, chart, effort, once};
use crate::bench::finders::Finders;
use crate::bench::papers::model::Model;
use crate::output::Failure;
use pbig_core::{Aabb, GpuOptions};
use pbig_harness::boxes::moved;
use pbig_harness::chart::Line;
use pbig_harness::study::{ALL_PAIRS_UP_TO, PbigSettings, SETTINGS, with_gpu_grid};
use serde_json::{Value, json};

/// The cell length of a row: as printed, or by the paper's rule where it is not.
fn cell(row: &Coverage, model: &Model) -> f64 {
    row.cell.or_else(|| Alpha::Touched.cell(model, MOST_BOXES)).unwrap_or(1.0)
}

/// Which cells the rule gives, and what they cost, against what is printed.
pub(super) fn rule() -> Sheet {
    let columns = [
        "DoC",
        "cell printed",
        "cell by equation 6, cells touched",
        "f",
        "cell by equation 6, equation 5",
        "checks printed",
        "checks expected",
        "off, %",
    ];
    let mut sheet = Sheet::new("PBIG table III: cells and checks by calculation", &columns)
        .about(format!(
            "Cells of equation 6 with W = {WARP}, lengths restricted to powers of two; \"128 x 128 x 128\" and \"256 \
             x 256 x 256\" of section 6.2 are taken as lengths. Checks are n (n - 1) / 2 in each cell."
        ))
        .about(about_lengths())
        .about(about_alpha());
    for row in &TABLE_III {
        let model = fitting(MOST_BOXES, row.doc);
        let cell = cell(row, &model);
        let expected = expected_checks(&model, MOST_BOXES, cell);
        sheet.row(json!([
            row.doc,
            row.cell,
            Alpha::Touched.cell(&model, MOST_BOXES),
            Alpha::Touched.objective(&model, MOST_BOXES, cell),
            Alpha::Equation5.cell(&model, MOST_BOXES),
            row.checks,
            expected.round() as u64,
            100.0 * (expected / row.checks as f64 - 1.0),
        ]));
    }
    sheet
}

/// By how many per cent the expected checks of a row are off the printed ones, in cells of a length.
fn off_checks(row: &Coverage, cell: f64) -> f64 {
    let expected = expected_checks(&fitting(MOST_BOXES, row.doc), MOST_BOXES, cell);
    100.0 * (expected / row.checks as f64 - 1.0)
}

fn furthest(off: impl Iterator<Item = f64>) -> f64 {
    off.map(f64::abs).fold(0.0, f64::max)
}

/// Checks off by no more than this, in per cent, are the printed ones.
const CLOSE: f64 = 1.0;

/// Says if the printed "128 x 128 x 128" are lengths of cells or numbers of them.
fn about_lengths() -> String {
    let printed = || TABLE_III.iter().filter_map(|row| Some((row, row.cell?)));
    let as_length = furthest(printed().map(|(row, cell)| off_checks(row, cell)));
    let as_number = furthest(printed().map(|(row, number)| off_checks(row, SPACE / number)));
    let so = match (as_length < CLOSE, as_number < CLOSE) {
        (true, false) => "they are lengths",
        (false, true) => "they are numbers of cells",
        _ => "the checks do not tell which they are",
    };
    format!(
        "The checks of the rows that have them are off by {} % at most if they are lengths, by {} % if they are \
         numbers of cells along an axis: {so}.",
        short(as_length),
        short(as_number)
    )
}

/// Which `alpha` gives what is printed.
fn about_alpha() -> String {
    let printed = TABLE_III.iter().filter(|row| row.cell.is_some());
    let given = |alpha: Alpha| {
        printed
            .clone()
            .filter(|row| alpha.cell(&fitting(MOST_BOXES, row.doc), MOST_BOXES) == row.cell)
            .count()
    };
    let (touched, equation_5, all) =
        (given(Alpha::Touched), given(Alpha::Equation5), printed.clone().count());
    let off = furthest(TABLE_III.iter().map(|row| off_checks(row, cell(row, &fitting(MOST_BOXES, row.doc)))));
    let so = match (touched == all, equation_5 == all) {
        (true, false) => "So the program did not use equation 5 as it is printed.",
        (_, true) => "So the program can have used equation 5.",
        _ => "So neither is what the program used.",
    };
    format!(
        "With `alpha` as the cells that boxes do touch, the rule gives the printed cell in {touched} of the {all} \
         rows that have one, and the checks of all rows are off by {} % at most; with equation 5, which rounds the \
         length in cells up and so forgets that a box lies across borders, it gives {equation_5} of the {all}. {so}",
        short(off)
    )
}

/// The table itself, counted.
pub(super) fn table(scale: &Scale) -> Result<Sheet, Failure> {
    let n = scale.most_boxes;
    let mut sheet = empty_table(n);
    let mut lines = [line("our grid, CPU"), line("PBIG's grid, CPU, one thread")];
    for row in &TABLE_III {
        let model = fitting(n, row.doc);
        let (pairs, ms, pbig) = search(row, model.boxes(n, 1))?;
        lines.iter_mut().zip([ms, pbig.ms]).for_each(|(line, ms)| line.points.push((row.doc, ms)));
        let (off, checks) = (model.off(n, pairs), pbig.checks);
        let counts = json!([row.doc, row.pairs, pairs, off, row.checks, checks.made, checks.unnecessary]);
        sheet.row(joined(counts, json!([checks.redundant, format!("< {DOC_MS}"), ms, pbig.ms])));
    }
    Ok(sheet.chart(chart("density", "PBIG figure 10: density", "DoC", lines)))
}

fn empty_table(n: usize) -> Sheet {
    let columns = [
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
    Sheet::new("PBIG table III and figure 10: density", &columns)
        .about(format!(
            "N = {n} boxes, lower corners uniform in the paper's space, lengths uniform from 0 to the edge by \
             equation 11 rounded up. Cells: the length above, times the cube root of 10^7 / N. Figure 10 has no \
             printed numbers; the text says under {DOC_MS} ms for each."
        ))
        .about(
            "Our grid has one entry a box and makes none of these checks; PBIG's grid on the CPU is plain, to \
             compare counts. Its time is of one call that also allocates.",
        )
}

/// Pairs and milliseconds of our grid, and what PBIG's did in cells that hold as much as the row's.
fn search(row: &Coverage, boxes: Vec<Aabb>) -> Result<(u64, f64, Once), Failure> {
    let scale = (MOST_BOXES as f64 / boxes.len() as f64).cbrt();
    let cell = scale * cell(row, &fitting(MOST_BOXES, row.doc));
    let (pbig, effort) = (once(settings_for(&boxes, cell), &boxes)?, effort(boxes.len()));
    let mut finders = Finders::new([UNSORTED], None, [moved(&boxes, 1.0, 2), boxes]);
    let (ms, pairs) = (finders.times(effort)?[0], finders.pairs()?);
    if pairs == pbig.pairs {
        return Ok((pairs, ms, pbig));
    }
    Err(Failure::Check(format!("DoC {}: {pairs} pairs, by PBIG's grid {}", row.doc, pbig.pairs)))
}

/// One row of both parts.
pub(super) fn joined(first: Value, rest: Value) -> Value {
    [first, rest].into_iter().flat_map(|part| part.as_array().cloned().unwrap_or_default()).collect()
}

fn line(name: &str) -> Line {
    Line { name: name.into(), points: vec![] }
}

/// The same on a device, with cells as our plan has them and as the paper's `W` gives them.
pub(super) fn on_device(scale: &Scale, device: &Device) -> Result<Sheet, Failure> {
    let n = if device.is_software() { count(scale, device) } else { scale.most_boxes };
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
    let mut sheet = Sheet::new("PBIG table III and figure 10: density, GPU", &columns).about(format!(
        "The same law; W is the wanted boxes of a cell, {} in our plan and {WARP} in the paper. Pairs are as many as \
         on the CPU. Printed: 10^7 boxes. {}",
        SETTINGS.boxes_per_cell,
        device.about()
    ));
    for row in &TABLE_III {
        let boxes = fitting(n, row.doc).boxes(n, 1);
        let pairs = once(UNSORTED, &boxes)?.pairs;
        let at = |wanted: f32| {
            let settings = PbigSettings { boxes_per_cell: wanted, ..SETTINGS };
            let config = with_gpu_grid(on_gpu(GpuOptions::DEFAULT), &settings, ALL_PAIRS_UP_TO);
            device.run_for(config, &boxes, 1.0, pairs)
        };
        if let [Some((ms, ours)), Some((paper_ms, paper))] = [at(SETTINGS.boxes_per_cell)?, at(WARP as f32)?]
        {
            let made = [&ours, &paper].map(|report| report.checks.made);
            sheet.row(json!([row.doc, n, pairs, made[0], ms, made[1], paper_ms, format!("< {DOC_MS}")]));
        }
    }
    Ok(sheet)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rule_gives_the_printed_cells_and_the_printed_checks() {
        for row in &TABLE_III {
            let model = fitting(MOST_BOXES, row.doc);
            let by_rule = Alpha::Touched.cell(&model, MOST_BOXES);
            assert!(row.cell.is_none() || by_rule == row.cell, "DoC {}: {by_rule:?}", row.doc);
            let expected = expected_checks(&model, MOST_BOXES, cell(row, &model));
            assert!((expected / row.checks as f64 - 1.0).abs() < 0.01, "DoC {}: {expected}", row.doc);
        }
    }

    #[test]
    fn what_is_said_of_the_printed_numbers_follows_from_them() {
        assert!(about_lengths().ends_with("they are lengths."), "{}", about_lengths());
        assert!(
            about_alpha().contains("in 3 of the 3 rows") && about_alpha().contains("did not use equation 5")
        );
    }

    #[test]
    fn a_small_table_has_the_pairs_of_brute_force() {
        let scale = Scale { most_boxes: 2000, ..Scale::new(true) };
        let text = table(&scale).expect("counts agree").object();
        for (row, printed) in text["rows"].as_array().expect("rows").iter().zip(&TABLE_III) {
            let boxes = fitting(2000, printed.doc).boxes(2000, 1);
            assert_eq!(row["pairs"], pbig_core::oracle::pairs(&boxes).len(), "DoC {}", printed.doc);
        }
    }
}
