//! The adapter on which the papers' GPU experiments are repeated, if there is one.

use super::UNSORTED;
use super::finders::Finders;
use pbig_core::{Aabb, Backend, Config, GpuFinder, GpuOptions, Report};
use pbig_harness::bench::{Contest, Effort, medians};
use pbig_harness::boxes::moved;
use pbig_harness::output::Failure;
use std::time::Duration;

pub(super) struct Device {
    gpu: Option<GpuFinder>,
    /// The reason why there is none.
    missing: String,
    quick: bool,
}

impl Device {
    /// The best adapter, or that of `WGPU_ADAPTER_NAME`.
    pub(super) fn best(quick: bool) -> Self {
        match GpuFinder::new() {
            Ok(gpu) => Self { gpu: Some(gpu), missing: String::new(), quick },
            Err(error) => Self { gpu: None, missing: error.to_string(), quick },
        }
    }
    /// Returns the adapter's name, or why there is none.
    pub(super) fn name(&self) -> String {
        self.gpu.as_ref().map_or(format!("none: {}", self.missing), |gpu| gpu.adapter().to_owned())
    }

    pub(super) fn has_adapter(&self) -> bool {
        self.gpu.is_some()
    }

    pub(super) fn is_software(&self) -> bool {
        self.gpu.as_ref().is_some_and(GpuFinder::is_software)
    }

    /// The device for a set of so many boxes: a program that plays one takes minutes for millions.
    pub(super) fn for_boxes(&self, boxes: usize) -> Option<&GpuFinder> {
        let most_in_software = if self.quick { 10_000 } else { 50_000 };
        self.gpu.as_ref().filter(|gpu| !gpu.is_software() || boxes <= most_in_software)
    }

    /// Milliseconds and report of one call of each setting, that of the median time, in turn on the same moving
    /// boxes; nothing without a device for so many.
    pub(super) fn run(
        &self,
        configs: &[Config],
        boxes: &[Aabb],
        distance: f32,
    ) -> Result<Vec<(f64, Report)>, Failure> {
        let Some(gpu) = self.for_boxes(boxes.len()) else { return Ok(vec![]) };
        let frames = [moved(boxes, distance, 2), boxes.to_vec()];
        let mut calls = Calls::new(Finders::new(configs.iter().copied(), Some(gpu), frames));
        // The first calls compile, allocate and learn. Times in software mean nothing, so few will do.
        let (warm_up, rounds) = if self.is_software() { (1, 5) } else { (3, 13) };
        medians(&mut calls, Effort { warm_up, rounds, budget: Duration::from_secs(10) })?;
        calls.finders.pairs()?;
        // In odd rounds boxes are at home; elsewhere they have other pairs.
        let at_home =
            |calls: Vec<(f64, Report)>| calls.into_iter().skip(warm_up).skip(1 - warm_up % 2).step_by(2);
        Ok(calls.all.into_iter().filter_map(|calls| middle(at_home(calls))).collect())
    }

    /// The same of one setting, which must find so many pairs: those of the CPU.
    pub(super) fn run_for(
        &self,
        config: Config,
        boxes: &[Aabb],
        distance: f32,
        pairs: u64,
    ) -> Result<Option<(f64, Report)>, Failure> {
        let runs = self.run(&[config], boxes, distance)?;
        same_pairs(&runs, pairs)?;
        Ok(runs.into_iter().next())
    }
}

/// A failed check where calls on a device found other pairs than the CPU, of which there are so many.
pub(super) fn same_pairs(runs: &[(f64, Report)], pairs: u64) -> Result<(), Failure> {
    match runs.iter().map(|(_, report)| report.pairs).find(|found| *found != pairs) {
        Some(found) => Err(Failure::Check(format!("{found} pairs on the device, {pairs} on the CPU"))),
        None => Ok(()),
    }
}

/// Finders, and what each of their calls took and did: total and tasks are to be of the same call.
struct Calls {
    finders: Finders,
    /// By side, then by round.
    all: Vec<Vec<(f64, Report)>>,
}

impl Calls {
    fn new(finders: Finders) -> Self {
        Self { all: vec![vec![]; finders.all.len()], finders }
    }
}

impl Contest for Calls {
    fn sides(&self) -> usize {
        self.finders.sides()
    }

    fn prepare(&mut self, round: usize) {
        self.finders.prepare(round);
    }

    fn run(&mut self, side: usize) -> Result<f64, Failure> {
        let ms = self.finders.run(side)?;
        self.all[side].extend(self.finders.all[side].report().map(|report| (ms, report.clone())));
        Ok(ms)
    }
}

/// The call whose time is the median; of an even number of calls the shorter of the two in the middle.
fn middle(calls: impl Iterator<Item = (f64, Report)>) -> Option<(f64, Report)> {
    let mut calls: Vec<_> = calls.collect();
    calls.sort_by(|a, b| a.0.total_cmp(&b.0));
    (!calls.is_empty()).then(|| calls.swap_remove((calls.len() - 1) / 2))
}

/// Bytes that the kernels have written of output, for the host to decode; none where nothing was found. Those that come
/// back are more: with each chunk of work its counters and times, and words that are fetched before it is known how many there
/// are; with records also the table for decoding.
pub(super) fn written(report: &Report) -> Option<u64> {
    let gpu = report.gpu.as_ref()?;
    // The ratio to two ids a pair, of all that the kernels wrote.
    (report.pairs > 0).then(|| (gpu.compression * 8.0 * report.pairs as f64).round() as u64)
}

/// Settings for a device.
pub(super) fn on_gpu(gpu: GpuOptions) -> Config {
    Config { backend: Backend::Gpu, gpu, ..UNSORTED }
}

/// Milliseconds of the kernels whose name a rule takes, of one call.
pub(super) fn kernels(report: &Report, takes: impl Fn(&str) -> bool) -> Option<f64> {
    let kernels = &report.gpu.as_ref()?.kernels;
    let time = |of: &Duration| of.as_secs_f64() * 1e3;
    (!kernels.is_empty())
        .then(|| kernels.iter().filter(|(name, _)| takes(name)).map(|(_, of)| time(of)).sum())
}
