//! Different ways to search the same boxes from nothing, in turn.

use crate::study::{PbigFound, PbigSettings, pbig_grid};
use pbig_core::{Aabb, Backend, Checks, Config, Error, Finder, GpuFinder, Report};
use pbig_harness::bench::{Contest, Effort, medians, timed};
use pbig_harness::output::Failure;

/// A way to search from nothing.
#[derive(Clone, Copy, Debug)]
pub(super) enum Way {
    /// Ours, with these settings.
    Finder(Config),
    /// PBIG's grid on the CPU.
    Pbig(PbigSettings),
}

impl From<Config> for Way {
    fn from(config: Config) -> Self {
        Self::Finder(config)
    }
}

impl From<PbigSettings> for Way {
    fn from(settings: PbigSettings) -> Self {
        Self::Pbig(settings)
    }
}

/// A way to search, with the results of its last call.
pub(super) enum Side {
    Finder(Box<Finder>),
    Pbig(PbigSettings, Option<PbigFound>),
}

impl Side {
    pub(super) fn new(way: impl Into<Way>, gpu: Option<&GpuFinder>) -> Self {
        match way.into() {
            Way::Pbig(settings) => Self::Pbig(settings, None),
            Way::Finder(config) => Self::Finder(Box::new(match gpu {
                Some(gpu) if config.backend == Backend::Gpu => Finder::with_gpu(config, gpu.clone()),
                _ => Finder::new(config),
            })),
        }
    }

    pub(super) fn find(&mut self, boxes: &[Aabb]) -> Result<(), Error> {
        match self {
            Self::Finder(finder) => finder.find(boxes).map(|_| ()),
            Self::Pbig(settings, found) => {
                *found = Some(pbig_grid(boxes, settings)?);
                Ok(())
            }
        }
    }

    pub(super) fn pairs(&self) -> u64 {
        match self {
            Self::Finder(finder) => finder.pairs().len() as u64,
            Self::Pbig(_, found) => found.as_ref().map_or(0, |found| found.pairs.len() as u64),
        }
    }

    pub(super) fn checks(&self) -> Checks {
        match self {
            Self::Finder(finder) => finder.report().checks,
            Self::Pbig(_, found) => found.as_ref().map_or(Checks::default(), |found| found.checks),
        }
    }

    /// The length of PBIG's cells, where it has them.
    pub(super) fn cell(&self) -> Option<f32> {
        match self {
            Self::Finder(_) => None,
            Self::Pbig(_, found) => found.as_ref().map(|found| found.plan.cell),
        }
    }

    /// The report of our finder; PBIG's grid has none.
    pub(super) fn report(&self) -> Option<&Report> {
        match self {
            Self::Finder(finder) => Some(finder.report()),
            Self::Pbig(..) => None,
        }
    }
}

pub(super) struct Finders {
    pub(super) all: Vec<Side>,
    /// Searched in turn, as boxes of a world are elsewhere each time and a device must get them anew; those
    /// of the set itself come last.
    frames: [Vec<Aabb>; 2],
    now: usize,
}

impl Finders {
    pub(super) fn new(
        ways: impl IntoIterator<Item = impl Into<Way>>,
        gpu: Option<&GpuFinder>,
        frames: [Vec<Aabb>; 2],
    ) -> Self {
        Self { all: ways.into_iter().map(|way| Side::new(way, gpu)).collect(), frames, now: 0 }
    }

    /// Milliseconds of each.
    pub(super) fn times(&mut self, effort: Effort) -> Result<Vec<f64>, Failure> {
        medians(self, effort)
    }

    /// The pairs of the last round, in which all must have found as many.
    pub(super) fn pairs(&self) -> Result<u64, Failure> {
        let counts: Vec<u64> = self.all.iter().map(Side::pairs).collect();
        match counts.iter().all(|count| *count == counts[0]) {
            true => Ok(counts[0]),
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
        let (found, time) = timed(|| finder.find(&self.frames[self.now]));
        found?;
        // A call that a device left to the CPU is no measurement of the device.
        match finder.report().and_then(|report| report.fallback.as_ref()) {
            None => Ok(time),
            Some(why) => Err(Failure::Check(why.clone())),
        }
    }
}
