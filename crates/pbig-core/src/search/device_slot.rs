//! The device of a finder or a broad phase, if it has one, and the report of a device that cannot do the work.

use super::{End, Outcome};
use crate::pair_device::{DeviceFailure, DeviceFound, PairDevice, SearchRequest};
use crate::policy::{Choice, Work, choose_backend};
use crate::report::{Clock, Report, StageTimes, stage};
use crate::{Algorithm, Config, Pair, PairList, Plan};
use std::time::Duration;

/// Room for a device. A clone has a device of its own.
#[derive(Clone, Debug, Default)]
pub(crate) struct DeviceSlot {
    device: Option<Box<dyn PairDevice>>,
    has_warned: bool,
}

impl DeviceSlot {
    /// Makes a slot with a device.
    pub(crate) fn new(device: Box<dyn PairDevice>) -> Self {
        Self { device: Some(device), ..Self::default() }
    }

    /// Returns the name of the device, unless there is none or it does not work.
    pub(crate) fn name(&self) -> Option<&str> {
        self.device.as_ref()?.name()
    }

    /// Returns true if a call should run on the device. Otherwise the report gets the reason.
    pub(crate) fn is_wanted(&mut self, config: &Config, work: Work, report: &mut Report) -> bool {
        let is_software = self.device.as_ref().map(|device| device.is_software());
        let choice = choose_backend(config.backend, is_software, work);
        report.plan.no_device = if let Choice::Cpu(why) = choice { why } else { None };
        if choice == Choice::Device && is_software.is_none() {
            report.fallback = Some(self.fall_back("no device was given"));
        }
        choice == Choice::Device && is_software.is_some()
    }

    /// Returns the reason why the wanted backend could not do the work. Logs the first of several failures in a row as a warning.
    fn fall_back(&mut self, why: &str) -> String {
        let why = by_cpu(why);
        if !std::mem::replace(&mut self.has_warned, true) {
            tracing::warn!("pbig: {why}");
        }
        why
    }

    /// Finds all pairs on the device, with the memory of `pairs`, and returns them. Gives up if the device could not do it.
    pub(crate) fn find_all(
        &mut self,
        request: &SearchRequest<'_>,
        mut pairs: Vec<Pair>,
    ) -> (Outcome, PairList) {
        stage!("device");
        pairs.clear();
        let mut found = DeviceFound { pairs: pairs.into(), ..DeviceFound::default() };
        let mut clock = Clock::start();
        let Some(device) = &mut self.device else { return (Outcome::default(), found.pairs) };
        let outcome = match device.find_all(request, &mut found).and_then(|()| check(&mut found, request)) {
            Ok(()) => {
                self.has_warned = false;
                found.report.name = self.name().unwrap_or_default().to_owned();
                success(&found, clock.lap())
            }
            Err(DeviceFailure::TooManyPairs) => Outcome { end: End::TooManyPairs, ..Outcome::default() },
            Err(DeviceFailure::Declined(why)) => {
                Outcome { fallback: Some(by_cpu(&why)), ..Outcome::default() }
            }
            Err(DeviceFailure::Failed(why)) => {
                Outcome { fallback: Some(self.fall_back(&why)), ..Outcome::default() }
            }
        };
        (outcome, found.pairs)
    }
}

fn by_cpu(why: &str) -> String {
    format!("{why}: the CPU does the work")
}

/// Returns what the device did in this time.
fn success(found: &DeviceFound, time: Duration) -> Outcome {
    // The rest of the call is check, sort, transfer and decoding.
    let map = found.report.map.min(time);
    let algorithm = if found.valid < 2 { Algorithm::Nothing } else { Algorithm::Device };
    Outcome {
        end: End::Done,
        checks: found.checks,
        plan: Plan { algorithm, boxes: found.valid, device: found.plan.clone(), ..Plan::default() },
        stages: StageTimes { map, check: time - map, ..StageTimes::default() },
        device: Some(found.report.clone()),
        ..Outcome::default()
    }
}

/// Returns an error if an answer has too many pairs, or not the form that a device promises.
fn check(found: &mut DeviceFound, request: &SearchRequest<'_>) -> Result<(), DeviceFailure> {
    let boxes = request.boxes.len();
    let is_counted = found.valid as usize <= boxes && (found.valid > 1 || found.pairs.is_empty());
    if !found.pairs.names_only(boxes) || !is_counted {
        let form = format!("pairs a < b < {boxes}, and at most {boxes} valid boxes, two or more for a pair");
        return Err(DeviceFailure::Failed(format!("the device's answer is malformed: {form} were expected")));
    }
    if found.pairs.len() as u64 > request.max_pairs { Err(DeviceFailure::TooManyPairs) } else { Ok(()) }
}
