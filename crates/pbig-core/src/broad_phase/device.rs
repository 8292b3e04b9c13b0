//! The device of a broad phase.

use super::BroadPhase;
use crate::PairDevice;
use crate::device_slot::DeviceSlot;
use crate::holder::Holder;
use crate::{Backend, Config, Error, Limits, NoDevice};

impl BroadPhase {
    /// Makes a broad phase with a given device. [`Backend::Device`] always uses it, [`Backend::Auto`] if it is hardware and many boxes
    /// change.
    ///
    /// # Errors
    /// [`Error::Margin`].
    pub fn with_device(config: Config, device: Box<dyn PairDevice>) -> Result<Self, Error> {
        let mut broad_phase = Self::new(config)?;
        broad_phase.set_device(device);
        Ok(broad_phase)
    }

    /// Uses this device, beginning with the first update whose changes are all set after this call. Earlier updates use the CPU.
    pub fn set_device(&mut self, device: Box<dyn PairDevice>) {
        self.device = DeviceSlot::new(device);
        self.world.keep_old = usize::MAX;
        if self.holder == Holder::Device {
            self.holder = Holder::Nothing;
        }
    }

    /// Sets where the next updates run, and their limits: for tests and measurements.
    #[doc(hidden)]
    pub fn set_backend(&mut self, backend: Backend, limits: Limits) {
        (self.config.backend, self.config.limits) = (backend, limits);
    }

    /// Returns the name of the device in use. None while there is no device or it has failed.
    pub fn device_name(&self) -> Option<&str> {
        self.device.name()
    }

    /// Returns true if a device should do the update. Otherwise the report gets the reason.
    pub(super) fn is_for_device(&mut self) -> bool {
        let is_wanted = self.device.is_wanted(&self.config, self.world.changed.len(), &mut self.report);
        if is_wanted && !self.world.knows_old() {
            self.report.plan.no_device = Some(NoDevice::OldBoxesUnknown);
        }
        is_wanted && self.world.knows_old()
    }
}
