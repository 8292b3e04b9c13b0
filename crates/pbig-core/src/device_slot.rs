//! The device of a finder or a broad phase, if it has one, and the report of a device that cannot do the work.

use crate::device::{DeviceFailure, DeviceFound, PairDevice};
use crate::policy::{AvailableDevice, Choice, choose_backend};
use crate::report::{Clock, Report, stage};
use crate::{Algorithm, Config, Error, Pair, Plan, parallel};

/// Pairs of an answer that a thread checks at a time.
const PIECE: usize = 1 << 16;

/// Room for a device.
#[derive(Clone, Debug, Default)]
pub(crate) struct DeviceSlot {
    device: Option<Box<dyn PairDevice>>,
    /// True if the device has done the last update to its end. It knows the boxes then.
    is_current: bool,
    has_warned: bool,
}

impl DeviceSlot {
    /// Makes a slot with a device.
    pub(crate) fn new(device: Box<dyn PairDevice>) -> Self {
        Self { device: Some(device), is_current: false, has_warned: false }
    }

    /// Returns true if there is a device.
    pub(crate) fn has_device(&self) -> bool {
        self.device.is_some()
    }

    /// Returns the name of the device, unless there is none or it does not work.
    pub(crate) fn name(&self) -> Option<&str> {
        self.device.as_ref()?.name()
    }

    /// Begins an update on the device. It forgets what it knows, unless it has done the last update to its end.
    pub(crate) fn begin_update(&mut self) {
        let is_current = std::mem::take(&mut self.is_current);
        if let Some(device) = self.device.as_mut().filter(|_| !is_current) {
            device.forget();
        }
    }

    /// Ends an update, which the device has done or the CPU.
    pub(crate) fn end_update(&mut self, is_by_device: bool) {
        self.is_current = is_by_device;
    }

    /// Returns true if a call with this number of changed boxes should run on the device. Otherwise the report gets the reason.
    pub(crate) fn is_wanted(&mut self, config: &Config, changed: usize, report: &mut Report) -> bool {
        let choice = choose_backend(config.backend, self.available(), changed as u64);
        report.plan.no_device = choice.no_device();
        if choice == Choice::Device && self.device.is_none() {
            self.fall_back("no device was given".into(), report);
            return false;
        }
        choice == Choice::Device
    }

    fn available(&self) -> AvailableDevice {
        match &self.device {
            None => AvailableDevice::NotGiven,
            Some(device) if device.is_software() => AvailableDevice::Software,
            Some(_) => AvailableDevice::Hardware,
        }
    }

    /// Reports that the wanted backend could not do the work: every time in the report, once as a warning.
    fn fall_back(&mut self, why: String, report: &mut Report) {
        let why = format!("{why}: the CPU does the work");
        if !self.has_warned {
            tracing::warn!("pbig: {why}");
            self.has_warned = true;
        }
        report.fallback = Some(why);
    }

    /// Runs a call about this number of boxes on the device, with the memory of `pairs`. Returns none if the device could not do
    /// it; the report says why.
    pub(crate) fn call(
        &mut self,
        boxes: usize,
        pairs: Vec<Pair>,
        config: &Config,
        report: &mut Report,
        call: impl FnOnce(&mut dyn PairDevice, &mut DeviceFound) -> Result<(), DeviceFailure>,
    ) -> Result<Option<DeviceFound>, Error> {
        stage!("device");
        let Some(device) = &mut self.device else { return Ok(None) };
        let (mut clock, mut found) = (Clock::start(), DeviceFound { pairs, ..DeviceFound::default() });
        found.pairs.clear();
        match call(&mut **device, &mut found).and_then(|()| check(&found, boxes)) {
            Ok(()) => {
                self.has_warned = false;
                found.report.name = self.name().unwrap_or_default().to_owned();
                note_success(&found, &mut clock, report);
                Ok(Some(found))
            }
            Err(DeviceFailure::TooManyPairs) => Err(Error::TooManyPairs { limit: config.limits.pairs() }),
            Err(DeviceFailure::Failed(why)) => {
                self.fall_back(why, report);
                Ok(None)
            }
        }
    }
}

/// Says in the report what the device did.
fn note_success(found: &DeviceFound, clock: &mut Clock, report: &mut Report) {
    // The rest of the call is check, sort, transfer and decoding.
    let time = clock.lap();
    let map = found.report.map.min(time);
    report.stages.map += map;
    report.stages.check += time - map;
    let algorithm = if found.valid < 2 { Algorithm::Nothing } else { Algorithm::Device };
    report.plan = Plan { algorithm, boxes: found.valid, device: found.plan.clone(), ..Plan::default() };
    (report.checks, report.device, report.fallback) = (found.checks, Some(found.report.clone()), None);
}

/// Returns an error if an answer about this number of boxes has not the form that a device promises.
fn check(found: &DeviceFound, boxes: usize) -> Result<(), DeviceFailure> {
    let are_pairs = are_pairs(&found.pairs, boxes) && are_pairs(&found.ended, boxes);
    let are_ids = found.restarted.is_sorted_by(|one, next| one < next)
        && found.restarted.iter().all(|id| (*id as usize) < boxes);
    if are_pairs && are_ids && found.valid as usize <= boxes {
        return Ok(());
    }
    let form =
        format!("pairs a < b < {boxes}, ascending ids of restarted boxes, and at most {boxes} valid boxes");
    Err(DeviceFailure::Failed(format!("the device's answer is malformed: {form} were expected")))
}

/// Returns true if every pair is `a < b < boxes`.
fn are_pairs(pairs: &[Pair], boxes: usize) -> bool {
    let pieces: Vec<&[Pair]> = pairs.chunks(PIECE).collect();
    // Without an early end in a piece, so that the compiler uses SIMD.
    let is_good = |pair: &Pair| (pair.a < pair.b) & ((pair.b as usize) < boxes);
    let are_good = |i: usize| pieces[i].iter().fold(true, |all, pair| all & is_good(pair));
    parallel::map(pieces.len(), are_good).into_iter().all(|is_good| is_good)
}
