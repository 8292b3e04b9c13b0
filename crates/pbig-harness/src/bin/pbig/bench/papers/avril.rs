//! Avril's figures 3 to 6 and tables 5 to 7: bytes of output, brute force, steps with everything and with a part
//! in motion, and where a grid begins to pay.

use super::device::{Device, kernels, on_gpu};
use super::printed::{AVRIL_5, AVRIL_6, AVRIL_7};
use super::sheet::Sheet;
use super::{Scale, UNSORTED, chart, effort};
use crate::bench::finders::Finders;
use crate::bench::measure::Effort;
use crate::bench::stages::{Alone, NAMES};
use crate::output::Failure;
use pbig_core::pair_index::pair_count;
use pbig_core::{Backend, CellRule, Coding, Config, GpuOptions, Strategy};
use pbig_harness::boxes::{cubes, moved};
use pbig_harness::chart::Line;
use serde_json::json;

/// Bytes of boxes that go up: 6 coordinates each (Avril 3.2.1).
fn input_bytes(n: u64) -> u64 {
    24 * n
}

/// Bytes that come back with a byte a pair, and with a bit (Avril 3.4).
fn output_bytes(n: u64) -> [u64; 2] {
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
    let mut sheet = Sheet::new("Avril table 5 and figure 3: a byte or a bit a pair", &columns).about(
        "Bytes by calculation from 3.4; rates are these bytes over the printed output time. The rates of large outputs agree, so the times are those of the \
         bytes; the kernel takes the same with either, as printed.",
    );
    for (n, byte, bit) in AVRIL_5 {
        let [bytes, bits] = output_bytes(n);
        let rate = |bytes: u64, us: f64| bytes as f64 / us / 1e3;
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

/// The same on a device: bits against a list of pairs.
pub(super) fn forms(device: &Device) -> Result<Sheet, Failure> {
    let columns = [
        "objects",
        "pairs",
        "form",
        "bytes back",
        "ms of the kernel `check_all`",
        "ms, host waits",
        "ms, host decodes",
    ];
    let mut sheet = Sheet::new("Avril table 5: forms of output, GPU", &columns).about(format!(
        "`Coding::Packed` is a bit a pair of boxes as in 3.4, gathered in a workgroup's memory before it is written; `Plain` is a list of pairs, 8 \
         bytes for each that overlaps. Without a grid a device searches up to 1024 boxes here, so 5000 and 7500 have no rows. One pair a box. {}",
        device.about()
    ));
    for n in [100, 1000] {
        let forms = [("a bit a pair of boxes", Coding::Packed), ("a list of pairs", Coding::Plain)];
        let configs = forms.map(|(_, coding)| on_gpu(GpuOptions { coding, ..GpuOptions::DEFAULT }));
        for ((form, _), (_, report)) in forms.iter().zip(device.run(&configs, &cubes(n, 1.0, 1.0, 1), 0.1)?) {
            let (kernel, gpu) =
                (kernels(&report, |name| name == "check_all"), report.gpu.unwrap_or_default());
            let [wait, decode] = [gpu.wait, gpu.decode].map(pbig_harness::runner::milliseconds);
            sheet.row(json!([n, report.pairs, form, gpu.downloaded, kernel, wait, decode]));
        }
    }
    Ok(sheet)
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
        "The figure has no printed numbers; table 5 has the kernel's time at four of its sizes. On the CPU every pair is tested, in blocks of 32, one thread; on a device up to 1024 boxes \
         (whole calls, kernel and transfers).",
    );
    let mut line = Line { name: "brute force, CPU".into(), points: vec![] };
    for n in [100usize, 500, 1000, 2500, 5000] {
        let boxes = cubes(n, 1.0, 1.0, 1);
        let gpu = if n <= 1024 { device.run(&[on_gpu(GpuOptions::DEFAULT)], &boxes, 0.1)? } else { vec![] };
        let config = Config { backend: Backend::Brute, ..UNSORTED };
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

/// How far cubes with edges of 1 move in a step, along each axis.
const DISTANCE: f32 = 0.1;

fn step_effort(scale: &Scale) -> Effort {
    Effort::new(scale.quick)
}

/// Table 6 and figure 5: a step in which all move.
pub(super) fn steps(scale: &Scale) -> Result<Sheet, Failure> {
    let columns = ["objects", "pairs", "side", "boxes up to date, ms", "grid, ms", "search, ms", "whole, ms"];
    let mut sheet = Sheet::new("Avril table 6 and figure 5: a step, all moving", &columns).about(
        "Printed: a column of equal objects falls onto a plane, their GPU, transfers included. Ours: cubes with a pair each, all moved by up to a tenth of their edge, on the CPU: \
         `BroadPhase::set` for each, then `update`, whose plan and map are the grid, and check and diff, events included, the search. Whole falling scenes with rapier: \
         [step](step.md); the dynamic tree of figure 5 in today's form: [peers](peers.md).",
    );
    let (mut printed_line, mut line) =
        (Line { name: "printed".into(), points: vec![] }, Line { name: "ours, CPU".into(), points: vec![] });
    for (n, printed) in AVRIL_6 {
        if scale.quick && n > 100_000 {
            continue;
        }
        let (ms, pairs) = Alone::events(cubes(n, 1.0, 1.0, 1), 1.0, DISTANCE)?.measure(step_effort(scale))?;
        let of = |name: &str| {
            NAMES.iter().zip(ms).filter(|(known, _)| **known == name).map(|(_, ms)| ms).sum::<f64>()
        };
        sheet.row(json!([n, null, "printed", printed[0], printed[1], printed[2], printed[3]]));
        let (map, search) = (of("plan") + of("map"), of("check") + of("emit") + of("diff"));
        sheet.row(json!([n, pairs, "ours, CPU", of("set"), map, search, of("whole")]));
        printed_line.points.push((n as f64, printed[3]));
        line.points.push((n as f64, of("whole")));
    }
    Ok(sheet.chart(chart(
        "steps",
        "Avril table 6 and figure 5: a step, all moving",
        "objects",
        [printed_line, line],
    )))
}

/// Figure 6: a step in which a share moves.
pub(super) fn movers(scale: &Scale) -> Result<Sheet, Failure> {
    let n = if scale.quick { 10_000 } else { 100_000 };
    let columns = ["share moved", "boxes", "pairs", "ms, events", "ms, from nothing"];
    let mut sheet = Sheet::new("Avril figure 6: share of moving objects", &columns).about(
        "The figure has no printed numbers; the text says that the time stays the same whatever moves, as everything is searched from nothing. So does our `Finder`; \
         `BroadPhase` pays for what has moved.",
    );
    let mut lines = ["events", "from nothing"].map(|name| Line { name: name.into(), points: vec![] });
    for share in [0.01, 0.1, 0.25, 0.5, 0.75, 1.0] {
        let boxes = || cubes(n, 1.0, 1.0, 1);
        let (events, pairs) = Alone::events(boxes(), share, DISTANCE)?.measure(step_effort(scale))?;
        let (scratch, _) = Alone::scratch(boxes(), share, DISTANCE).measure(step_effort(scale))?;
        sheet.row(json!([share, n, pairs, events[0], scratch[0]]));
        lines.iter_mut().zip([events[0], scratch[0]]).for_each(|(line, ms)| line.points.push((share, ms)));
    }
    Ok(sheet.chart(chart("movers", "Avril figure 6: share of moving objects", "share moved", lines)))
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
        "Whole calls from nothing, cubes with a pair each, all moved. Printed, the grid pays from between 1000 and 10,000 objects on; where it does here, with more \
         sizes and densities: [crossovers](crossovers.md). Without a grid a device searches up to 1024 boxes. {}",
        device.about()
    ));
    let pbig = Config { strategy: Strategy::Pbig, ..UNSORTED };
    let sides = [
        Config { backend: Backend::Brute, ..UNSORTED },
        Config { strategy: Strategy::Grid, ..UNSORTED },
        Config { cell_rule: CellRule::Density, ..pbig },
    ];
    for (n, without, with) in AVRIL_7 {
        let boxes = cubes(n, 1.0, 1.0, 1);
        let on = |strategy| Config { strategy, ..on_gpu(GpuOptions::DEFAULT) };
        let wanted = [on(Strategy::Pbig), on(Strategy::Auto)];
        let gpu = device.run(&wanted[..if n <= 1024 { 2 } else { 1 }], &boxes, DISTANCE)?;
        let mut finders = Finders::new(sides, None, [moved(&boxes, DISTANCE, 2), boxes]);
        let cpu = finders.times(Effort::new(scale.quick))?;
        let gpu_ms = |i: usize| gpu.get(i).map(|(ms, _)| *ms);
        sheet.row(json!([n, finders.pairs()?, without, with, cpu[0], cpu[1], cpu[2], gpu_ms(1), gpu_ms(0)]));
    }
    Ok(sheet)
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
    fn bits_come_back_as_calculated_whatever_overlaps() {
        let sheet = forms(&Device::best(true)).expect("a device that works, or none").object();
        for row in sheet["rows"].as_array().expect("rows") {
            let n = row["objects"].as_u64().expect("a number");
            let pairs = oracle::pairs(&cubes(n as usize, 1.0, 1.0, 1)).len() as u64;
            assert_eq!(row["pairs"], pairs);
            // Counters and times come back too, and words are of four bytes.
            let least = if row["form"] == "a list of pairs" { 8 * pairs } else { output_bytes(n)[1] };
            let back = row["bytes back"].as_u64().expect("a number");
            assert!(back >= least && back < 2 * least + 2048, "{row}");
        }
    }

    #[test]
    fn table_7_has_the_pairs_of_brute_force() {
        let sheet = crossover(&Scale::new(true), &Device::best(true)).expect("all agree").object();
        for (row, (n, ..)) in sheet["rows"].as_array().expect("rows").iter().zip(AVRIL_7) {
            assert_eq!(row["pairs"], oracle::pairs(&cubes(n, 1.0, 1.0, 1)).len(), "{n}");
        }
    }
}
