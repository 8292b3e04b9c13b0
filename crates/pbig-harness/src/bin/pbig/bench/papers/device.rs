//! The adapter on which the papers' GPU experiments are repeated, if there is one.

use super::UNSORTED;
use crate::bench::finders::Finders;
use crate::bench::measure::Effort;
use crate::output::Failure;
use pbig_core::{Aabb, Backend, Config, GpuFinder, GpuOptions, Report};
use pbig_harness::boxes::moved;
use std::time::Duration;

pub(super) struct Device {
    gpu: Option<GpuFinder>,
    /// Why there is none.
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

    pub(super) fn adapter(&self) -> Option<&str> {
        self.gpu.as_ref().map(GpuFinder::adapter)
    }

    pub(super) fn is_software(&self) -> bool {
        self.gpu.as_ref().is_some_and(GpuFinder::is_software)
    }

    /// In words, for whoever reads times.
    pub(super) fn about(&self) -> String {
        match &self.gpu {
            Some(gpu) if gpu.is_software() => {
                format!(
                    "Adapter: {}, a program: its pairs and the bytes that its kernels write are right, its times mean \
                     nothing.",
                    gpu.adapter()
                )
            }
            Some(gpu) => format!("Adapter: {}.", gpu.adapter()),
            None => format!("No adapter, so no figures of a GPU: {}", self.missing),
        }
    }

    /// The name of a column of times.
    pub(super) fn column(&self) -> &'static str {
        if self.is_software() { "ms, GPU (software: meaningless)" } else { "ms, GPU" }
    }

    /// The device for a set of so many boxes: a program that plays one takes minutes for millions.
    pub(super) fn for_boxes(&self, boxes: usize) -> Option<&GpuFinder> {
        let most_in_software = if self.quick { 10_000 } else { 50_000 };
        self.gpu.as_ref().filter(|gpu| !gpu.is_software() || boxes <= most_in_software)
    }

    /// Median milliseconds and the last report of each setting, in turn on the same moving boxes; nothing
    /// without a device for so many.
    pub(super) fn run(
        &self,
        configs: &[Config],
        boxes: &[Aabb],
        distance: f32,
    ) -> Result<Vec<(f64, Report)>, Failure> {
        let Some(gpu) = self.for_boxes(boxes.len()) else { return Ok(vec![]) };
        let frames = [moved(boxes, distance, 2), boxes.to_vec()];
        let mut finders = Finders::new(configs.iter().copied(), Some(gpu), frames);
        // The first calls compile, allocate and learn. Times in software mean nothing, so few will do.
        let (warm_up, rounds) = if self.is_software() { (2, 2) } else { (3, 7) };
        let times = finders.times(Effort { warm_up, rounds, budget: Duration::from_secs(10) })?;
        finders.pairs()?;
        Ok(times.into_iter().zip(finders.all.iter().map(|finder| finder.report().clone())).collect())
    }
}

/// Bytes that the kernels have written of output, for the host to decode; none where nothing was found. Those that come
/// back are more: see [`about_bytes`].
pub(super) fn written(report: &Report) -> Option<u64> {
    let gpu = report.gpu.as_ref()?;
    // The ratio to two ids a pair, of all that the kernels wrote.
    (report.pairs > 0).then(|| (gpu.compression * 8.0 * report.pairs as f64).round() as u64)
}

/// What columns of bytes mean.
pub(super) fn about_bytes() -> &'static str {
    "Bytes written are the words of output of the kernels, what the papers' sizes are of. Bytes fetched are all that \
     comes back: with each chunk of work its counters and times, and words that are fetched before it is known how \
     many there are (as many as the largest chunk had, and a quarter more); with records also the table for decoding, \
     4 bytes an entry, once a call."
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
