//! The memory that finding pairs takes, measured in a process that does nothing else; and requests for memory in a steady state.

use pbig_core::{Aabb, BroadPhase, Config, Error, Finder, Limits, Order, ProxyFilter};
use pbig_harness::counting::{self, requests};
use pbig_harness::prelude::*;
use serde_json::{Value, json};
use std::process::Command;

/// The distance that a box moves in one update.
const STEP: f32 = 0.1;

/// The step from one moving id to the next, and the displacement of a box by its id and the update.
type Movement = (usize, fn(usize, usize) -> [f32; 3]);

/// The probes: the case in the table, and the motion. A probe without a motion is a search from nothing.
const PROBES: [(&str, Option<Movement>); 4] = [
    ("memory, incremental, all moved", Some((1, to_and_fro))),
    ("memory, incremental, all drift", Some((1, drift))),
    ("memory, incremental, 10% drift", Some((10, drift))),
    ("memory, from scratch", None),
];

/// Motions of boxes that stay near their places, because a world that drifts apart sometimes needs another plan.
const STEADY: [(&str, Movement); 3] =
    [("all moved", (1, to_and_fro)), ("all circle", (1, circle)), ("10% circle", (10, circle))];

/// Moves neighbours apart from each other.
fn to_and_fro(id: usize, update: usize) -> [f32; 3] {
    [if (id + update).is_multiple_of(2) { STEP } else { 0.0 }; 3]
}

/// Moves around a place beside where it began, about two edges wide.
fn circle(id: usize, update: usize) -> [f32; 3] {
    let (sin, cos) = (STEP * update as f32 + id as f32).sin_cos();
    [cos, sin, 0.0]
}

/// Moves along one of eight diagonals.
fn drift(id: usize, update: usize) -> [f32; 3] {
    let far = STEP * update as f32;
    [0, 1, 2].map(|axis| if id >> axis & 1 == 0 { far } else { -far })
}

#[derive(clap::Args)]
pub(crate) struct Args {
    /// The probe.
    #[arg(value_parser = PROBES.map(|(case, _)| case))]
    case: String,
    /// Number of boxes, of the set `unit`.
    boxes: usize,
}

fn unit(n: usize) -> Vec<Aabb> {
    BoxSet::named("unit").expect("a set of the harness").boxes(n, 1)
}

/// Appends the peaks beyond the boxes given; they are empty where the system does not tell them.
pub(super) fn peaks(quick: bool, table: &mut Table) -> Result<(), Failure> {
    let [few, many] = if quick { [10_000, 100_000] } else { [1_000_000, 10_000_000] };
    for (case, motion) in PROBES {
        let boxes = if motion.is_some() { few } else { many };
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
    let boxes = unit(args.boxes);
    let before = resident("VmRSS:");
    // This resets Linux's count of the peak. Where it is not allowed, the count is still right: making the boxes took less memory
    // than the probe.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
    let pairs = match PROBES.into_iter().find(|(case, _)| *case == args.case) {
        Some((_, Some(motion))) => {
            let mut moving = Moving::new(&boxes, motion)?;
            // Enough for every buffer to reach its size.
            (1..30).try_for_each(|_| moving.update())?;
            moving.broad_phase.pair_count()
        }
        _ => {
            let config = Config { limits: Limits::UNLIMITED, order: Order::Unspecified, ..Config::DEFAULT };
            Finder::new(config).find(&boxes)?.len()
        }
    };
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

/// A broad phase of boxes that move.
struct Moving<'a> {
    boxes: &'a [Aabb],
    motion: Movement,
    broad_phase: BroadPhase,
    updates: usize,
}

impl<'a> Moving<'a> {
    /// Sets all boxes where they begin.
    fn new(boxes: &'a [Aabb], motion: Movement) -> Result<Self, Error> {
        let broad_phase = BroadPhase::new(Config { limits: Limits::UNLIMITED, ..Config::DEFAULT })?;
        let mut moving = Self { boxes, motion: (1, motion.1), broad_phase, updates: 0 };
        moving.update()?;
        moving.motion = motion;
        Ok(moving)
    }

    fn update(&mut self) -> Result<(), Error> {
        let (one_in, by) = self.motion;
        for (id, aabb) in self.boxes.iter().enumerate().step_by(one_in) {
            // Without a second list of boxes.
            let by = by(id, self.updates);
            let add = |corner: [f32; 3]| std::array::from_fn(|k| corner[k] + by[k]);
            self.broad_phase.set(id as u32, Aabb::new(add(aabb.min), add(aabb.max)), ProxyFilter::ALL)?;
        }
        self.updates += 1;
        self.broad_phase.update().map(|_| ())
    }
}

/// Updates before counting, in which buffers grow to their size, and updates that are counted.
const WARM_UP: usize = 400;
const COUNTED: usize = 200;

/// Appends the numbers of requests for memory. On one thread it should be zero. On several, rayon asks for memory to hand work from
/// thread to thread.
pub(super) fn requests_in_steady_state(quick: bool, table: &mut Table) -> Result<(), Failure> {
    counting::switch_on();
    let (boxes, all) = (if quick { 5000 } else { 100_000 }, rayon::current_num_threads());
    let threads: &[usize] = if all > 1 { &[1, all] } else { &[1] };
    let cases = threads.iter().flat_map(|threads| STEADY.map(|motion| (*threads, motion)));
    for (threads, (name, motion)) in cases {
        let (count, pairs) = crate::options::with_threads(Some(threads), || Ok(counted(motion, boxes)?))?;
        let case = format!("requests for memory, {name}, {threads} threads, in {COUNTED} updates");
        table.row(alone(&case, boxes, pairs, "requests", Some(count as f64)));
    }
    Ok(())
}

/// Returns the requests of all threads of the pool in some updates, and the pairs afterwards.
fn counted(motion: Movement, boxes: usize) -> Result<(u64, u64), Error> {
    let boxes = unit(boxes);
    let mut moving = Moving::new(&boxes, motion)?;
    (0..WARM_UP).try_for_each(|_| moving.update())?;
    // To ask all threads takes some, too.
    let asking = so_far();
    let before = so_far();
    (0..COUNTED).try_for_each(|_| moving.update())?;
    let count = so_far() - before;
    Ok((count.saturating_sub(before - asking), moving.broad_phase.pair_count() as u64))
}

fn so_far() -> u64 {
    match rayon::current_num_threads() {
        1 => requests(),
        _ => rayon::broadcast(|_| requests()).into_iter().sum(),
    }
}
