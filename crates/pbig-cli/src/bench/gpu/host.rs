//! The host's part of a call: everything but waiting for the device.

use super::{frames, on_device, sizes, time};
use pbig_core::{Backend, BroadPhase, Config, Finder, GpuFinder, GpuReport, Limits, Order, ProxyFilter};
use pbig_harness::bench::timed;
use pbig_harness::cells;
use pbig_harness::output::{Failure, progress};
use pbig_harness::runner::{Spread, milliseconds};
use pbig_harness::table::Table;

/// Calls that are measured, and calls before these, which allocate and plan.
const ROUNDS: usize = 6;
const WARM_UP: usize = 3;

/// Share of the boxes that move in an update, in percent.
const MOVED_PERCENT: u32 = 1;

/// Medians in ms. `host` is the call without `wait`, `order` the sort of pairs that the device has left unsorted.
const COLUMNS: [&str; 9] =
    ["call", "boxes", "pairs", "host_ms", "upload_ms", "plan_ms", "record_ms", "decode_ms", "order_ms"];

/// The host's times of a call.
type Times = [f64; 6];

/// Returns the table: searches of moved boxes, unsorted and sorted, and updates in which few move.
pub(super) fn table(gpu: &GpuFinder, quick: bool) -> Result<Table, Failure> {
    let all: &[usize] = if quick { &[10_000] } else { &[10_000, 100_000, 1_000_000, 10_000_000] };
    let all: Vec<usize> = sizes(gpu, all).collect();
    let bar = progress(3 * all.len(), "calls");
    let mut table = Table::new("host", COLUMNS);
    for boxes in all {
        for (call, order) in [("unsorted", Order::Unspecified), ("sorted", Order::Sorted)] {
            let (times, pairs) = searches(gpu, boxes, order)?;
            add(&mut table, call, boxes, pairs, &times);
            bar.inc(1);
        }
        let (times, pairs) = updates(gpu, boxes)?;
        add(&mut table, "update, 1% moved", boxes, pairs, &times);
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(table)
}

fn add(table: &mut Table, call: &str, boxes: usize, pairs: usize, times: &[Times]) {
    let median = |k: usize| Spread::of(times.iter().map(|times| times[k]).collect::<Vec<f64>>()).median;
    let mut row = cells![call, boxes, pairs];
    row.extend((0..6).flat_map(|k| cells![median(k)]));
    table.row(row);
}

/// Splits the time of a call.
fn split(ms: f64, report: &GpuReport, emit: f64) -> Times {
    let [wait, upload, plan, record, decode] =
        [report.wait, report.upload, report.plan, report.record, report.decode].map(milliseconds);
    [ms - wait, upload, plan, record, decode, emit]
}

fn searches(gpu: &GpuFinder, boxes: usize, order: Order) -> Result<(Vec<Times>, usize), Failure> {
    let frames = frames("unit", boxes);
    let config = Config { backend: Backend::Gpu, limits: Limits::UNLIMITED, order, ..Config::DEFAULT };
    let mut finder = Finder::with_gpu(config, gpu.clone());
    let mut times = Vec::new();
    for round in 0..WARM_UP + ROUNDS {
        let ms = time(&mut finder, &frames[round % 2])?;
        let emit = milliseconds(finder.report().stages.emit);
        times.push(split(ms, &on_device(&finder)?, emit));
    }
    Ok((times.split_off(WARM_UP), finder.pairs().len()))
}

/// Measures updates without the calls that set the boxes.
fn updates(gpu: &GpuFinder, boxes: usize) -> Result<(Vec<Times>, usize), Failure> {
    let [moved, start] = frames("unit", boxes);
    let config = Config { backend: Backend::Gpu, limits: Limits::UNLIMITED, ..Config::DEFAULT };
    let mut broad_phase = BroadPhase::with_gpu(config, gpu.clone())?;
    let ids: Vec<u32> = (0..boxes as u32).collect();
    broad_phase.set_many(&ids, |id| Some((start[id as usize], ProxyFilter::ALL)))?;
    broad_phase.update()?;
    let mut times = Vec::new();
    for round in 0..WARM_UP + ROUNDS {
        let every = 100 / MOVED_PERCENT;
        let movers: Vec<u32> = ids.iter().copied().filter(|id| id % every == round as u32).collect();
        broad_phase.set_many(&movers, |id| Some((moved[id as usize], ProxyFilter::ALL)))?;
        let (done, ms) = timed(|| broad_phase.update().map(|_| ()));
        done?;
        let report = broad_phase.report();
        let why = || Failure::Check(report.fallback.clone().unwrap_or_default());
        times.push(split(ms, report.gpu.as_ref().ok_or_else(why)?, 0.0));
    }
    Ok((times.split_off(WARM_UP), broad_phase.pair_count()))
}
