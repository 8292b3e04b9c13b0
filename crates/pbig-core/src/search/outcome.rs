//! The outcome of an engine or a search of all boxes, and how a report takes it.

use crate::Plan;
use crate::report::{Checks, DeviceReport, Report, StageTimes};
use crate::{Config, Error};

/// The end of an engine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum End {
    /// It would have taken too much work, or a device failed. Another engine has to begin anew.
    #[default]
    GivenUp,
    /// It has found all pairs or events.
    Done,
    TooManyPairs,
}

/// The work of an engine, apart from its pairs or events.
#[derive(Debug, Default)]
pub(crate) struct Outcome {
    pub(crate) end: End,
    pub(crate) checks: Checks,
    pub(crate) work: u64,
    pub(crate) plan: Plan,
    pub(crate) stages: StageTimes,
    /// True if the engine has replaced the kept pairs. Otherwise the events have to be applied to them.
    pub(crate) has_replaced_kept: bool,
    /// The report on the device that did the work.
    pub(crate) device: Option<DeviceReport>,
    /// The reason why a device could not do the work.
    pub(crate) fallback: Option<String>,
}

impl Report {
    /// Adds an outcome to those of engines that gave up before it. Returns true if the work is done, and false if it was given up.
    pub(crate) fn add(&mut self, outcome: Outcome, config: &Config) -> Result<bool, Error> {
        self.stages.add(&outcome.stages);
        // Tests of an engine that gave up found nothing, but they were work.
        self.checks = outcome.checks;
        self.work += outcome.work;
        self.plan = Plan { no_device: self.plan.no_device, ..outcome.plan };
        if outcome.device.is_some() || outcome.fallback.is_some() {
            self.fallback = outcome.fallback;
        }
        self.device = outcome.device;
        match outcome.end {
            End::TooManyPairs => Err(Error::TooManyPairs { limit: config.limits.pairs() }),
            end => Ok(end == End::Done),
        }
    }
}
