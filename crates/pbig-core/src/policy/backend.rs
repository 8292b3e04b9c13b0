//! The choice between the CPU and a GPU: a function of counts, the same on every machine with the same devices.

use crate::Backend;
use std::fmt;

/// Minimum number of changed boxes for [`Backend::Auto`] to use a hardware GPU. A search of all boxes counts each as changed.
pub(crate) const AUTO_GPU_FROM_CHANGED_BOXES: u64 = 500_000;

/// The device that a call may use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(dead_code, reason = "a build has either the first variant or the others")]
pub(crate) enum AvailableDevice {
    NotBuilt,
    NotGiven,
    Software,
    Hardware,
}

/// The backend that does the work of a call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Choice {
    Gpu,
    /// The CPU; with the reason if [`Backend::Auto`] decided.
    Cpu(Option<NoGpu>),
}

impl Choice {
    /// Returns the reason that keeps [`Backend::Auto`] from the GPU.
    pub(crate) fn no_gpu(self) -> Option<NoGpu> {
        match self {
            Self::Gpu => None,
            Self::Cpu(why) => why,
        }
    }
}

/// Reason that keeps a call from the GPU.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum NoGpu {
    /// This build has no GPU backend.
    NotBuilt,
    /// The caller gave no device.
    NotGiven,
    /// The given device is software.
    Software,
    /// Too few boxes have changed.
    FewChanged,
    /// The boxes of the last update are not known, after a restore: the CPU does one update, also with [`Backend::Gpu`].
    OldBoxesUnknown,
}

impl fmt::Display for NoGpu {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotBuilt => "this build has no GPU backend",
            Self::NotGiven => "none was asked for",
            Self::Software => "the given device is software",
            Self::FewChanged => "too few boxes have changed",
            Self::OldBoxesUnknown => "the boxes of the last update are not known",
        })
    }
}

/// Chooses the backend for a call in which `changed` boxes have changed.
///
/// | backend | device | changed boxes | choice |
/// | --- | --- | --- | --- |
/// | `Gpu` | any | any | GPU; without one the caller falls back to the CPU |
/// | `Cpu`, `Brute` | any | any | CPU |
/// | `Auto` | hardware | at least [`AUTO_GPU_FROM_CHANGED_BOXES`] | GPU |
/// | `Auto` | any | any | CPU |
pub(crate) fn choose_backend(backend: Backend, device: AvailableDevice, changed: u64) -> Choice {
    let why = match (backend, device) {
        (Backend::Gpu, _) => return Choice::Gpu,
        (Backend::Cpu | Backend::Brute, _) => return Choice::Cpu(None),
        (Backend::Auto, AvailableDevice::NotBuilt) => NoGpu::NotBuilt,
        (Backend::Auto, AvailableDevice::NotGiven) => NoGpu::NotGiven,
        (Backend::Auto, AvailableDevice::Software) => NoGpu::Software,
        (Backend::Auto, AvailableDevice::Hardware) if changed < AUTO_GPU_FROM_CHANGED_BOXES => {
            NoGpu::FewChanged
        }
        (Backend::Auto, AvailableDevice::Hardware) => return Choice::Gpu,
    };
    Choice::Cpu(Some(why))
}

#[cfg(test)]
mod tests {
    use super::*;
    use AvailableDevice::{Hardware, NotBuilt, NotGiven, Software};

    #[test]
    fn a_backend_that_is_asked_for_needs_no_reason() {
        for device in [NotBuilt, NotGiven, Software, Hardware] {
            assert_eq!(choose_backend(Backend::Gpu, device, 2), Choice::Gpu);
            assert_eq!(choose_backend(Backend::Cpu, device, u64::MAX), Choice::Cpu(None));
            assert_eq!(choose_backend(Backend::Brute, device, u64::MAX), Choice::Cpu(None));
        }
    }

    #[test]
    fn auto_uses_hardware_from_half_a_million_changed_boxes_on() {
        let auto = |device, changed| choose_backend(Backend::Auto, device, changed);
        assert_eq!(auto(NotBuilt, u64::MAX).no_gpu(), Some(NoGpu::NotBuilt));
        assert_eq!(auto(NotGiven, u64::MAX).no_gpu(), Some(NoGpu::NotGiven));
        assert_eq!(auto(Software, u64::MAX).no_gpu(), Some(NoGpu::Software));
        assert_eq!(auto(Hardware, 499_999), Choice::Cpu(Some(NoGpu::FewChanged)));
        assert_eq!(auto(Hardware, 500_000), Choice::Gpu);
        assert_eq!(auto(Hardware, 500_000).no_gpu(), None);
    }
}
