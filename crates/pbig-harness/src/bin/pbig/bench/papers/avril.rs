//! Avril's figures 3 and 4 and tables 5 and 7: bytes of output by calculation, brute force, and where a grid begins to pay.

use super::device::{Device, on_gpu, same_pairs};
use super::printed::{AVRIL_5, AVRIL_7};
use super::sheet::{Sheet, short, thousands};
use super::steps::DISTANCE;
use super::{Scale, UNSORTED, chart, effort, once};
use crate::bench::finders::{Finders, Way};
use crate::bench::measure::Effort;
use crate::output::Failure;
use pbig_core::{Backend, Config, GpuOptions};
use pbig_harness::boxes::{cubes, moved};
use pbig_harness::chart::Line;
use pbig_harness::pair_index::pair_count;
use pbig_harness::study::{ALL_PAIRS_UP_TO, CellRule, PbigSettings, SETTINGS, with_gpu_grid, with_our_grid};
use serde_json::json;

/// Bytes of boxes that go up: 6 coordinates each (Avril 3.2.1).
fn input_bytes(n: u64) -> u64 {
    24 * n
}

/// Bytes that come back with a byte a pair, and with a bit (Avril 3.4).
pub(super) fn output_bytes(n: u64) -> [u64; 2] {
    [pair_count(n), pair_count(n).div_ceil(8)]
}

/// Table 5 and figure 3, the sizes behind the printed times.
pub(super) fn bytes() -> Sheet {
    let columns = [
        "objects",
        "pairs tested",
        "bytes, a byte a pair",
        "bytes, a bit a pair",
        "kernel printed, ms: byte",
        "bit",
        "output printed, us: byte",
        "bit",
        "GB/s printed: byte",
        "bit",
        "tests/s printed",
    ];
    let mut sheet =
        Sheet::new("Avril table 5 and figure 3: a byte or a bit a pair", &columns).about(about_rates());
    for (n, byte, bit) in AVRIL_5 {
        let [bytes, bits] = output_bytes(n);
        let tests = pair_count(n) as f64 / (bit[0] / 1e3);
        sheet.row(json!([
            n,
            pair_count(n),
            bytes,
            bits,
            byte[0],
            bit[0],
            byte[1],
            bit[1],
            rate(bytes, byte[1]),
            rate(bits, bit[1]),
            tests,
        ]));
    }
    sheet
}

/// GB a second.
fn rate(bytes: u64, us: f64) -> f64 {
    bytes as f64 / us / 1e3
}

/// Describes the printed times of table 5.
fn about_rates() -> String {
    let large = AVRIL_5.iter().filter(|(n, ..)| *n >= 1000);
    let rates = large.flat_map(|&(n, byte, bit)| {
        let [bytes, bits] = output_bytes(n);
        [rate(bytes, byte[1]), rate(bits, bit[1])]
    });
    let (least, most) =
        rates.fold((f64::MAX, 0.0f64), |(least, most), rate| (least.min(rate), most.max(rate)));
    let apart = |&(_, byte, bit): &(u64, [f64; 2], [f64; 2])| 100.0 * (byte[0] / bit[0] - 1.0).abs();
    let apart = AVRIL_5.iter().map(apart).fold(0.0, f64::max);
    let so = if most < 1.2 * least {
        "so these times are those of the bytes"
    } else {
        "so bytes alone do not explain them"
    };
    format!(
        "Bytes by calculation from 3.4; rates are these bytes over the printed output time. From 1000 objects on the \
         rates are {} to {} GB/s, {so}; the printed times of the kernel differ between the two by up to {} %.",
        short(least),
        short(most),
        short(apart)
    )
}

/// Figure 4: brute force by number of objects.
pub(super) fn brute_force(device: &Device) -> Result<Sheet, Failure> {
    let columns = [
        "objects",
        "tests",
        "bytes up",
        "bytes back, a bit a pair",
        "ms, brute force, CPU",
        "tests/s, CPU",
        device.column(),
    ];
    let mut sheet = Sheet::new("Avril figure 4: brute force", &columns).about(
        "The figure has no printed numbers; table 5 has the kernel's time at four of its sizes. On the CPU every pair \
         is tested, in blocks of 32, one thread; on a device up to 1024 boxes (whole calls, kernel and transfers).",
    );
    let mut line = Line { name: "brute force, CPU".into(), points: vec![] };
    for n in [100usize, 500, 1000, 2500, 5000] {
        let boxes = cubes(n, 1.0, 1.0, 1);
        let gpu = if n <= 1024 { device.run(&[on_gpu(GpuOptions::DEFAULT)], &boxes, 0.1)? } else { vec![] };
        let config = Config { backend: Backend::Brute, ..UNSORTED };
        same_pairs(&gpu, once(config, &boxes)?.pairs)?;
        let ms = Finders::new([config], None, [moved(&boxes, 0.1, 2), boxes]).times(effort(n))?[0];
        let tests = pair_count(n as u64);
        line.points.push((n as f64, ms));
        let gpu = gpu.first().map(|(ms, _)| *ms);
        sheet.row(json!([
            n,
            tests,
            input_bytes(n as u64),
            output_bytes(n as u64)[1],
            ms,
            tests as f64 / ms * 1e3,
            gpu
        ]));
    }
    Ok(sheet.chart(chart("brute", "Avril figure 4: brute force", "objects", [line])))
}

/// Table 7: with and without a grid.
pub(super) fn crossover(scale: &Scale, device: &Device) -> Result<Sheet, Failure> {
    let columns = [
        "objects",
        "pairs",
        "ms printed: without grid",
        "with",
        "ms, CPU: brute force",
        "our grid",
        "Avril's cells, one thread",
        "ms, GPU: without grid",
        "with",
    ];
    let mut sheet = Sheet::new("Avril table 7: with and without a grid", &columns).about(format!(
        "Whole calls from nothing, cubes with a pair each, all moved. Without a grid a device searches up to 1024 \
         boxes. {}",
        device.about()
    ));
    let mut pays = vec![];
    let sides: [Way; 3] = [
        Config { backend: Backend::Brute, ..UNSORTED }.into(),
        with_our_grid(UNSORTED).into(),
        PbigSettings { cell_rule: CellRule::Density, ..SETTINGS }.into(),
    ];
    for (n, without, with) in AVRIL_7 {
        let boxes = cubes(n, 1.0, 1.0, 1);
        let on = |all_pairs_up_to| with_gpu_grid(on_gpu(GpuOptions::DEFAULT), &SETTINGS, all_pairs_up_to);
        let wanted = [on(0), on(ALL_PAIRS_UP_TO)];
        let gpu = device.run(&wanted[..if n <= 1024 { 2 } else { 1 }], &boxes, DISTANCE)?;
        let pairs = once(UNSORTED, &boxes)?.pairs;
        same_pairs(&gpu, pairs)?;
        let mut finders = Finders::new(sides, None, [moved(&boxes, DISTANCE, 2), boxes]);
        let cpu = finders.times(Effort::new(scale.quick))?;
        finders.pairs()?;
        let gpu_ms = |i: usize| gpu.get(i).map(|(ms, _)| *ms);
        pays.push((n, with < without, cpu[1] < cpu[0]));
        sheet.row(json!([n, pairs, without, with, cpu[0], cpu[1], cpu[2], gpu_ms(1), gpu_ms(0)]));
    }
    Ok(sheet.about(about_crossover(&pays)))
}

/// At which sizes the grid takes less, as printed and here.
fn about_crossover(pays: &[(usize, bool, bool)]) -> String {
    let at = |pays_there: &dyn Fn(&(usize, bool, bool)) -> bool| {
        let sizes: Vec<String> =
            pays.iter().filter(|row| pays_there(row)).map(|(n, ..)| thousands(*n as u64)).collect();
        if sizes.is_empty() { "none of these sizes".to_owned() } else { sizes.join(", ") }
    };
    format!(
        "A grid takes less than none at: printed {}; here on the CPU, ours, {}.",
        at(&|row| row.1),
        at(&|row| row.2)
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use pbig_core::oracle;

    #[test]
    fn sizes_by_hand() {
        // Avril 3.1: 23 KB for 1000 objects; 19 pairs of figure 3's text need three bytes.
        assert_eq!(input_bytes(1000), 24_000);
        assert_eq!(output_bytes(1000), [499_500, 62_438]);
        assert_eq!(output_bytes(7), [21, 3]);
    }

    #[test]
    fn sizes_at_which_a_grid_pays_are_those_of_the_rows() {
        let text = about_crossover(&[(100, false, true), (1000, false, true), (10_000, true, true)]);
        assert!(text.contains("printed 10,000; here on the CPU, ours, 100, 1,000, 10,000."), "{text}");
        assert!(about_crossover(&[(100, false, false)]).contains("printed none of these sizes"));
        assert!(about_rates().contains("those of the bytes"), "{}", about_rates());
    }

    #[test]
    fn table_7_has_the_pairs_of_brute_force() {
        let sheet = crossover(&Scale::new(true), &Device::best(true)).expect("all agree").object();
        for (row, (n, ..)) in sheet["rows"].as_array().expect("rows").iter().zip(AVRIL_7) {
            assert_eq!(row["pairs"], oracle::pairs(&cubes(n, 1.0, 1.0, 1)).len(), "{n}");
        }
    }
}
