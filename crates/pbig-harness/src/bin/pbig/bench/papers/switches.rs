//! PBIG's tables IV, V and VI: each optimisation on and off, and the time of each task.

use super::device::{self, Device, about_bytes, kernels, written};
use super::model::{Edges, Model, Place, Space};
use super::printed::{
    Breakdown, GAUSSIAN_GB, GAUSSIAN_PAIRS, LENGTHS, MOST_BOXES, NORMAL, TABLE_V, TABLE_VI, WARP,
};
use super::sheet::{Sheet, short, thousands};
use super::{Scale, UNSORTED, effort};
use crate::bench::finders::{Finders, Way};
use crate::output::Failure;
use pbig_core::{Coding, Config, GpuOptions, Order, Report};
use pbig_harness::boxes::moved;
use pbig_harness::runner::milliseconds;
use pbig_harness::study::{CellRule, PbigSettings, SETTINGS, with_our_grid};
use serde_json::json;

/// Section 6.3, of which section 6.4 takes 10^7 boxes.
const BOXES: Model =
    Model { space: Space::Normal(NORMAL), place: Place::Centre, edges: Edges::boxes(LENGTHS[0], LENGTHS[1]) };

/// Boxes of section 6.3 that pair as often as 10^7 do in its space: pairs a box follow `N e^3`.
fn crowded(n: usize) -> Model {
    let larger = (MOST_BOXES as f64 / n as f64).cbrt();
    Model { edges: Edges::boxes(LENGTHS[0] * larger, LENGTHS[1] * larger), ..BOXES }
}

fn name(row: &Breakdown) -> String {
    let on = [("C", row.c), ("P", row.p), ("B", row.b)];
    let names: Vec<&str> = on.iter().filter(|(_, on)| *on).map(|(name, _)| *name).collect();
    if names.is_empty() { "baseline".into() } else { format!("+{}", names.join("+")) }
}

fn config(row: &Breakdown) -> Config {
    let coding = if row.c { Coding::Packed } else { Coding::Plain };
    // Chunks as small as gives several at this size: one alone leaves nothing to overlap.
    let chunk = [1 << 13, 1 << 7];
    device::on_gpu(GpuOptions {
        coding,
        pipelining: row.p,
        load_balancing: row.b,
        chunk,
        ..GpuOptions::DEFAULT
    })
}

/// Boxes for a device: as many as a program that plays one searches in seconds.
pub(super) fn count(scale: &Scale, device: &Device) -> usize {
    match (device.is_software(), scale.quick) {
        (_, true) => 2000,
        (true, false) => 50_000,
        (false, false) => 1_000_000,
    }
}

/// Each setting in turn on the device; nothing is measured where there is none.
pub(super) fn on_gpu(scale: &Scale, device: &Device) -> Result<Vec<Sheet>, Failure> {
    let n = count(scale, device);
    let runs = device.run(&TABLE_VI.map(|row| config(&row)), &crowded(n).boxes(n, 1), 1.0)?;
    Ok(vec![optimisations(n, &runs, device), tasks(&runs, device)])
}

/// Table IV, and what each setting sends.
fn optimisations(n: usize, runs: &[(f64, Report)], device: &Device) -> Sheet {
    let columns = [
        "setting",
        "speed-up printed",
        "speed-up by table VI",
        device.column(),
        "speed-up",
        "pairs",
        "checks",
        "bytes written",
        "bytes written a pair",
        "bytes fetched",
        "bytes fetched a pair",
        "chunks",
    ];
    let a_pair = GAUSSIAN_GB.map(|size| short(size * 1e9 / GAUSSIAN_PAIRS as f64));
    let mut sheet = Sheet::new("PBIG table IV: optimisations on and off, GPU", &columns)
        .about(format!(
            "C: data compression (`Coding::Packed` against `Plain`), P: pipelined execution, B: load balancing. \
             Section 6.3 with {} boxes instead of 10^7, lengths so much longer that pairs a box stay the same. {}",
            n,
            device.about()
        ))
        .about(format!(
            "Printed bytes a pair: {} without and {} with compression, to be compared with the bytes written. {} The \
             paper decodes with tables that it copies too, and does not count them.",
            a_pair[0],
            a_pair[1],
            about_bytes()
        ));
    for (i, row) in TABLE_VI.iter().enumerate() {
        let by_table = TABLE_VI[0].total as f64 / row.total as f64;
        let run = runs.get(i);
        let gpu = run.and_then(|(_, report)| report.gpu.as_ref());
        let speed_up = run.map(|(ms, _)| runs[0].0 / ms);
        let a_pair = |bytes: Option<u64>| {
            bytes.zip(run).map(|(bytes, (_, report))| bytes as f64 / report.pairs.max(1) as f64)
        };
        let (written, fetched) = (run.and_then(|run| written(&run.1)), gpu.map(|gpu| gpu.downloaded));
        sheet.row(json!([
            name(row),
            row.speed_up,
            by_table,
            run.map(|run| run.0),
            speed_up,
            run.map(|run| run.1.pairs),
            run.map(|run| run.1.checks.made),
            written,
            a_pair(written),
            fetched,
            a_pair(fetched),
            gpu.map(|gpu| gpu.chunks),
        ]));
    }
    let checks: Vec<u64> = runs.iter().map(|(_, report)| report.checks.made).collect();
    if runs.is_empty() { sheet } else { sheet.about(about_checks(&checks)) }
}

/// Explains why calls that find the same pairs may count different numbers of tests, if they do.
fn about_checks(checks: &[u64]) -> String {
    let (least, most) = checks.iter().fold((u64::MAX, 0), |(least, most), &n| (least.min(n), most.max(n)));
    if least >= most {
        return "All settings make the same number of checks.".to_owned();
    }
    format!(
        "Checks differ by up to {} of {}, from call to call and not by setting: up to 256 rows of a large cell \
         against 8 times 256 columns are one item of work, and an item none of whose entries has one of the three \
         marks that the owner of a pair shows is left out before its tests are counted. Which entries lie in which \
         item follows from the order in which threads took their places, so a short item at the end of a cell is left \
         out in one call and not in the next. It owns no pair either way: pairs are equal.",
        thousands(most - least),
        thousands(most)
    )
}

/// Tables V and VI: the time of each task.
fn tasks(runs: &[(f64, Report)], device: &Device) -> Sheet {
    let mut columns = vec!["setting".to_owned(), "side".to_owned(), "total".to_owned()];
    columns.extend(TABLE_V.iter().map(|task| task.0.to_owned()));
    columns.push("in none".to_owned());
    let columns: Vec<&str> = columns.iter().map(String::as_str).collect();
    let mut sheet = Sheet::new("PBIG tables V and VI: time per task, ms", &columns).about(
        "Printed: 10^7 boxes; with P, CHECK has the time of CHECK, DataOut and REPORT together. Ours: of the call in \
         the table above; DataOut is the time that the host waits beyond the kernels. In none: total less the tasks.",
    );
    sheet = sheet.about(about_rest(runs));
    for (task, what, here) in TABLE_V {
        sheet = sheet.about(format!("{task}: {what}. Here: {here}."));
    }
    sheet = sheet.about(device.about());
    for (i, row) in TABLE_VI.iter().enumerate() {
        let ms = |of: u64| of as f64 / 1e3;
        let printed = row.before.iter().chain(row.after).map(|&of| json!(ms(of)));
        let first = [json!(name(row)), json!("printed"), json!(ms(row.total))];
        let nothing = std::iter::repeat_n(json!(null), TABLE_V.len() - row.before.len() - row.after.len());
        let rest = [json!(ms(row.total - tasks_of(row)))];
        sheet.row(first.into_iter().chain(printed).chain(nothing).chain(rest).collect());
        if let Some((total, report)) = runs.get(i) {
            let first = [json!(name(row)), json!("ours"), json!(total)];
            let tasks = of_tasks(report);
            let rest = [json!(total - sum(&tasks))];
            sheet.row(first.into_iter().chain(tasks.map(|ms| json!(ms))).chain(rest).collect());
        }
    }
    sheet
}

/// Microseconds of all tasks of a printed row.
fn tasks_of(row: &Breakdown) -> u64 {
    row.before.iter().chain(row.after).sum()
}

fn sum(tasks: &[Option<f64>]) -> f64 {
    tasks.iter().flatten().sum()
}

/// Returns the part of the totals that is in no task, printed and here, for consecutive and for overlapping tasks.
fn about_rest(runs: &[(f64, Report)]) -> String {
    let printed = |row: &Breakdown| 100.0 * (1.0 - tasks_of(row) as f64 / row.total as f64);
    let ours = |(total, report): &(f64, Report)| 100.0 * (1.0 - sum(&of_tasks(report)) / total);
    let with = |pipelined: bool| {
        let runs = TABLE_VI.iter().zip(runs).filter(move |(row, _)| row.p == pipelined);
        between(runs.map(|(_, run)| ours(run)))
    };
    let says = format!("Of the printed totals {} % is in no task", between(TABLE_VI.iter().map(printed)));
    if runs.is_empty() {
        return format!("{says}.");
    }
    format!(
        "{says}; of ours {} % without P. With P, where tasks overlap and what is at the same time counts twice, it is {} %.",
        with(false),
        with(true)
    )
}

/// The least and the most.
fn between(values: impl Iterator<Item = f64>) -> String {
    let (least, most) = values.fold((f64::MAX, f64::MIN), |(least, most), x| (least.min(x), most.max(x)));
    format!("{} to {}", short(least), short(most))
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

/// The counterpart on the CPU: which cells, which mapping, which entries.
pub(super) fn on_cpu(scale: &Scale) -> Result<Sheet, Failure> {
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
    let mut sheet = Sheet::new("PBIG table IV's counterpart on the CPU", &columns).about(format!(
        "Section 6.3 as printed with {n} boxes. PBIG's grid on one thread, ours on all. There is nothing to transfer, \
         so neither compression nor pipelining; a redundant check is ended by the rule of the owning cell before the \
         boxes are compared, and our grid, with one entry a box, makes none. Its checks are comparisons of codes. \
         Stages are of the last call of ours; PBIG's grid does not report them."
    ));
    let boxes = BOXES.boxes(n, 1);
    let settings = settings();
    let ways = settings.iter().map(|(_, way)| *way);
    let mut finders = Finders::new(ways, None, [moved(&boxes, 1.0, 2), boxes]);
    let times = finders.times(effort(n))?;
    finders.pairs()?;
    for ((name, _), (ms, side)) in settings.iter().zip(times.iter().zip(&finders.all)) {
        let checks = side.checks();
        let stages = side.report().map(|report| report.stages.named().map(|(_, time)| milliseconds(time)));
        let stage = |k: usize| stages.map(|stages| stages[k]);
        sheet.row(json!([
            name,
            ms,
            times[0] / ms,
            side.pairs(),
            checks.made,
            checks.unnecessary,
            checks.redundant,
            stage(0),
            stage(1),
            stage(2),
            stage(3),
        ]));
    }
    Ok(sheet)
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
        let device = Device::best(true);
        for (_, report) in
            device.run(&TABLE_VI.map(|row| config(&row)), &boxes, 1.0).expect("a device that works")
        {
            assert_eq!(report.pairs, pairs);
            assert!(report.gpu.is_some() && written(&report) <= Some(8 * pairs + 4 * pairs), "{report:?}");
        }
    }

    #[test]
    fn plain_pairs_are_eight_bytes_each_as_written_and_never_less_as_fetched() {
        let sheets = on_gpu(&Scale::new(true), &Device::best(true)).expect("a device that works, or none");
        for row in sheets[0].object()["rows"].as_array().expect("rows") {
            let Some(pairs) = row["pairs"].as_u64() else { continue };
            let (written, fetched) = (row["bytes written"].as_u64(), row["bytes fetched"].as_u64());
            assert!(written.is_some() && fetched >= written, "{row}");
            let is_plain = !row["setting"].as_str().is_some_and(|name| name.contains('C'));
            assert!(!is_plain || written == Some(8 * pairs), "{row}");
        }
    }

    #[test]
    fn tasks_and_what_is_in_none_add_up_to_the_total_of_the_same_call() {
        let sheets = on_gpu(&Scale::new(true), &Device::best(true)).expect("a device that works, or none");
        for row in sheets[1].object()["rows"].as_array().expect("rows") {
            let of = |name: &str| row[name].as_f64().unwrap_or(0.0);
            let parts: f64 = TABLE_V.iter().map(|task| of(task.0)).sum();
            assert!((parts + of("in none") - of("total")).abs() < 1e-6 * of("total"), "{row}");
        }
        assert!(about_rest(&[]).ends_with("0.1059 to 1.256 % is in no task."), "{}", about_rest(&[]));
    }

    #[test]
    fn checks_that_differ_are_explained_and_equal_ones_not() {
        assert!(about_checks(&[1_000_007, 1_000_010]).contains("up to 3 of 1,000,010"));
        assert!(about_checks(&[5, 5]).contains("the same number"));
    }

    #[test]
    fn fewer_boxes_are_as_crowded() {
        let a_box = |model: &Model, n: usize| model.pairs(n) / n as f64;
        let whole = a_box(&BOXES, MOST_BOXES);
        for n in [50_000, 1_000_000] {
            assert!((a_box(&crowded(n), n) / whole - 1.0).abs() < 0.1, "{n}");
        }
    }
}
