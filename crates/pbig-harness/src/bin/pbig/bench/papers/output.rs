//! PBIG's table III: bytes of output, against equations 9 and 10, and ours.

use super::Scale;
use super::coverage::joined;
use super::density::fitting;
use super::device::{Device, about_bytes, on_gpu, written};
use super::printed::{Coverage, DENSEST_PLAIN_MB, INPUT_MB, MOST_BOXES, SEGMENT, TABLE_III, WARP};
use super::sheet::{Sheet, short};
use super::switches::count;
use crate::output::Failure;
use pbig_core::{Coding, GpuOptions};
use pbig_harness::study::{ALL_PAIRS_UP_TO, PbigSettings, SETTINGS, with_gpu_grid};
use serde_json::{Value, json};

/// The paper's MB in bytes, where it is not 10^6.
const MEBI: f64 = 1_048_576.0;

/// Bytes of the output against equations 9 and 10, and ours.
pub(super) fn bytes(scale: &Scale, device: &Device) -> Result<Sheet, Failure> {
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
    let n = count(scale, device);
    let mut sheet = Sheet::new("PBIG table III: bytes of output", &columns)
        .about(about_units())
        .about(about_equation_9());
    sheet = sheet.about(format!(
        "Ours: {n} boxes of the same law on a device, `Coding::Plain` and `Packed`, cells as its plan has them (W = {}); \
         then `Packed` with the paper's W and all cells by rows of segments (`small_cell` 1). {} {}",
        SETTINGS.boxes_per_cell,
        about_bytes(),
        device.about()
    ));
    let mut all = vec![];
    for row in &TABLE_III {
        let a_pair = |unit: f64| row.output * unit / row.pairs as f64;
        let printed = json!([row.doc, row.pairs, row.output, a_pair(MEBI), a_pair(1e6)]);
        let ours = Ours::new(row, n, device)?;
        sheet.row(joined(printed, ours.as_ref().map_or(json!([null, null, null, null, null]), Ours::fields)));
        all.extend(ours);
    }
    Ok(match &all[..] {
        [first, .., last] => sheet.about(about_ours(first, last)),
        _ => sheet,
    })
}

/// Bytes a pair on a device.
struct Ours {
    pairs: u64,
    list: f64,
    records: f64,
    /// In the paper's cells, all by rows of segments.
    rows: f64,
    fetched: f64,
}

impl Ours {
    /// Of a row's boxes; nothing without a device, or without pairs.
    fn new(row: &Coverage, n: usize, device: &Device) -> Result<Option<Self>, Failure> {
        let on = |coding| on_gpu(GpuOptions { coding, ..GpuOptions::DEFAULT });
        let in_rows = PbigSettings { boxes_per_cell: WARP as f32, small_cell: 1, ..SETTINGS };
        let rows = with_gpu_grid(on(Coding::Packed), &in_rows, ALL_PAIRS_UP_TO);
        let boxes = fitting(n, row.doc).boxes(n, 1);
        let runs = device.run(&[on(Coding::Plain), on(Coding::Packed), rows], &boxes, 1.0)?;
        let [(_, plain), (_, packed), (_, rows)] = &runs[..] else { return Ok(None) };
        let bytes =
            [written(plain), written(packed), written(rows), packed.gpu.as_ref().map(|gpu| gpu.downloaded)];
        let [Some(list), Some(records), Some(rows), Some(fetched)] =
            bytes.map(|bytes| bytes.map(|bytes| bytes as f64 / plain.pairs as f64))
        else {
            return Ok(None);
        };
        Ok(Some(Self { pairs: plain.pairs, list, records, rows, fetched }))
    }

    fn fields(&self) -> Value {
        json!([self.pairs, self.list, self.records, self.rows, self.fetched])
    }
}

/// Bytes of a record's header, of a row with one partner, and of a record of one plain pair (PAIR_FORMAT.md).
const HEADER: f64 = 12.0;
const ROW: f64 = 4.0;
const ALONE: f64 = 12.0;

/// Explains why ours are longer than printed.
fn about_ours(sparse: &Ours, dense: &Ours) -> String {
    let [first, .., last] = &TABLE_III;
    let printed = |row: &Coverage| row.output * MEBI / row.pairs as f64;
    let headers = dense.records - ROW;
    let why = if headers > 0.0 {
        format!(
            "most cells of W = {} have at most {} boxes, and there each pair is a row of its own, {ROW} bytes (place, \
             number of partners, partner, padding); the other {} are headers of {HEADER} bytes, one for {} pairs",
            SETTINGS.boxes_per_cell,
            SETTINGS.small_cell,
            short(headers),
            short(HEADER / headers)
        )
    } else {
        "pairs share rows".to_owned()
    };
    format!(
        "At DoC {} ours are {} bytes a pair, {} times the printed: {why}. In the paper's cells a row has all partners \
         of a box in a segment: {} bytes a pair, {} times the printed, and no format that names a partner by a byte \
         has less than 1. At DoC {} a pair is alone in its workgroup and becomes a record of plain pairs, {ALONE} \
         bytes (measured: {}); printed are {}, though two ids alone are 8.",
        last.doc,
        short(dense.records),
        short(dense.records / printed(last)),
        short(dense.rows),
        short(dense.rows / printed(last)),
        first.doc,
        short(sparse.records),
        short(printed(first))
    )
}

/// Explains the unit MB.
fn about_units() -> String {
    let input = INPUT_MB * 1e6 / MOST_BOXES as f64;
    let densest = |unit: f64| DENSEST_PLAIN_MB * unit / TABLE_III[4].pairs as f64;
    let (binary, decimal) = (densest(MEBI), densest(1e6));
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

/// Says if equation 9 can be what was measured.
fn about_equation_9() -> String {
    let (single, many) = (equation_9(1.0), equation_9(1e12));
    let a_pair = |row: &Coverage| row.output * MEBI / row.pairs as f64;
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
    fn what_is_said_of_the_printed_sizes_follows_from_them() {
        let units = about_units();
        assert!(units.contains("8.000 bytes") && units.contains("both units"), "{units}");
        assert!(about_equation_9().contains("does not describe"), "{}", about_equation_9());
    }

    #[test]
    fn our_list_is_eight_bytes_a_pair_and_records_are_at_most_twelve() {
        let device = Device::best(true);
        for row in &TABLE_III[3..] {
            let ours = Ours::new(row, 2000, &device).expect("a device that works, or none");
            let Some(Ours { list, records, rows, fetched, .. }) = ours else { continue };
            assert!(list == 8.0 && records <= 12.0 && rows <= 12.0 && fetched >= records);
        }
    }

    #[test]
    fn what_is_longer_is_said_by_the_measured_bytes() {
        let ours = |records: f64, rows: f64| Ours { pairs: 100, list: 8.0, records, rows, fetched: 9.0 };
        let text = about_ours(&ours(11.5, 12.0), &ours(5.0, 2.0));
        assert!(text.contains("the other 1.000 are headers of 12 bytes, one for 12.00 pairs"), "{text}");
        assert!(text.contains("5.278 times the printed") && text.contains("(measured: 11.50)"), "{text}");
        assert!(about_ours(&ours(11.5, 12.0), &ours(3.0, 2.0)).contains("pairs share rows."));
    }

    #[test]
    fn equation_9_by_hand() {
        assert_eq!(equation_9(1.0), 11.0);
        assert!((equation_9(1e12) - 1.0).abs() < 1e-9);
    }
}
