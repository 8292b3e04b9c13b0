//! Part of `pbig bench gpu`: updates by the share that moves. The bytes that go up and come back should follow the number
//! of changed boxes, not the number of all boxes.

use super::{milliseconds_of, most_boxes};
use crate::output::{Failure, progress};
use pbig_core::{Aabb, Backend, BroadPhase, Config, GpuFinder, GpuReport, Limits, ProxyFilter};
use pbig_harness::boxes::{BoxSet, Wander};
use pbig_harness::runner::{Spread, milliseconds};
use serde_json::{Value, json};
use std::time::{Duration, Instant};

const SET: &str = "unit";

/// In edges.
const DISTANCE: f32 = 0.1;

const SHARES: [f64; 4] = [0.001, 0.01, 0.1, 1.0];

/// One share at one size: medians in ms of setting what has moved, and the update.
pub(in crate::bench) struct Row {
    pub(super) boxes: usize,
    pub(super) share: f64,
    pub(in crate::bench) pairs: usize,
    /// Pairs that came or went in the last round.
    events: usize,
    pub(in crate::bench) cpu: Spread,
    pub(in crate::bench) gpu: Spread,
    /// Values of the last round.
    report: GpuReport,
}

pub(super) fn rows(gpu: &GpuFinder, quick: bool) -> Result<Vec<Row>, Failure> {
    let sizes: &[usize] = if quick { &[10_000] } else { &[10_000, 100_000, 1_000_000, 10_000_000] };
    let sizes = sizes.iter().filter(|&&boxes| boxes <= most_boxes(gpu));
    let cases: Vec<_> = sizes.flat_map(|&boxes| SHARES.map(|share| (boxes, share))).collect();
    let bar = progress(cases.len(), "shares");
    let row = |&(boxes, share): &(usize, f64)| {
        let start = BoxSet::named(SET).expect("a set of the harness").boxes(boxes, 1);
        let row = race(gpu, start, share, DISTANCE);
        bar.inc(1);
        row
    };
    let rows = cases.iter().map(row).collect();
    bar.finish_and_clear();
    rows
}

/// A share of these boxes moves by up to a distance; a check that fails where CPU and GPU have different events.
pub(in crate::bench) fn race(
    gpu: &GpuFinder,
    start: Vec<Aabb>,
    share: f64,
    distance: f32,
) -> Result<Row, Failure> {
    Race::new(gpu, start, share, distance).and_then(Race::run)
}

/// Two broad phases that see the same boxes.
struct Race {
    cpu: BroadPhase,
    gpu: BroadPhase,
    wander: Wander,
    share: f64,
}

impl Race {
    fn new(gpu: &GpuFinder, start: Vec<Aabb>, share: f64, distance: f32) -> Result<Self, Failure> {
        let config = |backend| Config { backend, limits: Limits::UNLIMITED, ..Config::DEFAULT };
        let gpu = BroadPhase::with_gpu(config(Backend::Gpu), gpu.clone()).map_err(failure)?;
        let boxes = start.len();
        let wander = Wander::new(start, share, distance);
        let cpu = BroadPhase::new(config(Backend::Cpu)).map_err(failure)?;
        let mut race = Self { cpu, gpu, wander, share };
        let all: Vec<u32> = (0..boxes as u32).collect();
        for broad_phase in [&mut race.cpu, &mut race.gpu] {
            set(broad_phase, &all, &race.wander.boxes)?;
            broad_phase.update().map_err(failure)?;
        }
        Ok(race)
    }

    fn run(mut self) -> Result<Row, Failure> {
        let boxes = self.wander.boxes.len();
        let rounds = if boxes > 100_000 { 5 } else { 9 };
        let mut times: [Vec<f64>; 2] = Default::default();
        let mut report = GpuReport::default();
        for round in 0..rounds {
            let took = self.round(round)?;
            self.compare()?;
            report = did(&self.gpu)?;
            // The first rounds allocate and learn.
            if round > 1 {
                times.iter_mut().zip(took).for_each(|(times, took)| times.push(milliseconds(took)));
            }
        }
        let [cpu, gpu] = times.map(Spread::of);
        let (share, pairs) = (self.share, self.gpu.pair_count());
        let events = self.gpu.events().added.len() + self.gpu.events().removed.len();
        Ok(Row { boxes, share, pairs, events, cpu, gpu, report })
    }

    /// Returns the time of the update on each backend.
    fn round(&mut self, round: usize) -> Result<[Duration; 2], Failure> {
        let moved = self.wander.step(round);
        let boxes = &self.wander.boxes;
        Ok([update(&mut self.cpu, &moved, boxes)?, update(&mut self.gpu, &moved, boxes)?])
    }

    fn compare(&self) -> Result<(), Failure> {
        if self.cpu.events() == self.gpu.events() {
            return Ok(());
        }
        let (boxes, share) = (self.wander.boxes.len(), self.share);
        Err(Failure::Check(format!("events of {boxes} boxes, {share} moved: CPU and GPU differ")))
    }
}

fn failure(error: pbig_core::Error) -> Failure {
    Failure::Input(error.to_string())
}

fn update(broad_phase: &mut BroadPhase, moved: &[u32], boxes: &[Aabb]) -> Result<Duration, Failure> {
    let clock = Instant::now();
    set(broad_phase, moved, boxes)?;
    broad_phase.update().map_err(failure)?;
    Ok(clock.elapsed())
}

fn set(broad_phase: &mut BroadPhase, moved: &[u32], boxes: &[Aabb]) -> Result<(), Failure> {
    broad_phase.set_many(moved, |id| Some((boxes[id as usize], ProxyFilter::ALL))).map_err(failure)
}

/// Returns the report of the device. An update that it left to the CPU is no measurement, but an error.
fn did(broad_phase: &BroadPhase) -> Result<GpuReport, Failure> {
    let report = broad_phase.report();
    let why = || Failure::Check(format!("events: {}", report.fallback.as_deref().unwrap_or("on the CPU")));
    report.gpu.clone().ok_or_else(why)
}

pub(super) fn table(rows: &[Row]) -> String {
    let head = "events, medians in ms; x: cpu / gpu; up, back: bytes of the last round";
    let names = format!(
        "{:<9} {:>9} {:>6} {:>9} {:>9} {:>9} {:>9} {:>6} {:>10} {:>10}",
        "set", "boxes", "share", "pairs", "events", "cpu", "gpu", "x", "up", "back"
    );
    let line = |row: &Row| {
        format!(
            "{:<9} {:>9} {:>6} {:>9} {:>9} {:>9.3} {:>9.3} {:>6.2} {:>10} {:>10}",
            SET,
            row.boxes,
            row.share,
            row.pairs,
            row.events,
            row.cpu.median,
            row.gpu.median,
            row.cpu.median / row.gpu.median,
            row.report.uploaded,
            row.report.downloaded
        )
    };
    let lines = rows.iter().map(line);
    [head.into(), names].into_iter().chain(lines).collect::<Vec<_>>().join("\n")
}

pub(super) fn object(row: &Row) -> Value {
    json!({
        "set": SET, "boxes": row.boxes, "share": row.share, "pairs": row.pairs, "events": row.events,
        "cpu_ms": row.cpu, "gpu_ms": row.gpu, "ratio": row.cpu.median / row.gpu.median,
        "uploaded": row.report.uploaded, "downloaded": row.report.downloaded,
        "device_bytes": row.report.device_bytes, "kernels_ms": milliseconds_of(&row.report.kernels),
    })
}
