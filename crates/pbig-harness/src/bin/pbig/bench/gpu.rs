//! `pbig bench gpu`: the GPU beside the CPU, stage by stage, and the floor below both.

mod charts;
pub(super) mod events;

use super::machine::slug;
use super::{Args, DOCUMENTS, keep};
use crate::output::{Failure, print, progress};
use pbig_core::{Aabb, Backend, Config, Finder, GpuFinder, GpuReport, Limits};
use pbig_harness::boxes::{BoxSet, moved};
use pbig_harness::kernels::Bench;
use pbig_harness::runner::{Spread, milliseconds};
use serde_json::{Value, json};
use std::path::Path;
use std::time::{Duration, Instant};

/// One set at one size.
struct Row {
    set: &'static str,
    boxes: usize,
    pairs: u64,
    cpu: Spread,
    /// All boxes have moved since the call before.
    gpu: Spread,
    /// None has, so nothing is sent.
    still: Spread,
    /// The report on the last call with all boxes moved.
    report: GpuReport,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let gpu = GpuFinder::new().map_err(|error| Failure::Input(error.to_string()))?;
    let rate = Bench::new().and_then(|bench| bench.copy_rate(256 << 20));
    let rate = rate.map_err(|error| Failure::Input(error.to_string()))?;
    let sizes: &[usize] =
        if args.quick { &[1000, 10_000] } else { &[1000, 10_000, 100_000, 1_000_000, 10_000_000] };
    let rows = rows(&gpu, sizes)?;
    let updates = events::rows(&gpu, args.quick)?;
    let object = object(&gpu, rate, &rows, &updates);
    if args.json {
        print(&object.to_string())?
    } else {
        let tables = [table(&gpu, rate, &rows), events::table(&updates), charts::in_words(&rows, &updates)];
        print(&tables.join("\n"))?
    }
    if args.quick {
        return Ok(());
    }
    let name = format!("gpu-{}", slug(gpu.adapter()));
    keep(&name, &object, args.json)?;
    for chart in charts::both(&name, gpu.adapter(), &rows, &updates) {
        chart.write(&Path::new(DOCUMENTS).join(format!("{}.svg", chart.name)))?;
    }
    Ok(())
}

/// Ten million boxes take minutes on a program that plays a GPU, and tell nothing.
fn most_boxes(gpu: &GpuFinder) -> usize {
    if gpu.is_software() { 1_000_000 } else { usize::MAX }
}

fn rows(gpu: &GpuFinder, sizes: &[usize]) -> Result<Vec<Row>, Failure> {
    let sets = ["uniform", "gaussian", "mixed"];
    let sizes = sizes.iter().filter(|&&boxes| boxes <= most_boxes(gpu));
    let cases: Vec<_> = sizes.flat_map(|&boxes| sets.map(|set| (set, boxes))).collect();
    let bar = progress(cases.len(), "sets");
    let row = |&(set, boxes): &(&'static str, usize)| {
        let row = measure(gpu, set, boxes);
        bar.inc(1);
        row
    };
    let rows = cases.iter().map(row).collect();
    bar.finish_and_clear();
    rows
}

/// Both backends on the same boxes, in turn. In every other round all boxes have moved, as they do in a
/// world: the device must get them anew. In the rounds between they are the same again.
fn measure(gpu: &GpuFinder, name: &'static str, n: usize) -> Result<Row, Failure> {
    let start = BoxSet::named(name).expect("a set of the harness").boxes(n, 1);
    let frames = [moved(&start, 1.0, 2), start];
    let config = |backend| Config { backend, limits: Limits::UNLIMITED, ..Config::DEFAULT };
    let mut on_cpu = Finder::new(config(Backend::Cpu));
    let mut on_gpu = Finder::with_gpu(config(Backend::Gpu), gpu.clone());
    let rounds = if n > 100_000 { 4 } else { 7 };
    let (mut cpu, mut all_moved, mut still) = (Vec::new(), Vec::new(), Vec::new());
    let mut report = GpuReport::default();
    for round in 0..rounds {
        let boxes = &frames[round % 2];
        let times = [time(&mut on_cpu, boxes, name)?, time(&mut on_gpu, boxes, name)?];
        report = did(&on_gpu, name, n)?;
        let unchanged = time(&mut on_gpu, boxes, name)?;
        did(&on_gpu, name, n)?;
        if on_cpu.pairs() != on_gpu.pairs() {
            return Err(Failure::Check(format!("{name} {n}: CPU and GPU differ")));
        }
        // The first round compiles, allocates and learns.
        if round > 0 {
            cpu.push(times[0]);
            all_moved.push(times[1]);
            still.push(unchanged);
        }
    }
    let (cpu, gpu, still) = (Spread::of(cpu), Spread::of(all_moved), Spread::of(still));
    Ok(Row { set: name, boxes: n, pairs: on_gpu.report().pairs, cpu, gpu, still, report })
}

fn time(finder: &mut Finder, boxes: &[Aabb], name: &str) -> Result<f64, Failure> {
    let clock = Instant::now();
    let found = finder.find(boxes).map(|_| milliseconds(clock.elapsed()));
    found.map_err(|error| Failure::Input(format!("{name} {}: {error}", boxes.len())))
}

/// Returns the report of the device. A call that it left to the CPU is no measurement, but an error.
fn did(finder: &Finder, name: &str, n: usize) -> Result<GpuReport, Failure> {
    let report = finder.report();
    let why = || report.fallback.clone().unwrap_or_default();
    report.gpu.clone().ok_or_else(|| Failure::Check(format!("{name} {n}: {}", why())))
}

/// Time for the bytes that a call must move on the device whatever the algorithm: boxes read once, pairs
/// written once, at the rate at which copies read and write.
fn floor_ms(row: &Row, rate: f64) -> f64 {
    (24 * row.boxes as u64 + 8 * row.pairs) as f64 / rate * 1e3
}

fn table(gpu: &GpuFinder, rate: f64, rows: &[Row]) -> String {
    let mut lines = vec![
        format!("{}, copies {:.1} GB/s", gpu.adapter(), rate / 1e9),
        "medians in ms; gpu: all boxes moved; still: none; x: cpu / gpu; floor: boxes read and pairs written at\n\
         the device's copy rate; upload to kernels: of the last call with all boxes moved"
            .into(),
        format!(
            "{:<9} {:>9} {:>10} {:>9} {:>9} {:>9} {:>6} {:>8} {:>7} {:>7} {:>7}  kernels",
            "set", "boxes", "pairs", "cpu", "gpu", "still", "x", "floor", "upload", "wait", "decode"
        ),
    ];
    for row in rows {
        let kernels: Vec<String> = row
            .report
            .kernels
            .iter()
            .map(|(name, time)| format!("{name} {:.3}", milliseconds(*time)))
            .collect();
        lines.push(format!(
            "{:<9} {:>9} {:>10} {:>9.3} {:>9.3} {:>9.3} {:>6.2} {:>8.4} {:>7.3} {:>7.3} {:>7.3}  {}",
            row.set,
            row.boxes,
            row.pairs,
            row.cpu.median,
            row.gpu.median,
            row.still.median,
            row.cpu.median / row.gpu.median,
            floor_ms(row, rate),
            milliseconds(row.report.upload),
            milliseconds(row.report.wait),
            milliseconds(row.report.decode),
            kernels.join(", ")
        ));
    }
    if gpu.is_software() {
        lines.push("this adapter is software: right answers, meaningless times".into());
    }
    lines.join("\n")
}

fn milliseconds_of(kernels: &[(&'static str, Duration)]) -> Value {
    let named = kernels.iter().map(|(name, time)| ((*name).to_owned(), json!(milliseconds(*time))));
    named.collect::<serde_json::Map<_, _>>().into()
}

fn object(gpu: &GpuFinder, rate: f64, rows: &[Row], updates: &[events::Row]) -> Value {
    let row = |row: &Row| {
        json!({
            "set": row.set, "boxes": row.boxes, "pairs": row.pairs,
            "cpu_ms": row.cpu, "gpu_ms": row.gpu, "gpu_still_ms": row.still, "ratio": row.cpu.median / row.gpu.median,
            "floor_ms": floor_ms(row, rate),
            "upload_ms": milliseconds(row.report.upload),
            "wait_ms": milliseconds(row.report.wait),
            "decode_ms": milliseconds(row.report.decode),
            "kernels_ms": milliseconds_of(&row.report.kernels),
            "uploaded": row.report.uploaded, "downloaded": row.report.downloaded,
            "device_bytes": row.report.device_bytes, "compression": row.report.compression,
            "chunks": row.report.chunks, "parts": row.report.parts,
        })
    };
    json!({
        "suite": "gpu",
        "adapter": gpu.adapter(),
        "software": gpu.is_software(),
        "threads": rayon::current_num_threads(),
        "copy_bytes_per_s": rate,
        "rows": rows.iter().map(row).collect::<Vec<_>>(),
        "events": updates.iter().map(events::object).collect::<Vec<_>>(),
    })
}
