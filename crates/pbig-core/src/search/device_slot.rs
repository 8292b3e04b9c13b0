//! The device of a finder or a broad phase, if it has one, and the report of a device that cannot do the work.

use crate::pair_device::{DeviceFailure, DeviceFound, PairDevice, SearchRequest};
use crate::policy::no_device;
use crate::report::{Clock, Report, stage};
use crate::{Algorithm, Backend, Error, Pair, Plan};
use std::time::Duration;

/// Room for a device. A clone has a device of its own.
#[derive(Clone, Debug, Default)]
pub(crate) struct DeviceSlot {
    device: Option<Box<dyn PairDevice>>,
    has_warned: bool,
}

impl DeviceSlot {
    pub(crate) fn new(device: Box<dyn PairDevice>) -> Self {
        Self { device: Some(device), ..Self::default() }
    }

    /// Returns the name of the device, unless there is none or it does not work.
    pub(crate) fn name(&self) -> Option<&str> {
        self.device.as_ref()?.name()
    }

    /// Returns true if a call should run on the device: an update, or a search of this number of boxes. Otherwise the report gets the
    /// reason.
    pub(crate) fn is_wanted(&mut self, backend: Backend, searched: Option<u64>, report: &mut Report) -> bool {
        let is_software = self.device.as_ref().map(|device| device.is_software());
        if backend == Backend::Auto {
            report.plan.no_device = no_device(is_software, searched);
            return report.plan.no_device.is_none();
        }
        if backend == Backend::Device && is_software.is_none() {
            report.fallback = Some(self.fall_back("no device was given"));
        }
        backend == Backend::Device && is_software.is_some()
    }

    /// Returns the reason why the wanted backend could not do the work. Logs the first of several failures in a row as a warning.
    fn fall_back(&mut self, why: &str) -> String {
        let why = by_cpu(why);
        if !std::mem::replace(&mut self.has_warned, true) {
            tracing::warn!("pbig: {why}");
        }
        why
    }

    /// Finds all pairs on the device, into `pairs`, with its memory. Returns true if they are in order; none if the device could not
    /// find them.
    pub(crate) fn find_all(
        &mut self,
        request: &SearchRequest<'_>,
        pairs: &mut Vec<Pair>,
        report: &mut Report,
    ) -> Result<Option<bool>, Error> {
        stage!("device");
        pairs.clear();
        let Some(device) = &mut self.device else { return Ok(None) };
        let mut found = DeviceFound { pairs: std::mem::take(pairs).into(), ..DeviceFound::default() };
        let mut clock = Clock::start();
        let done = device.find_all(request, &mut found).and_then(|()| check(&mut found, request));
        let is_in_order = found.pairs.is_in_order();
        *pairs = std::mem::take(&mut found.pairs).into_vec();
        if done.is_err() {
            pairs.clear();
        }
        match done {
            Ok(()) => {
                self.has_warned = false;
                found.report.name = self.name().unwrap_or_default().to_owned();
                add_to(report, &mut found, clock.lap());
                return Ok(Some(is_in_order));
            }
            Err(DeviceFailure::TooManyPairs) => return Err(Error::TooManyPairs { limit: request.max_pairs }),
            Err(DeviceFailure::Declined(why)) => report.fallback = Some(by_cpu(&why)),
            Err(DeviceFailure::Failed(why)) => report.fallback = Some(self.fall_back(&why)),
        }
        Ok(None)
    }
}

fn by_cpu(why: &str) -> String {
    format!("{why}: the CPU does the work")
}

/// Reports what the device did in this time.
fn add_to(report: &mut Report, found: &mut DeviceFound, time: Duration) {
    // The rest of the call is check, sort, transfer and decoding.
    let map = found.report.map.min(time);
    report.stages.map += map;
    report.stages.check += time - map;
    report.checks = found.checks;
    let algorithm = if found.valid < 2 { Algorithm::Nothing } else { Algorithm::Device };
    report.set_plan(Plan { algorithm, boxes: found.valid, device: found.plan.take(), ..Plan::default() });
    report.device = Some(std::mem::take(&mut found.report));
    report.fallback = None;
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
