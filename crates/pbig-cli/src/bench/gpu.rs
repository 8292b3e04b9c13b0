//! `pbig bench gpu`: the GPU beside the CPU, kernel by kernel, and the floor below both.

mod events;
mod host;

use pbig_core::{Aabb, Backend, Config, Finder, GpuFinder, GpuOptions, GpuReport, Limits};
use pbig_harness::bench::timed;
use pbig_harness::boxes::{BoxSet, moved};
use pbig_harness::cells;
use pbig_harness::kernels::Bench;
use pbig_harness::output::{Failure, progress};
use pbig_harness::report::Report;
use pbig_harness::runner::{Spread, milliseconds};
use pbig_harness::table::Table;

/// Medians in ms, of calls between which all boxes move. The floor is the time to read all boxes and to write all pairs at the
/// device's copy rate. All after `floor` is of the last call.
const COLUMNS: [&str; 12] = [
    "set",
    "boxes",
    "pairs",
    "cpu_ms",
    "gpu_ms",
    "cpu_over_gpu",
    "floor_ms",
    "wait_ms",
    "uploaded_bytes",
    "downloaded_bytes",
    "device_bytes",
    "compression",
];

pub(super) fn run(quick: bool) -> Result<Report, Failure> {
    let gpu = GpuFinder::new().map_err(|error| Failure::Input(error.to_string()))?;
    let rate = Bench::new().and_then(|bench| bench.copy_rate(256 << 20));
    let rate = rate.map_err(|error| Failure::Input(error.to_string()))?;
    let [searches, kernels] = searches(&gpu, rate, quick)?;
    let tables = vec![searches, kernels, host::table(&gpu, quick)?, events::table(&gpu, quick)?];
    let head = vec![
        ("adapter", gpu.adapter().to_owned()),
        ("software", gpu.is_software().to_string()),
        ("copy_bytes_per_s", format!("{rate:.0}")),
    ];
    Ok(Report { head, ..Report::new("gpu", tables) })
}

/// Returns the numbers of boxes: ten million take minutes on a program that plays a GPU, and tell nothing.
fn sizes<'a>(gpu: &GpuFinder, all: &'a [usize]) -> impl Iterator<Item = usize> + use<'a> {
    let most = if gpu.is_software() { 1_000_000 } else { usize::MAX };
    all.iter().copied().filter(move |&boxes| boxes <= most)
}

/// Returns the table of searches, and that of their kernels.
fn searches(gpu: &GpuFinder, rate: f64, quick: bool) -> Result<[Table; 2], Failure> {
    let all: &[usize] = if quick { &[1000, 10_000] } else { &[1000, 10_000, 100_000, 1_000_000, 10_000_000] };
    let cases: Vec<_> =
        sizes(gpu, all).flat_map(|boxes| ["uniform", "gaussian", "mixed"].map(|set| (set, boxes))).collect();
    let (mut table, mut kernels) =
        (Table::new("searches", COLUMNS), Table::new("kernels", ["set", "boxes", "kernel", "kernel_ms"]));
    let bar = progress(cases.len(), "sets");
    for (set, n) in cases {
        let ([cpu, on_gpu], pairs, report) = measure(gpu, set, n)?;
        // Bytes that must move on the device whatever the algorithm.
        let floor = (24 * n as u64 + 8 * pairs) as f64 / rate * 1e3;
        let mut row = cells![set, n, pairs, cpu, on_gpu, cpu / on_gpu, floor, milliseconds(report.wait)];
        row.extend(cells![report.uploaded, report.downloaded, report.device_bytes, report.compression]);
        table.row(row);
        report
            .kernels
            .iter()
            .for_each(|(name, time)| kernels.row(cells![set, n, *name, milliseconds(*time)]));
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok([table, kernels])
}

/// Medians on the CPU and on the GPU, the pairs, and a report with the times of the kernels.
type Measured = ([f64; 2], u64, GpuReport);

/// Returns the boxes of a set, and the same after all have moved.
fn frames(name: &str, n: usize) -> [Vec<Aabb>; 2] {
    let start = BoxSet::named(name).expect("a set of the harness").boxes(n, 1);
    [moved(&start, 1.0, 2), start]
}

/// Measures both backends on the same boxes, in turn.
fn measure(gpu: &GpuFinder, name: &str, n: usize) -> Result<Measured, Failure> {
    let frames = frames(name, n);
    let config = |backend| Config { backend, limits: Limits::UNLIMITED, ..Config::DEFAULT };
    let mut on_cpu = Finder::new(config(Backend::Cpu));
    let mut on_gpu = Finder::with_gpu(config(Backend::Gpu), gpu.clone());
    let mut times = [vec![], vec![]];
    for round in 0..if n > 100_000 { 4 } else { 7 } {
        let boxes = &frames[round % 2];
        let round_times = [time(&mut on_cpu, boxes)?, time(&mut on_gpu, boxes)?];
        on_device(&on_gpu)?;
        if on_cpu.pairs() != on_gpu.pairs() {
            return Err(Failure::Check(format!("{name} {n}: CPU and GPU differ")));
        }
        // The first round compiles, allocates and learns.
        if round > 0 {
            times.iter_mut().zip(round_times).for_each(|(times, ms)| times.push(ms));
        }
    }
    let report = with_kernels(gpu, &frames)?;
    Ok((times.map(|times| Spread::of(times).median), on_cpu.pairs().len() as u64, report))
}

/// Returns the report of a call whose kernels are timed, which takes longer.
fn with_kernels(gpu: &GpuFinder, frames: &[Vec<Aabb>; 2]) -> Result<GpuReport, Failure> {
    let options = GpuOptions { time_kernels: true, ..GpuOptions::DEFAULT };
    let config = Config { backend: Backend::Gpu, limits: Limits::UNLIMITED, gpu: options, ..Config::DEFAULT };
    let mut finder = Finder::with_gpu(config, gpu.clone());
    for boxes in frames {
        time(&mut finder, boxes)?;
    }
    on_device(&finder)
}

fn time(finder: &mut Finder, boxes: &[Aabb]) -> Result<f64, Failure> {
    let (found, ms) = timed(|| finder.find(boxes).map(|_| ()));
    Ok(found.map(|()| ms)?)
}

/// Returns the report of the device. A call that the device left to the CPU is no measurement, but an error.
fn on_device(finder: &Finder) -> Result<GpuReport, Failure> {
    let report = finder.report();
    let why = || Failure::Check(report.fallback.clone().unwrap_or_default());
    report.gpu.clone().ok_or_else(why)
}
