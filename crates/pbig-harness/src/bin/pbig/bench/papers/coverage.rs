//! PBIG's table III and figure 10, by the reading of DoC that fits: pairs, checks, times; and the cells.

use super::cells::{Alpha, config_for, expected_checks};
use super::density::fitting;
use super::printed::{Coverage, DOC_MS, INPUT_MB, MOST_BOXES, SEGMENT, TABLE_III, WARP};
use super::sheet::{Sheet, short};
use super::{Once, Scale, UNSORTED, chart, effort, once};
use crate::bench::finders::Finders;
use crate::bench::papers::model::Model;
use crate::output::Failure;
use pbig_core::Aabb;
use pbig_harness::boxes::moved;
use pbig_harness::chart::Line;
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
            "Cells of equation 6 with W = {WARP}, lengths restricted to powers of two (\"128 x 128 x 128\" and \"256 x 256 x 256\" of section 6.2 \
             are lengths, not numbers of cells: only so do the checks come out). Checks are n (n - 1) / 2 in each cell."
        ))
        .about(
            "With `alpha` as the cells that boxes do touch, the rule gives the printed cell in every row that has one, and the \
             checks of all five rows; with equation 5, which rounds the length in cells up and so forgets that a box lies across \
             borders, the cell of DoC 1 would be twice as long. So the program did not use equation 5 as it is printed.",
        );
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
            "N = {n} boxes, lower corners uniform in the paper's space, lengths uniform from 0 to the edge by equation 11 \
             rounded up. Cells: the length above, times the cube root of 10^7 / N. Figure 10 has no printed numbers; the text says \
             under {DOC_MS} ms for each."
        ))
        .about(
            "Our grid has one entry a box and makes none of these checks; PBIG's grid on the CPU is `Strategy::Pbig`, plain, to \
             compare counts. Its time is of one call that also allocates.",
        )
}

/// Pairs and milliseconds of our grid, and what PBIG's did in cells that hold as much as the row's.
fn search(row: &Coverage, boxes: Vec<Aabb>) -> Result<(u64, f64, Once), Failure> {
    let scale = (MOST_BOXES as f64 / boxes.len() as f64).cbrt();
    let cell = scale * cell(row, &fitting(MOST_BOXES, row.doc));
    let (pbig, effort) = (once(config_for(&boxes, cell), &boxes)?, effort(boxes.len()));
    let mut finders = Finders::new([UNSORTED], None, [moved(&boxes, 1.0, 2), boxes]);
    let (ms, pairs) = (finders.times(effort)?[0], finders.pairs()?);
    if pairs == pbig.pairs {
        return Ok((pairs, ms, pbig));
    }
    Err(Failure::Check(format!("DoC {}: {pairs} pairs, by PBIG's grid {}", row.doc, pbig.pairs)))
}

/// One row of both parts.
fn joined(first: Value, rest: Value) -> Value {
    [first, rest].into_iter().flat_map(|part| part.as_array().cloned().unwrap_or_default()).collect()
}

fn line(name: &str) -> Line {
    Line { name: name.into(), points: vec![] }
}

/// Bytes of the output against equations 9 and 10.
pub(super) fn bytes() -> Sheet {
    let columns =
        ["DoC", "pairs printed", "output printed, MB", "bytes a pair, MB = 2^20", "bytes a pair, MB = 10^6"];
    let input = INPUT_MB * 1e6 / MOST_BOXES as f64;
    let mut sheet = Sheet::new("PBIG table III: bytes of output", &columns)
        .about(format!(
            "Input: {INPUT_MB} MB for 10^7 boxes is {input} bytes a box if MB is 10^6, seven words: six coordinates and an id. Output: \
             {} MB uncompressed at DoC 10 is 8 bytes for each of the printed pairs only if MB is 2^20. So one row has both units.",
            super::printed::DENSEST_PLAIN_MB
        ))
        .about(format!(
            "By equation 9 with 32-bit ids and cells, 16-bit segments and {SEGMENT} boxes a segment a row of one pair takes {} bytes, by \
             equation 10 the limit for many is {} byte a pair. What is printed is below the former where nearly all rows are such \
             (DoC 0.001) and, at DoC 10, below the limit: equation 9 does not describe the format that was measured.",
            short(equation_9(1.0)),
            short(equation_9(1e12))
        ));
    for row in &TABLE_III {
        let a_pair = |unit: f64| row.output * unit / row.pairs as f64;
        sheet.row(json!([row.doc, row.pairs, row.output, a_pair(1_048_576.0), a_pair(1e6)]));
    }
    sheet
}

/// Bytes a pair of PBIG's equation 9, `k` pairs of a box with a segment.
fn equation_9(k: f64) -> f64 {
    let local = (SEGMENT as f64).log2().ceil();
    (32.0 + 2.0 * 16.0 + 2.0 * local + k * local) / (8.0 * k)
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
    fn equation_9_by_hand() {
        assert_eq!(equation_9(1.0), 11.0);
        assert!((equation_9(1e12) - 1.0).abs() < 1e-9);
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
