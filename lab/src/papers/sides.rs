//! Ways to search the same boxes from nothing, in turn, on the CPU and on a device.

use super::printed::MOST_BOXES;
use crate::UNSORTED;
use crate::pbig_grid::{CellRule, pbig_grid};
use pbig_core::{Aabb, Backend, Config, Finder, Report};
use pbig_gpu::{DECLINED, GpuFinder, GpuOptions};
use pbig_harness::prelude::*;
use std::time::Duration;

/// A way to search from nothing.
#[derive(Clone, Copy, Debug)]
pub(super) enum Way {
    /// Pbig's, with these settings.
    Finder(Config),
    /// Pbig's on a device with these settings.
    Gpu(GpuOptions),
    /// PBIG's grid on the CPU, of whose options it reads `boxes_per_cell` and `small_cell`.
    Pbig(GpuOptions),
    /// PBIG's grid on the CPU, with Avril's cells.
    Avril,
}

/// The settings of [`Way::Gpu`].
pub(super) const ON_GPU: Config = Config { backend: Backend::Device, ..UNSORTED };

/// One call and its results.
#[derive(Clone, Default)]
pub(super) struct SearchCall {
    pub(super) ms: f64,
    /// The median of a race, over all places in a round.
    pub(super) median: f64,
    /// The length of PBIG's cells, where it has them.
    pub(super) cell: Option<f32>,
    /// Pbig's report; of PBIG's grid on the CPU, pairs and checks alone.
    pub(super) report: Report,
}

/// A way with the buffers that it keeps, and its calls.
struct Racer {
    way: Way,
    finder: Finder,
    calls: Vec<SearchCall>,
}

impl Racer {
    fn new(way: Way, gpu: Option<&GpuFinder>) -> Self {
        let finder = match (way, gpu) {
            (Way::Gpu(options), Some(gpu)) => {
                Finder::with_device(ON_GPU, Box::new(gpu.clone().with_options(options)))
            }
            (Way::Gpu(_), None) => Finder::new(ON_GPU),
            (Way::Finder(config), _) => Finder::new(config),
            (Way::Pbig(_) | Way::Avril, _) => Finder::default(),
        };
        Self { way, finder, calls: vec![] }
    }

    /// Makes a call. It has no time if a device declined the boxes. Fails if a device failed.
    fn call(&mut self, boxes: &[Aabb]) -> Result<SearchCall, Failure> {
        let cells = match self.way {
            Way::Pbig(options) => Some((options, CellRule::Objective)),
            Way::Avril => Some((GpuOptions::DEFAULT, CellRule::Density)),
            _ => None,
        };
        if let Some((options, rule)) = cells {
            let (found, ms) = timed(|| pbig_grid(boxes, &options, rule));
            let (found, mut report) = (found?, Report::default());
            (report.pairs, report.checks) = (found.pairs.len() as u64, found.checks);
            return Ok(SearchCall { ms, cell: Some(found.plan.cell), report, ..SearchCall::default() });
        }
        let (found, ms) = timed(|| self.finder.find(boxes).map(|_| ()));
        found?;
        let report = self.finder.report().clone();
        let why = report.fallback.as_deref().unwrap_or_default();
        let is_declined = why.starts_with(DECLINED);
        check(why.is_empty() || is_declined, || why.to_owned())?;
        // An empty cell of a table.
        let ms = if is_declined { f64::NAN } else { ms };
        let cell = report.device.as_ref().map(|device| device.cell).filter(|cell| *cell > 0.0);
        Ok(SearchCall { ms, cell, report, ..SearchCall::default() })
    }
}

/// Makes one call, which also allocates.
pub(super) fn once(way: Way, boxes: &[Aabb]) -> Result<SearchCall, Failure> {
    Racer::new(way, None).call(boxes)
}

/// Returns the rounds for `n` boxes: enough for a median if a call is short, few if it takes seconds.
pub(super) fn effort(boxes: usize) -> Effort {
    let (warm_up, rounds) = if boxes > 200_000 { (1, 3) } else { (3, 15) };
    Effort { warm_up, rounds, budget: Duration::from_secs(5) }
}

/// Measures ways in turn; returns of each the call on the boxes of the set whose time is the median, so that its time and its
/// report are of the same call. In every second round boxes are elsewhere, as those of a world are: a device must get them anew.
/// A failed check, if ways find different numbers of pairs.
pub(super) fn race(
    ways: &[Way],
    gpu: Option<&GpuFinder>,
    boxes: Vec<Aabb>,
    distance: f32,
    effort: Effort,
) -> Result<Vec<SearchCall>, Failure> {
    let frames = [moved(&boxes, distance, 2), boxes];
    let mut sides: Vec<Racer> = ways.iter().map(|way| Racer::new(*way, gpu)).collect();
    let took = measured(&mut sides, ways.len(), effort, unprepared, |sides, side| {
        let side = &mut sides[side];
        let call = side.call(&frames[side.calls.len() % 2])?;
        side.calls.push(call.clone());
        Ok(call.ms)
    })?;
    let counts = |side: &Racer| side.calls.iter().map(|call| call.report.pairs).collect::<Vec<_>>();
    let other = sides.iter().map(counts).find(|found| *found != counts(&sides[0]));
    check(other.is_none(), || format!("ways that differ in settings found other pairs: {other:?}"))?;
    let middle = |(side, took): (Racer, Took)| {
        let mut calls: Vec<SearchCall> = side.calls.into_iter().skip(effort.warm_up | 1).step_by(2).collect();
        calls.sort_by(|a, b| a.ms.total_cmp(&b.ms));
        SearchCall { median: took.median, ..calls.swap_remove((calls.len() - 1) / 2) }
    };
    Ok(sides.into_iter().zip(took).map(middle).collect())
}

/// The size of the experiments, and the adapter on which those on a GPU are repeated, if there is one.
pub(super) struct Setup {
    pub(super) quick: bool,
    /// Boxes of figures 8, 9 and 11 of PBIG; the last is as many as the papers have at most.
    pub(super) numbers: &'static [usize],
    gpu: Option<GpuFinder>,
    /// The adapter's name, or why there is none.
    pub(super) adapter: String,
}

impl Setup {
    /// Opens the best adapter, or that of `WGPU_ADAPTER_NAME`.
    pub(super) fn new(quick: bool) -> Self {
        const NUMBERS: [usize; 5] = [1000, 10_000, 100_000, 1_000_000, MOST_BOXES];
        let gpu = GpuFinder::new();
        let adapter = gpu.as_ref().map_or_else(|error| format!("none: {error}"), |gpu| gpu.adapter().into());
        Self { quick, numbers: if quick { &NUMBERS[..3] } else { &NUMBERS }, gpu: gpu.ok(), adapter }
    }

    pub(super) fn is_software(&self) -> bool {
        self.gpu.as_ref().is_some_and(GpuFinder::is_software)
    }

    /// Returns the boxes for a device: as many as a program that plays one searches in seconds.
    pub(super) fn on_device(&self) -> usize {
        match (self.is_software(), self.quick) {
            (_, true) => 2000,
            (true, false) => 50_000,
            (false, false) => 1_000_000,
        }
    }

    /// Returns the device for a set of `n` boxes. A software adapter takes minutes for millions, so it gets small sets only.
    pub(super) fn for_boxes(&self, boxes: usize) -> Option<&GpuFinder> {
        let most_in_software = if self.quick { 10_000 } else { 50_000 };
        self.gpu.as_ref().filter(|gpu| !gpu.is_software() || boxes <= most_in_software)
    }

    /// Returns a call of each setting on moving boxes; none without a device for this number. Fails if they find other pairs than the
    /// CPU.
    pub(super) fn run(
        &self,
        ways: &[Way],
        boxes: &[Aabb],
        distance: f32,
    ) -> Result<Vec<SearchCall>, Failure> {
        let Some(gpu) = self.for_boxes(boxes.len()) else { return Ok(vec![]) };
        // The first calls compile, allocate and learn. Times in software mean nothing, so few will do.
        let (warm_up, rounds) = if self.is_software() { (1, 5) } else { (3, 13) };
        let effort = Effort { warm_up, rounds, budget: Duration::from_secs(10) };
        let calls = race(ways, Some(gpu), boxes.to_vec(), distance, effort)?;
        let on_cpu = once(Way::Finder(UNSORTED), boxes)?.report.pairs;
        let what = || format!("{on_cpu} pairs on the CPU, others on the device: {}", calls[0].report.pairs);
        check(calls.iter().all(|call| call.report.pairs == on_cpu), what)?;
        Ok(calls)
    }
}

impl SearchCall {
    /// Returns the checks made, and of them the unnecessary and the redundant ones.
    pub(super) fn checks(&self) -> [u64; 3] {
        let checks = &self.report.checks;
        [checks.made, checks.unnecessary, checks.redundant]
    }
}
