//! The report of a call: times, counts and the plan.

use crate::Plan;
#[cfg(all(target_family = "wasm", target_os = "unknown"))]
use crate::page_clock::Instant;
use std::time::Duration;
#[cfg(not(all(target_family = "wasm", target_os = "unknown")))]
use std::time::Instant;

/// Wall time of each stage of the last call. All zero on wasm32-unknown-unknown, unless the page gives a clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct StageTimes {
    /// Measuring the boxes and choosing the cells.
    pub plan: Duration,
    /// Sorting boxes into cells.
    pub map: Duration,
    /// Testing candidates.
    pub check: Duration,
    /// Bringing the pairs into their order.
    pub emit: Duration,
    /// Turning states into events ([`crate::BroadPhase`] only).
    pub diff: Duration,
}

impl StageTimes {
    /// Returns the stages by name, in the order in which they run.
    pub fn named(&self) -> [(&'static str, Duration); 5] {
        [
            ("plan", self.plan),
            ("map", self.map),
            ("check", self.check),
            ("emit", self.emit),
            ("diff", self.diff),
        ]
    }
}

/// A `tracing` span, target `pbig`, that lasts for the rest of the block: one for each stage, so that a
/// profiler shows them. Without a subscriber it costs a comparison. With a report, the span lasts for an expression, whose time is added
/// to the stage of that name.
macro_rules! stage {
    ($name:expr) => {
        let _span = tracing::debug_span!(target: "pbig", $name).entered();
    };
    ($report:expr, $stage:ident, $work:expr) => {{
        let mut clock = $crate::report::Clock::start();
        let result = {
            $crate::report::stage!(stringify!($stage));
            $work
        };
        $report.stages.$stage += clock.lap();
        result
    }};
}
pub(crate) use stage;

/// A stopwatch for reports and for the pause of a device. It stands still where there is no clock: on wasm32-unknown-unknown,
/// unless the page gives one.
#[derive(Debug)]
pub struct Clock {
    last: Instant,
}

impl Clock {
    /// Starts a stopwatch.
    pub fn start() -> Self {
        Self { last: Instant::now() }
    }

    /// Returns the time since the last lap, or the start.
    pub fn lap(&mut self) -> Duration {
        let now = Instant::now();
        now.duration_since(std::mem::replace(&mut self.last, now))
    }

    /// Returns the time since the last lap, or the start; none where there is no clock.
    pub fn time(&self) -> Option<Duration> {
        #[cfg(all(target_family = "wasm", target_os = "unknown"))]
        if !crate::page_clock::is_set() {
            return None;
        }
        Some(Instant::now().duration_since(self.last))
    }
}

/// Counts of box tests, as PBIG's section 4.1 defines them. On the CPU's grid most tests compare codes, which tell that two
/// boxes are apart or may overlap. The exact test of a pair that may overlap is not counted again.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Checks {
    /// Box pairs tested, counting each test.
    pub made: u64,
    /// UC: tests of two boxes that do not overlap.
    pub unnecessary: u64,
    /// RC: repeated tests of one pair in another cell; 0 without duplicated entries.
    pub redundant: u64,
}

/// Maximum [`Report::work`] for each box and pair, in binary logarithms of the number of boxes, for every shape, motion and history
/// of the boxes. Changes count as boxes where they are more. A pair counts if its boxes overlap, also if filters or keys exclude it. docs/ARCHITECTURE.md says for which numbers
/// of boxes it holds, and why.
pub const WORK_LIMIT: u64 = 256;

/// The report on the last call of a [`crate::Finder`] or [`crate::BroadPhase`].
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Report {
    /// Wall time by stage.
    pub stages: StageTimes,
    /// Boxes given (present ones, for [`crate::BroadPhase`]).
    pub boxes: u64,
    /// Boxes with a NaN or with `min > max` on an axis; they pair with nothing.
    pub invalid: u64,
    /// Boxes that had changed ([`crate::BroadPhase`]: beyond their margin, or filter).
    pub changed: u64,
    /// Tests made. A device may report an estimate, without unnecessary and redundant
    /// ones.
    pub checks: Checks,
    /// The work on the CPU, in tests of codes, of which eight are made at once: a row of cells counts as 32, a node of a tree as 8, an
    /// exact test as 4, about as long as they take. Sorting boxes is not counted, but ids without a box that a search reads are, and the
    /// budget of what was given up is. At most [`crate::WORK_LIMIT`] for each box and pair, times the binary logarithm of the number of boxes,
    /// unless [`crate::Backend::Brute`] or an engine was asked for. It does not depend on threads, unless the call found too many pairs.
    pub work: u64,
    /// Pairs reported ([`crate::BroadPhase`]: pairs that exist now).
    pub pairs: u64,
    /// The plan: the algorithm, the grid and the reasons.
    pub plan: Plan,
    /// The reason why the CPU did the work of a wanted device, if it did.
    pub fallback: Option<String>,
    /// The report on the device, if it did the work.
    pub device: Option<DeviceReport>,
}

impl Report {
    /// Replaces the plan, but not the reason that keeps the call from a device.
    pub(crate) fn set_plan(&mut self, plan: Plan) {
        self.plan = Plan { no_device: self.plan.no_device, ..plan };
    }
}

/// The report on a call that ran on a device: zero where a device measures or does nothing of the kind.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct DeviceReport {
    /// The name of the device.
    pub name: String,
    /// Time of the host: copying boxes into the device's staging memory.
    pub upload: Duration,
    /// Time of the host: choosing cells. Zero where the plan of an earlier call is kept.
    pub plan: Duration,
    /// Time of the host: recording and submitting the kernels.
    pub record: Duration,
    /// Time of the host: waiting for the device, transfers included.
    pub wait: Duration,
    /// Time of the host: decoding.
    pub decode: Duration,
    /// Time on the device: what comes before the tests.
    pub map: Duration,
    /// Time on the device by kernel.
    pub kernels: Vec<(&'static str, Duration)>,
    /// Edge of the smallest cells, in the boxes' length unit; 0 where every pair was tested.
    pub cell: f32,
    /// Number of cells of the plan; 0 where every pair was tested.
    pub cells: u64,
    /// Number of entries of boxes in cells; 0 where every pair was tested.
    pub entries: u64,
    /// Bytes sent to the device.
    pub uploaded: u64,
    /// Bytes read back.
    pub downloaded: u64,
    /// Bytes of buffers on the device, with those for reading back.
    pub device_bytes: u64,
    /// Chunks of work items.
    pub chunks: u32,
    /// Waits of the host for the device, one after the other.
    pub waits: u32,
    /// Repetitions of the map or of a chunk that did not fit its buffers.
    pub repeats: u32,
}
