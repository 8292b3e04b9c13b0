//! `pbig bench gpu`: the GPU beside the CPU, kernel by kernel.

use pbig_core::{Aabb, Backend, Config, DeviceReport, Finder, Limits, Report};
use pbig_gpu::{DECLINED, GpuFinder, GpuOptions};
use pbig_harness::output::warn;
use pbig_harness::prelude::*;

const CONFIG: Config = Config { limits: Limits::UNLIMITED, ..Config::DEFAULT };
const ON_GPU: Config = Config { backend: Backend::Device, ..CONFIG };

pub(super) fn run(quick: bool) -> Result<BenchReport, Failure> {
    let gpu = GpuFinder::new().map_err(|error| Failure::Input(error.to_string()))?;
    let (name, is_software) = (gpu.adapter(), gpu.is_software());
    if is_software {
        warn(&format!("{name} is a program on the CPU: the times say nothing about a GPU"));
    }
    let head = vec![("adapter", name.to_owned()), ("software", is_software.to_string())];
    let [searches, kernels] = searches(&gpu, quick)?;
    let verdict = verdict(&searches, if is_software { "software adapter" } else { "GPU" });
    Ok(BenchReport { head, verdict, ..BenchReport::new("gpu", vec![searches, kernels]) })
}

/// Returns numbers of boxes, in ascending order, each with a set. A software adapter gets fewer: ten million take minutes there.
fn cases(is_software: bool, quick: bool) -> Vec<(usize, &'static str)> {
    let most = match (quick, is_software) {
        (true, true) => 10_000,
        (false, false) => 10_000_000,
        _ => 1_000_000,
    };
    let sets: &[&str] = if quick { &["uniform", "mixed"] } else { &["uniform", "gaussian", "mixed"] };
    let sizes = (3..=7).map(|power| 10usize.pow(power)).filter(|boxes| *boxes <= most);
    let cases = sizes.flat_map(|n| sets.iter().map(move |set| (n, *set)));
    // Ten million boxes of the set `gaussian` have over a billion pairs.
    cases.filter(|case| *case != (10_000_000, "gaussian")).collect()
}

/// Returns a sentence about the number of boxes from which on the device is faster in every case. The CPU is faster where the
/// device declines.
fn verdict(searches: &Table, device: &str) -> String {
    let is_faster = |row: &&Vec<Value>| searches.number(row, "cpu_over_gpu").is_some_and(|ratio| ratio > 1.0);
    let (faster, slower): (Vec<_>, Vec<_>) = searches.rows.iter().partition(is_faster);
    let boxes = |row: &&Vec<Value>| searches.number(row, "boxes");
    let most = slower.iter().filter_map(boxes).fold(0.0, f64::max);
    match faster.iter().filter_map(boxes).find(|boxes| *boxes > most) {
        Some(boxes) => format!("The {device} is faster from {boxes} boxes on."),
        None if faster.is_empty() => format!("The CPU was faster than this {device} at every size."),
        None => format!("The {device} was faster in {} of {} cases.", faster.len(), searches.rows.len()),
    }
}

fn boxes(set: &str, n: usize) -> Vec<Aabb> {
    BoxSet::named(set).expect("a set of the harness").boxes(n, 1)
}

/// Returns the table of searches and that of their kernels: medians in ms of calls between which all boxes move. CPU and device take
/// turns; `steady_ms` is of calls of the device alone, one right after the other, as idle devices lower their clocks. `wait_ms`
/// leaves out the host's part. It and the columns after it are of the last of these calls, the times of kernels of calls after them.
fn searches(gpu: &GpuFinder, quick: bool) -> Result<[Table; 2], Failure> {
    let columns = "set | boxes | pairs | cpu_ms | gpu_ms | cpu_over_gpu | steady_ms | wait_ms | upload_ms | plan_ms | record_ms | decode_ms | uploaded_bytes | downloaded_bytes | device_bytes";
    let mut table = Table::new("searches", columns);
    let mut kernels = Table::new("kernels", "set | boxes | kernel | kernel_ms");
    for (n, set) in tracked(cases(gpu.is_software(), quick), "sets") {
        let Some(Searched { ms: [cpu, on_gpu, steady], pairs, report }) = search(gpu, set, n)? else {
            table.row(cells![set, n]);
            continue;
        };
        let times = cells![set, n, pairs, cpu, on_gpu, cpu / on_gpu, steady];
        let parts = [report.wait, report.upload, report.plan, report.record, report.decode];
        let bytes = cells![report.uploaded, report.downloaded, report.device_bytes];
        table.row(cells![..times, ..parts.map(milliseconds), ..bytes]);
        for (name, time) in &report.kernels {
            kernels.row(cells![set, n, *name, milliseconds(*time)]);
        }
    }
    Ok([table, kernels])
}

struct Searched {
    /// Medians on the CPU and on the device in turn, and on the device alone.
    ms: [f64; 3],
    pairs: usize,
    /// Report of the last call, with the times of kernels.
    report: DeviceReport,
}

/// Measures both backends on the same boxes, in turn. Returns none, and says why, if the device leaves them to the CPU.
fn search(gpu: &GpuFinder, set: &str, n: usize) -> Result<Option<Searched>, Failure> {
    let start = boxes(set, n);
    let frames = [moved(&start, 1.0, 2), start];
    let mut on_cpu = Finder::new(Config { backend: Backend::Cpu, ..CONFIG });
    let mut on_gpu = Finder::with_device(ON_GPU, Box::new(gpu.clone()));
    let mut times = [vec![], vec![]];
    for round in 0..if n > 100_000 { 4 } else { 7 } {
        let boxes = &frames[round % 2];
        let round_times = [time(&mut on_cpu, boxes)?, time(&mut on_gpu, boxes)?];
        if let Some(why) = on_gpu.report().fallback.as_ref().filter(|why| why.starts_with(DECLINED)) {
            eprintln!("{set}, {n} boxes: {why}");
            return Ok(None);
        }
        on_device(on_gpu.report())?;
        check(on_cpu.pairs() == on_gpu.pairs(), || format!("{set} {n}: CPU and GPU differ"))?;
        // The first round compiles, allocates and learns.
        if round > 0 {
            times.iter_mut().zip(round_times).for_each(|(times, ms)| times.push(ms));
        }
    }
    let rounds = if gpu.is_software() { 2 } else { 10 };
    let repeat = |finder: &mut Finder| -> Result<Vec<f64>, Failure> {
        // The last call has seen the first frame.
        (1..=rounds).map(|round| time(finder, &frames[round % 2])).collect()
    };
    let [cpu, both] = times.map(|times| Spread::of(times).median);
    let steady = Spread::of(repeat(&mut on_gpu)?).median;
    let mut report = on_device(on_gpu.report())?.clone();
    let pairs = on_gpu.pairs().len();
    // Calls whose kernels are timed take longer.
    let options = GpuOptions { time_kernels: true, ..GpuOptions::DEFAULT };
    let mut timed = Finder::with_device(ON_GPU, Box::new(gpu.clone().with_options(options)));
    repeat(&mut timed)?;
    report.kernels.clone_from(&on_device(timed.report())?.kernels);
    Ok(Some(Searched { ms: [cpu, both, steady], pairs, report }))
}

fn time(finder: &mut Finder, boxes: &[Aabb]) -> Result<f64, Failure> {
    let (found, ms) = timed(|| finder.find(boxes).map(|_| ()));
    Ok(found.map(|()| ms)?)
}

/// Returns the report of the device. If the device left the call to the CPU, this is an error.
fn on_device(report: &Report) -> Result<&DeviceReport, Failure> {
    let why = || Failure::Check(report.fallback.clone().unwrap_or_else(|| "the CPU did the work".into()));
    report.device.as_ref().ok_or_else(why)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quick_run_on_hardware_reaches_sizes_at_which_a_gpu_pays() {
        let largest = |is_software, quick| cases(is_software, quick).last().copied();
        assert_eq!(largest(false, true), Some((1_000_000, "mixed")));
        assert_eq!(largest(true, true), Some((10_000, "mixed")));
    }

    #[test]
    fn the_verdict_names_the_size_beyond_every_slower_case() {
        let of = |ratios: [Option<f64>; 4]| {
            let mut table = Table::new("searches", "set | boxes | cpu_over_gpu");
            for (i, ratio) in ratios.into_iter().enumerate() {
                table.row(cells!["a set", [1000, 100_000][i / 2], ratio]);
            }
            verdict(&table, "GPU")
        };
        assert_eq!(of([0.1, 2.0, 1.5, 3.0].map(Some)), "The GPU is faster from 100000 boxes on.");
        assert_eq!(of([2.0; 4].map(Some)), "The GPU is faster from 1000 boxes on.");
        assert_eq!(of([0.1; 4].map(Some)), "The CPU was faster than this GPU at every size.");
        assert_eq!(of([Some(0.1), Some(2.0), Some(3.0), None]), "The GPU was faster in 2 of 4 cases.");
    }
}
