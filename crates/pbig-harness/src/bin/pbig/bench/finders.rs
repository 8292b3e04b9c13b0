//! Finders with different settings that search the same boxes from nothing, in turn.

use super::measure::{Contest, Effort, medians, timed};
use crate::output::Failure;
use pbig_core::{Aabb, Backend, Config, Finder, GpuFinder};

pub(super) struct Finders {
    pub(super) all: Vec<Finder>,
    /// Searched in turn, as boxes of a world are elsewhere each time and a device must get them anew; those
    /// of the set itself come last.
    frames: [Vec<Aabb>; 2],
    now: usize,
}

impl Finders {
    pub(super) fn new(
        configs: impl IntoIterator<Item = Config>,
        gpu: Option<&GpuFinder>,
        frames: [Vec<Aabb>; 2],
    ) -> Self {
        let finder = |config: Config| match gpu {
            Some(gpu) if config.backend == Backend::Gpu => Finder::with_gpu(config, gpu.clone()),
            _ => Finder::new(config),
        };
        Self { all: configs.into_iter().map(finder).collect(), frames, now: 0 }
    }

    /// Milliseconds of each.
    pub(super) fn times(&mut self, effort: Effort) -> Result<Vec<f64>, Failure> {
        medians(self, effort)
    }

    /// The pairs of the last round, in which all must have found as many.
    pub(super) fn pairs(&self) -> Result<u64, Failure> {
        let counts: Vec<usize> = self.all.iter().map(|finder| finder.pairs().len()).collect();
        match counts.iter().all(|count| *count == counts[0]) {
            true => Ok(counts[0] as u64),
            false => Err(Failure::Check(format!("finders that differ in settings found {counts:?} pairs"))),
        }
    }
}

impl Contest for Finders {
    fn sides(&self) -> usize {
        self.all.len()
    }

    fn prepare(&mut self, round: usize) {
        self.now = round % 2;
    }

    fn run(&mut self, side: usize) -> Result<f64, Failure> {
        let finder = &mut self.all[side];
        let (found, time) = timed(|| finder.find(&self.frames[self.now]).map(|_| ()));
        found.map_err(|error| Failure::Input(error.to_string()))?;
        // A call that a device left to the CPU is no measurement of the device.
        match &finder.report().fallback {
            None => Ok(time),
            Some(why) => Err(Failure::Check(why.clone())),
        }
    }
}
