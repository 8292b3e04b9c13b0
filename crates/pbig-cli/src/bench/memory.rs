//! The memory that finding pairs takes, measured in a process that does nothing else.

use pbig_core::{Aabb, BroadPhase, Config, Finder, Limits, Order, ProxyFilter};
use pbig_harness::boxes::shifted;
use pbig_harness::prelude::*;
use serde_json::{Value, json};
use std::process::Command;

/// The probes: 30 updates in which all boxes move, and a search from nothing.
const PROBES: [&str; 2] = ["memory, incremental, all moved", "memory, from scratch"];

#[derive(clap::Args)]
pub(crate) struct Args {
    /// The probe.
    #[arg(value_parser = PROBES)]
    case: String,
    /// Number of boxes, of the set `unit`.
    boxes: usize,
}

/// Appends the peaks beyond the boxes given; they are empty where the system does not tell them.
pub(super) fn peaks(quick: bool, table: &mut Table) -> Result<(), Failure> {
    let numbers = if quick { [10_000, 100_000] } else { [1_000_000, 10_000_000] };
    for (case, boxes) in PROBES.into_iter().zip(numbers) {
        let object = in_child(case, boxes)?;
        let (pairs, bytes) = (object["pairs"].as_u64().unwrap_or(0), object["bytes"].as_f64());
        table.row(alone(case, boxes, pairs, "MB", bytes.map(|bytes| bytes / 1e6)));
    }
    Ok(())
}

/// Runs a probe in a fresh process: in one that has measured other things, freed memory would hide what is used.
fn in_child(case: &str, boxes: usize) -> Result<Value, Failure> {
    let about = |error: &dyn std::fmt::Display| Failure::Input(format!("memory probe: {error}"));
    let program = std::env::current_exe().map_err(|error| about(&error))?;
    let output = Command::new(program).args(["memory-probe", case, &boxes.to_string()]).output();
    let output = output.map_err(|error| about(&error))?;
    if !output.status.success() {
        return Err(about(&String::from_utf8_lossy(&output.stderr)));
    }
    serde_json::from_slice(&output.stdout).map_err(|error| about(&error))
}

/// The child: prints one JSON object, `bytes` null where the system does not tell.
pub(crate) fn probe(args: &Args) -> Result<(), Failure> {
    let boxes = BoxSet::named("unit").expect("a set of the harness").boxes(args.boxes, 1);
    let before = resident("VmRSS:");
    // This resets Linux's count of the peak. Where it is not allowed, the count is still right: making the boxes took less memory
    // than the probe.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
    let pairs = if args.case == PROBES[0] { pairs_of_updates(&boxes)? } else { pairs_of_a_search(&boxes)? };
    let bytes = before.zip(resident("VmHWM:")).map(|(before, peak)| peak.saturating_sub(before));
    print(&json!({ "boxes": args.boxes, "pairs": pairs, "bytes": bytes }).to_string())
}

/// Returns bytes of this process as Linux counts them; none elsewhere.
fn resident(key: &str) -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix(key))?;
    let kilobytes: u64 = line.trim().trim_end_matches("kB").trim().parse().ok()?;
    Some(kilobytes * 1024)
}

fn pairs_of_a_search(boxes: &[Aabb]) -> Result<usize, Failure> {
    let config = Config { limits: Limits::UNLIMITED, order: Order::Unspecified, ..Config::DEFAULT };
    Ok(Finder::new(config).find(boxes)?.len())
}

/// Moves neighbours apart from each other, and back, in updates in which every buffer reaches its size.
fn pairs_of_updates(boxes: &[Aabb]) -> Result<usize, Failure> {
    let mut broad_phase = BroadPhase::new(Config { limits: Limits::UNLIMITED, ..Config::DEFAULT })?;
    for update in 0..30 {
        for (id, aabb) in boxes.iter().enumerate() {
            let by = if (id + update).is_multiple_of(2) { 0.1 } else { 0.0 };
            broad_phase.set(id as u32, shifted(aabb, [by; 3]), ProxyFilter::ALL)?;
        }
        broad_phase.update()?;
    }
    Ok(broad_phase.pair_count())
}
