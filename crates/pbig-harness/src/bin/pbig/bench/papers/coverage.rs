//! PBIG's table III and figure 10, by the reading of DoC that fits: pairs, checks, times; and the cells.

use super::cells::{Alpha, config_for, expected_checks};
use super::density::fitting;
use super::device::{Device, about_bytes, on_gpu, written};
use super::printed::{
    Coverage, DENSEST_PLAIN_MB, DOC_MS, INPUT_MB, MOST_BOXES, SEGMENT, SPACE, TABLE_III, WARP,
};
use super::sheet::{Sheet, short};
use super::switches::count;
use super::{Once, Scale, UNSORTED, chart, effort, once};
use crate::bench::finders::Finders;
use crate::bench::papers::model::Model;
use crate::output::Failure;
use pbig_core::{Aabb, Coding, GpuOptions};
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

/// Whether the printed "128 x 128 x 128" are lengths of cells or numbers of them.
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
            "Our grid has one entry a box and makes none of these checks; PBIG's grid on the CPU is `Strategy::Pbig`, \
             plain, to compare counts. Its time is of one call that also allocates.",
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

/// Bytes of the output against equations 9 and 10, and ours.
pub(super) fn bytes(scale: &Scale, device: &Device) -> Result<Sheet, Failure> {
    let columns = [
        "DoC",
        "pairs printed",
        "output printed, MB",
        "bytes a pair, MB = 2^20",
        "bytes a pair, MB = 10^6",
        "pairs, ours",
        "bytes written a pair, ours, list",
        "the same, records",
        "bytes fetched a pair, ours, records",
    ];
    let n = count(scale, device);
    let mut sheet = Sheet::new("PBIG table III: bytes of output", &columns)
        .about(about_units())
        .about(about_equation_9());
    sheet = sheet.about(format!(
        "Ours: {n} boxes of the same law on a device, `Coding::Plain` and `Packed`, cells as its plan has them. {} {}",
        about_bytes(),
        device.about()
    ));
    for row in &TABLE_III {
        let a_pair = |unit: f64| row.output * unit / row.pairs as f64;
        let printed = json!([row.doc, row.pairs, row.output, a_pair(1_048_576.0), a_pair(1e6)]);
        sheet.row(joined(printed, our_bytes(row, n, device)?));
    }
    Ok(sheet)
}

/// Pairs of a row's boxes on a device, and bytes a pair of both codings; nothing without one.
fn our_bytes(row: &Coverage, n: usize, device: &Device) -> Result<Value, Failure> {
    let on = |coding| on_gpu(GpuOptions { coding, ..GpuOptions::DEFAULT });
    let boxes = fitting(n, row.doc).boxes(n, 1);
    let runs = device.run(&[on(Coding::Plain), on(Coding::Packed)], &boxes, 1.0)?;
    let [(_, plain), (_, packed)] = &runs[..] else { return Ok(json!([null, null, null, null])) };
    let a_pair = |bytes: Option<u64>| bytes.map(|bytes| bytes as f64 / plain.pairs.max(1) as f64);
    let fetched = packed.gpu.as_ref().map(|gpu| gpu.downloaded);
    Ok(json!([plain.pairs, a_pair(written(plain)), a_pair(written(packed)), a_pair(fetched)]))
}

/// What MB is.
fn about_units() -> String {
    let input = INPUT_MB * 1e6 / MOST_BOXES as f64;
    let densest = |unit: f64| DENSEST_PLAIN_MB * unit / TABLE_III[4].pairs as f64;
    let (binary, decimal) = (densest(1_048_576.0), densest(1e6));
    let both = (binary - 8.0).abs() < 0.01 && (decimal - 8.0).abs() > 0.1 && input == input.round();
    let so = if both { " So one row has both units." } else { "" };
    format!(
        "Input: {INPUT_MB} MB for 10^7 boxes is {input} bytes a box if MB is 10^6, {} words: six coordinates and an \
         id are seven. Output: {DENSEST_PLAIN_MB} MB uncompressed at DoC 10 is {} bytes for each of the printed pairs \
         if MB is 2^20, {} if 10^6; two ids are 8.{so}",
        input / 4.0,
        short(binary),
        short(decimal)
    )
}

/// Whether equation 9 can be what was measured.
fn about_equation_9() -> String {
    let (single, many) = (equation_9(1.0), equation_9(1e12));
    let a_pair = |row: &Coverage| row.output * 1_048_576.0 / row.pairs as f64;
    let [first, .., last] = &TABLE_III;
    let (sparse, dense) = (a_pair(first), a_pair(last));
    let so = if sparse < single && dense < many {
        "less than the former where nearly all rows are of one pair, and at the densest less than the limit: equation \
         9 does not describe the format that was measured"
    } else {
        "so equation 9 may describe the format that was measured"
    };
    format!(
        "By equation 9 with 32-bit ids and cells, 16-bit segments and {SEGMENT} boxes a segment a row of one pair \
         takes {} bytes, by equation 10 the limit for many is {} byte a pair. Printed are {} bytes a pair at DoC {} \
         and {} at DoC {}, {so}.",
        short(single),
        short(many),
        short(sparse),
        first.doc,
        short(dense),
        last.doc
    )
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
    fn what_is_said_of_the_printed_numbers_follows_from_them() {
        assert!(about_lengths().ends_with("they are lengths."), "{}", about_lengths());
        assert!(
            about_alpha().contains("in 3 of the 3 rows") && about_alpha().contains("did not use equation 5")
        );
        assert!(
            about_units().contains("8.000 bytes") && about_units().contains("both units"),
            "{}",
            about_units()
        );
        assert!(about_equation_9().contains("does not describe"), "{}", about_equation_9());
    }

    #[test]
    fn our_list_is_eight_bytes_a_pair_and_records_are_at_most_twelve() {
        let device = Device::best(true);
        for row in &TABLE_III[3..] {
            let ours = our_bytes(row, 2000, &device).expect("a device that works, or none");
            let (list, records) = (ours[1].as_f64(), ours[2].as_f64());
            assert!(
                list.is_none_or(|bytes| bytes == 8.0) && records.is_none_or(|bytes| bytes <= 12.0),
                "{ours}"
            );
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
