//! How much memory finding pairs takes, measured in a process that does nothing else.

use super::table::{Row, Target, Unit};
use crate::output::{Failure, print};
use clap::ValueEnum;
use pbig_core::{Aabb, BroadPhase, Config, Finder, Limits, Order, ProxyFilter};
use pbig_harness::boxes::BoxSet;
use serde_json::{Value, json};
use std::process::Command;

/// Updates of the incremental probes: several lists of near pairs, where boxes drift.
const UPDATES: usize = 30;

/// How far a box moves in one.
const STEP: f32 = 0.1;

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Which way in.
    #[arg(value_enum)]
    way: Way,
    /// How many boxes, of the set `unit`.
    boxes: usize,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Way {
    /// A broad phase in which all boxes move to and fro for some updates.
    Incremental,
    /// All drift instead, each its own way.
    Drift,
    /// One in ten of them does.
    FewDrift,
    /// A finder, once.
    Scratch,
}

/// Its rows.
pub(crate) fn rows(quick: bool) -> Result<Vec<Row>, Failure> {
    let sizes = if quick { [10_000, 100_000] } else { [1_000_000, 10_000_000] };
    let target = |megabytes| (!quick).then_some(Target::Below(megabytes));
    Ok(vec![
        row(Way::Incremental, "memory, incremental, all moved", sizes[0])?.target(target(300.0)),
        row(Way::Drift, "memory, incremental, all drift", sizes[0])?.target(target(300.0)),
        row(Way::FewDrift, "memory, incremental, 10% drift", sizes[0])?.target(target(300.0)),
        row(Way::Scratch, "memory, from scratch", sizes[1])?.target(target(2500.0)),
    ])
}

fn row(way: Way, case: &str, boxes: usize) -> Result<Row, Failure> {
    let object = in_child(way, boxes)?;
    let pairs = object["pairs"].as_u64().unwrap_or(0);
    let row = Row::new(case, boxes, pairs).unit(Unit::Mb);
    Ok(match object["bytes"].as_f64() {
        Some(bytes) => row.ours(bytes / 1e6).note("peak beyond the boxes given"),
        None => row.note("not measured here"),
    })
}

/// A fresh process: in one that has measured other things, freed memory would hide what is used.
fn in_child(way: Way, boxes: usize) -> Result<Value, Failure> {
    let about = |error: &dyn std::fmt::Display| Failure::Input(format!("memory probe: {error}"));
    let program = std::env::current_exe().map_err(|error| about(&error))?;
    let name = way.to_possible_value().expect("none is skipped");
    let mut command = Command::new(program);
    command.args(["memory-probe", name.get_name(), &boxes.to_string()]);
    let output = command.output().map_err(|error| about(&error))?;
    if !output.status.success() {
        return Err(about(&String::from_utf8_lossy(&output.stderr)));
    }
    serde_json::from_slice(&output.stdout).map_err(|error| about(&error))
}

/// The child: one JSON object, `bytes` null where the system does not tell.
pub(crate) fn probe(args: &Args) -> Result<(), Failure> {
    let boxes = BoxSet::named("unit").expect("a set of the harness").boxes(args.boxes, 1);
    let before = resident("VmRSS:");
    // Linux then counts the peak from now on; where it may not, making the boxes had no higher one.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
    let found = match args.way {
        Way::Incremental => incremental(&boxes, 1, to_and_fro),
        Way::Drift => incremental(&boxes, 1, drift),
        Way::FewDrift => incremental(&boxes, 10, drift),
        Way::Scratch => from_scratch(&boxes),
    };
    let pairs = found.map_err(|error| Failure::Input(error.to_string()))?;
    let bytes = before.zip(resident("VmHWM:")).map(|(before, peak)| peak.saturating_sub(before));
    print(&json!({ "boxes": args.boxes, "pairs": pairs, "bytes": bytes }).to_string())
}

/// Of every `share`-th box, `motion` says how far it is from where it began: by its id and the update, on each axis.
fn incremental(
    boxes: &[Aabb],
    share: usize,
    motion: fn(usize, usize) -> [f32; 3],
) -> Result<usize, pbig_core::Error> {
    let mut broad_phase = BroadPhase::new(Config { limits: Limits::UNLIMITED, ..Config::DEFAULT })?;
    for update in 0..UPDATES {
        for (id, aabb) in boxes.iter().enumerate().step_by(if update == 0 { 1 } else { share }) {
            // Without a second list of boxes.
            let by = motion(id, update);
            let add = |corner: [f32; 3]| std::array::from_fn(|k| corner[k] + by[k]);
            broad_phase.set(id as u32, Aabb::new(add(aabb.min), add(aabb.max)), ProxyFilter::ALL)?;
        }
        broad_phase.update()?;
    }
    Ok(broad_phase.pair_count())
}

/// Neighbours apart from each other.
fn to_and_fro(id: usize, update: usize) -> [f32; 3] {
    [if (id + update).is_multiple_of(2) { STEP } else { 0.0 }; 3]
}

/// One of eight diagonals.
fn drift(id: usize, update: usize) -> [f32; 3] {
    let far = STEP * update as f32;
    [0, 1, 2].map(|axis| if id >> axis & 1 == 0 { far } else { -far })
}

fn from_scratch(boxes: &[Aabb]) -> Result<usize, pbig_core::Error> {
    let config = Config { limits: Limits::UNLIMITED, order: Order::Unspecified, ..Config::DEFAULT };
    Finder::new(config).find(boxes).map(<[_]>::len)
}

/// Bytes of this process as Linux counts them; none elsewhere.
fn resident(key: &str) -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix(key))?;
    let kilobytes: u64 = line.trim().trim_end_matches("kB").trim().parse().ok()?;
    Some(kilobytes * 1024)
}
