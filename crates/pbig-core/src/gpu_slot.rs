//! The GPU of a finder or a broad phase, if it has one, and the report of a GPU that cannot do the work.

use crate::Config;
use crate::policy::{AvailableDevice, Choice, choose_backend};
use crate::report::Report;
#[cfg(feature = "gpu")]
use crate::{
    Algorithm, Error, Plan,
    gpu::{Failure, GpuFinder, GpuFound, available},
    report::{Clock, stage},
};

/// Room for a GPU.
#[derive(Clone, Debug, Default)]
pub(crate) struct GpuSlot {
    #[cfg(feature = "gpu")]
    pub(crate) gpu: Option<GpuFinder>,
    has_warned: bool,
}

impl GpuSlot {
    /// Returns true if a call with this number of changed boxes should run on the GPU. Otherwise the report gets the reason.
    pub(crate) fn is_wanted(&mut self, config: &Config, changed: usize, report: &mut Report) -> bool {
        let choice = choose_backend(config.backend, self.device(), changed as u64);
        report.plan.no_gpu = choice.no_gpu();
        #[cfg(not(feature = "gpu"))]
        if choice == Choice::Gpu {
            let why = "no GPU backend in this build (feature `gpu`): the CPU does the work";
            self.fall_back(why.into(), report);
            return false;
        }
        choice == Choice::Gpu
    }

    fn device(&self) -> AvailableDevice {
        #[cfg(feature = "gpu")]
        return available(self.gpu.as_ref());
        #[cfg(not(feature = "gpu"))]
        AvailableDevice::NotBuilt
    }

    /// Reports that the wanted backend could not do the work: every time in the report, once as a warning.
    fn fall_back(&mut self, why: String, report: &mut Report) {
        if !self.has_warned {
            tracing::warn!("pbig: {why}");
            self.has_warned = true;
        }
        report.fallback = Some(why);
    }
}

#[cfg(feature = "gpu")]
impl GpuSlot {
    /// Makes a slot with a GPU.
    pub(crate) fn new(gpu: GpuFinder) -> Self {
        Self { gpu: Some(gpu), has_warned: false }
    }

    /// Returns the adapter of the device, unless there is none or it has failed.
    pub(crate) fn adapter(&self) -> Option<&str> {
        self.gpu.as_ref().and_then(GpuFinder::working_adapter)
    }

    /// Runs a call on the device. Returns none if the device could not do it; the report says why.
    pub(crate) fn call(
        &mut self,
        report: &mut Report,
        call: impl FnOnce(&mut GpuFinder) -> Result<GpuFound, Failure>,
    ) -> Result<Option<GpuFound>, Error> {
        stage!("gpu");
        let mut clock = Clock::start();
        match call(self.gpu.get_or_insert_with(GpuFinder::shared)) {
            Ok(found) => {
                self.has_warned = false;
                note_success(&found, &mut clock, report);
                Ok(Some(found))
            }
            Err(Failure::Call(error)) => Err(error),
            Err(Failure::Device(error)) => {
                self.fall_back(format!("{error}: the CPU does the work"), report);
                Ok(None)
            }
        }
    }
}

/// Says in the report what the device did.
#[cfg(feature = "gpu")]
fn note_success(found: &GpuFound, clock: &mut Clock, report: &mut Report) {
    // The device's own times for its map; the rest of the call is check, transfer and decoding.
    let kernels = found.report.kernels.iter().filter(|(name, _)| !name.starts_with("check"));
    let time = clock.lap();
    let map = kernels.map(|(_, time)| *time).sum::<std::time::Duration>().min(time);
    report.stages.map += map;
    report.stages.check += time - map;
    let algorithm = if found.valid < 2 { Algorithm::Nothing } else { Algorithm::Gpu };
    report.plan = Plan { algorithm, boxes: found.valid, gpu: found.plan.clone(), ..Plan::default() };
    (report.checks, report.gpu, report.fallback) = (found.checks, Some(found.report.clone()), None);
}
