//! The memory that finding pairs takes, measured in a process that does nothing else.

use clap::ValueEnum;
use pbig_core::{Aabb, BroadPhase, Config, Finder, Limits, Order, ProxyFilter};
use pbig_harness::bench::alone;
use pbig_harness::boxes::BoxSet;
use pbig_harness::output::{Failure, print};
use pbig_harness::table::Table;
use serde_json::{Value, json};
use std::process::Command;

/// Updates of the incremental probes: enough for every buffer to reach its size.
const UPDATES: usize = 30;

/// The distance that a box moves in one update.
const STEP: f32 = 0.1;

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Which way in.
    #[arg(value_enum)]
    way: Way,
    /// Number of boxes, of the set `unit`.
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

/// The motion of boxes: each so many-th, by so much, by its id and the update.
#[derive(Clone, Copy)]
pub(super) struct Motion {
    one_in: usize,
    by: fn(usize, usize) -> [f32; 3],
}

impl Motion {
    const TO_AND_FRO: Self = Self { one_in: 1, by: to_and_fro };
    const DRIFT: Self = Self { one_in: 1, by: drift };
    const FEW_DRIFT: Self = Self { one_in: 10, by: drift };

    /// Those that stay about where they are, for ever: a world that drifts apart needs another plan now and then.
    pub(super) const STEADY: [(&str, Self); 3] = [
        ("all moved", Self::TO_AND_FRO),
        ("all circle", Self { one_in: 1, by: circle }),
        ("10% circle", Self { one_in: 10, by: circle }),
    ];
}

/// Appends the peaks beyond the boxes given; they are empty where the system does not tell them.
pub(super) fn rows(quick: bool, table: &mut Table) -> Result<(), Failure> {
    let [few, many] = if quick { [10_000, 100_000] } else { [1_000_000, 10_000_000] };
    for (way, case, boxes) in [
        (Way::Incremental, "memory, incremental, all moved", few),
        (Way::Drift, "memory, incremental, all drift", few),
        (Way::FewDrift, "memory, incremental, 10% drift", few),
        (Way::Scratch, "memory, from scratch", many),
    ] {
        let object = in_child(way, boxes)?;
        let (pairs, bytes) = (object["pairs"].as_u64().unwrap_or(0), object["bytes"].as_f64());
        table.row(alone(case, boxes, pairs, "MB", bytes.map(|bytes| bytes / 1e6)));
    }
    Ok(())
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
        Way::Incremental => incremental(&boxes, Motion::TO_AND_FRO),
        Way::Drift => incremental(&boxes, Motion::DRIFT),
        Way::FewDrift => incremental(&boxes, Motion::FEW_DRIFT),
        Way::Scratch => from_scratch(&boxes),
    };
    let pairs = found.map_err(|error| Failure::Input(error.to_string()))?;
    let bytes = before.zip(resident("VmHWM:")).map(|(before, peak)| peak.saturating_sub(before));
    print(&json!({ "boxes": args.boxes, "pairs": pairs, "bytes": bytes }).to_string())
}

fn incremental(boxes: &[Aabb], motion: Motion) -> Result<usize, pbig_core::Error> {
    let mut moving = Moving::new(boxes, motion)?;
    (1..UPDATES).try_for_each(|_| moving.update())?;
    Ok(moving.pairs())
}

/// A broad phase of boxes that move.
pub(super) struct Moving<'a> {
    boxes: &'a [Aabb],
    motion: Motion,
    broad_phase: BroadPhase,
    updates: usize,
}

impl<'a> Moving<'a> {
    /// With all boxes where they begin.
    pub(super) fn new(boxes: &'a [Aabb], motion: Motion) -> Result<Self, pbig_core::Error> {
        let broad_phase = BroadPhase::new(Config { limits: Limits::UNLIMITED, ..Config::DEFAULT })?;
        let mut moving = Self { boxes, motion, broad_phase, updates: 0 };
        moving.set(1)?;
        Ok(moving)
    }

    /// All that move have moved.
    pub(super) fn update(&mut self) -> Result<(), pbig_core::Error> {
        self.set(self.motion.one_in)
    }

    fn set(&mut self, one_in: usize) -> Result<(), pbig_core::Error> {
        for (id, aabb) in self.boxes.iter().enumerate().step_by(one_in) {
            // Without a second list of boxes.
            let by = (self.motion.by)(id, self.updates);
            let add = |corner: [f32; 3]| std::array::from_fn(|k| corner[k] + by[k]);
            let moved = Aabb::new(add(aabb.min), add(aabb.max));
            self.broad_phase.set(id as u32, moved, ProxyFilter::ALL)?;
        }
        self.updates += 1;
        self.broad_phase.update().map(|_| ())
    }

    pub(super) fn pairs(&self) -> usize {
        self.broad_phase.pair_count()
    }
}

/// Neighbours apart from each other.
fn to_and_fro(id: usize, update: usize) -> [f32; 3] {
    [if (id + update).is_multiple_of(2) { STEP } else { 0.0 }; 3]
}

/// Around a place beside where it began, about two edges wide.
fn circle(id: usize, update: usize) -> [f32; 3] {
    let (sin, cos) = (STEP * update as f32 + id as f32).sin_cos();
    [cos, sin, 0.0]
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
