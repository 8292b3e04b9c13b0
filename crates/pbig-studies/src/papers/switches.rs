//! PBIG's tables IV, V and VI: each optimisation on and off, and the time of each task.

use super::device::{self, Device, kernels, written};
use super::figures::GAUSSIAN;
use super::finders::{Finders, Way};
use super::model::{Edges, Model};
use super::printed::{Breakdown, LENGTHS, MOST_BOXES, TABLE_VI, TASKS, WARP};
use super::{Scale, UNSORTED, effort};
use crate::study::{CellRule, PbigSettings, SETTINGS, with_our_grid};
use pbig_core::{Coding, Config, GpuOptions, Order, Report};
use pbig_harness::boxes::moved;
use pbig_harness::cells;
use pbig_harness::output::Failure;
use pbig_harness::runner::milliseconds;
use pbig_harness::table::{Cell, Table};

/// Boxes of section 6.3 that pair as often as 10^7 do in its space: pairs a box follow `N e^3`.
fn crowded(n: usize) -> Model {
    let larger = (MOST_BOXES as f64 / n as f64).cbrt();
    Model { edges: Edges::boxes(LENGTHS[0] * larger, LENGTHS[1] * larger), ..GAUSSIAN }
}

/// C: data compression, P: pipelined execution, B: load balancing.
fn name(row: &Breakdown) -> String {
    let on = [("C", row.c), ("P", row.p), ("B", row.b)];
    let names: Vec<&str> = on.iter().filter(|(_, on)| *on).map(|(name, _)| *name).collect();
    if names.is_empty() { "baseline".into() } else { format!("+{}", names.join("+")) }
}

fn config(row: &Breakdown) -> Config {
    let coding = if row.c { Coding::Packed } else { Coding::Plain };
    // Chunks as small as gives several at this size: one alone leaves nothing to overlap.
    let chunk = [1 << 13, 1 << 7];
    let (pipelining, load_balancing) = (row.p, row.b);
    device::on_gpu(GpuOptions { coding, pipelining, load_balancing, chunk, ..GpuOptions::DEFAULT })
}

pub(super) fn tables(scale: &Scale, device: &Device) -> Result<Vec<Table>, Failure> {
    let n = scale.on_device(device);
    let runs = device.run(&TABLE_VI.map(|row| config(&row)), &crowded(n).boxes(n, 1), 1.0)?;
    Ok(vec![optimisations(&runs), tasks(&runs), on_cpu(scale)?])
}

/// Table IV, and what each setting sends. Ours: section 6.3 with fewer boxes, as crowded.
fn optimisations(runs: &[(f64, Report)]) -> Table {
    let columns = [
        "setting",
        "speed-up printed",
        "speed-up by table VI",
        "ms, GPU",
        "speed-up",
        "pairs",
        "checks",
        "bytes written",
        "bytes written a pair",
        "bytes fetched",
        "bytes fetched a pair",
        "chunks",
    ];
    let mut table = Table::new("PBIG table IV: optimisations on and off, GPU", columns);
    for (i, row) in TABLE_VI.iter().enumerate() {
        let printed = cells![name(row), row.speed_up, TABLE_VI[0].total as f64 / row.total as f64];
        let ours = runs.get(i).map_or(vec![Cell::Nothing; 9], |(ms, report)| {
            let (written, gpu) = (written(report), report.gpu.as_ref());
            let fetched = gpu.map(|gpu| gpu.downloaded);
            let a_pair = |bytes: Option<u64>| bytes.map(|bytes| bytes as f64 / report.pairs.max(1) as f64);
            let counts = cells![*ms, runs[0].0 / ms, report.pairs, report.checks.made];
            let bytes = cells![written, a_pair(written), fetched, a_pair(fetched), gpu.map(|gpu| gpu.chunks)];
            [counts, bytes].concat()
        });
        table.row([printed, ours].concat());
    }
    table
}

/// Tables V and VI: the time of each task. Printed: with P, CHECK has the time of CHECK, `DataOut` and REPORT together. Ours: of
/// the call in table IV; `DataOut` is the time that the host waits beyond the kernels. In none: total less the tasks; with P
/// tasks overlap, and what is at the same time counts twice.
fn tasks(runs: &[(f64, Report)]) -> Table {
    let columns = [&["setting", "side", "total"][..], &TASKS, &["in none"]].concat();
    let mut table = Table::new("PBIG tables V and VI: time per task, ms", columns);
    let mut row = |setting: String, side: &str, total: f64, tasks: &[Option<f64>]| {
        let rest = total - tasks.iter().flatten().sum::<f64>();
        let tasks = tasks.iter().map(|&ms| Cell::from(ms));
        table.row(cells![setting, side, total].into_iter().chain(tasks).chain(cells![rest]));
    };
    for (i, printed) in TABLE_VI.iter().enumerate() {
        let all = printed.before.iter().chain(printed.after);
        let mut tasks: Vec<Option<f64>> = all.map(|&us| Some(us as f64 / 1e3)).collect();
        tasks.resize(TASKS.len(), None);
        row(name(printed), "printed", printed.total as f64 / 1e3, &tasks);
        if let Some((total, report)) = runs.get(i) {
            row(name(printed), "ours", *total, &of_tasks(report));
        }
    }
    table
}

/// Returns the times of a call on a device by the paper's tasks.
fn of_tasks(report: &Report) -> [Option<f64>; 7] {
    let is_check = |name: &str| name.starts_with("check");
    let is_schedule = |name: &str| matches!(name, "schedule" | "arrange");
    let map = kernels(report, |name| !is_check(name) && !is_schedule(name));
    let (schedule, check) = (kernels(report, is_schedule), kernels(report, is_check));
    let gpu = report.gpu.as_ref();
    let all = kernels(report, |_| true);
    let out = gpu.zip(all).map(|(gpu, all)| (milliseconds(gpu.wait) - all).max(0.0));
    let decode = gpu.map(|gpu| milliseconds(gpu.decode + report.stages.emit));
    let upload = gpu.map(|gpu| milliseconds(gpu.upload));
    [upload, Some(milliseconds(report.stages.plan)), map, schedule, check, out, decode]
}

/// Returns the settings that can be switched on the CPU.
fn settings() -> [(String, Way); 7] {
    let wanted = |boxes_per_cell: f32| {
        let name = format!("PBIG's grid, equation 6, W = {boxes_per_cell}");
        (name, PbigSettings { boxes_per_cell, ..SETTINGS }.into())
    };
    let small_cell = |small_cell: u32| PbigSettings { small_cell, ..SETTINGS }.into();
    let density = PbigSettings { cell_rule: CellRule::Density, ..SETTINGS };
    let (ours, sorted) = (with_our_grid(UNSORTED), Config { order: Order::Sorted, ..UNSORTED });
    [
        wanted(WARP as f32),
        wanted(SETTINGS.boxes_per_cell),
        ("PBIG's grid, Avril's cells of that many objects".into(), density.into()),
        ("the same as the second, every cell by balanced rows".into(), small_cell(0)),
        ("the same, every cell by Avril's mapping".into(), small_cell(u32::MAX)),
        ("our grid, one entry a box".into(), ours.into()),
        ("our grid, list sorted".into(), with_our_grid(sorted).into()),
    ]
}

/// The counterpart on the CPU: which cells, which mapping, which entries. Section 6.3 as printed; PBIG's grid on one thread,
/// ours on all. Stages are of the last call of ours.
fn on_cpu(scale: &Scale) -> Result<Table, Failure> {
    let n = if scale.quick { 20_000 } else { 300_000 };
    let columns = [
        "setting",
        "ms",
        "times as fast as the first",
        "pairs",
        "checks",
        "unnecessary",
        "redundant",
        "plan ms",
        "map ms",
        "check ms",
        "emit ms",
    ];
    let mut table = Table::new("PBIG table IV's counterpart on the CPU", columns);
    let (boxes, settings) = (GAUSSIAN.boxes(n, 1), settings());
    let ways = settings.iter().map(|(_, way)| *way);
    let mut finders = Finders::new(ways, None, [moved(&boxes, 1.0, 2), boxes]);
    let times = finders.times(effort(n))?;
    finders.pairs()?;
    for ((name, _), (ms, side)) in settings.iter().zip(times.iter().zip(&finders.all)) {
        let checks = side.checks();
        let counts = cells![side.pairs(), checks.made, checks.unnecessary, checks.redundant];
        let stages = side.report().map(|report| report.stages.named().map(|(_, time)| milliseconds(time)));
        let stages = (0..4).map(|k| stages.map(|stages| stages[k]).into()).collect();
        table.row([cells![name, *ms, times[0] / ms], counts, stages].concat());
    }
    Ok(table)
}

#[cfg(test)]
mod tests {
    use super::*;
    use pbig_core::oracle;

    #[test]
    fn every_setting_finds_the_pairs_of_brute_force() {
        let boxes = crowded(1500).boxes(1500, 1);
        let pairs = oracle::pairs(&boxes).len() as u64;
        for (name, way) in settings() {
            assert_eq!(super::super::once(way, &boxes).expect("found").pairs, pairs, "{name}");
        }
        let configs = TABLE_VI.map(|row| config(&row));
        for (_, report) in Device::best(true).run(&configs, &boxes, 1.0).expect("a device that works") {
            assert_eq!(report.pairs, pairs);
            assert!(report.gpu.is_some() && written(&report) <= Some(12 * pairs), "{report:?}");
        }
    }
}
