//! The choice between the CPU and a device: a function of counts, the same on every machine with the same devices.

use crate::Backend;
use std::fmt;

/// Minimum number of changed boxes for [`Backend::Auto`] to use a hardware device. A search of all boxes counts each as changed.
pub(crate) const AUTO_DEVICE_FROM_CHANGED_BOXES: u64 = 500_000;

/// The backend that does the work of a call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Choice {
    Device,
    /// The CPU; with the reason if [`Backend::Auto`] decided.
    Cpu(Option<NoDevice>),
}

/// Reason that keeps a call from a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum NoDevice {
    /// The caller gave no device.
    NotGiven,
    /// The given device is software.
    Software,
    /// Too few boxes have changed.
    FewChanged,
    /// The boxes of the last update are not known, after a restore: the CPU does one update, also with [`Backend::Device`].
    OldBoxesUnknown,
}

impl fmt::Display for NoDevice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotGiven => "none was given",
            Self::Software => "the given one is software",
            Self::FewChanged => "too few boxes have changed",
            Self::OldBoxesUnknown => "the boxes of the last update are not known",
        })
    }
}

/// Chooses the backend for a call in which `changed` boxes have changed. `is_software` tells about the device, if there is one.
///
/// | backend | device | changed boxes | choice |
/// | --- | --- | --- | --- |
/// | `Device` | any | any | device; without one the caller falls back to the CPU |
/// | `Cpu`, `Brute` | any | any | CPU |
/// | `Auto` | hardware | at least [`AUTO_DEVICE_FROM_CHANGED_BOXES`] | device |
/// | `Auto` | any | any | CPU |
pub(crate) fn choose_backend(backend: Backend, is_software: Option<bool>, changed: u64) -> Choice {
    Choice::Cpu(match (backend, is_software) {
        (Backend::Device, _) => return Choice::Device,
        (Backend::Cpu | Backend::Brute, _) => None,
        (Backend::Auto, None) => Some(NoDevice::NotGiven),
        (Backend::Auto, Some(true)) => Some(NoDevice::Software),
        (Backend::Auto, _) if changed < AUTO_DEVICE_FROM_CHANGED_BOXES => Some(NoDevice::FewChanged),
        (Backend::Auto, _) => return Choice::Device,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_auto_needs_a_reason_and_half_a_million_changed_boxes() {
        let auto = |device, changed| choose_backend(Backend::Auto, device, changed);
        assert_eq!(auto(None, u64::MAX), Choice::Cpu(Some(NoDevice::NotGiven)));
        assert_eq!(auto(Some(true), u64::MAX), Choice::Cpu(Some(NoDevice::Software)));
        assert_eq!(auto(Some(false), 499_999), Choice::Cpu(Some(NoDevice::FewChanged)));
        assert_eq!(auto(Some(false), 500_000), Choice::Device);
        for device in [None, Some(true), Some(false)] {
            assert_eq!(choose_backend(Backend::Device, device, 2), Choice::Device);
            for backend in [Backend::Cpu, Backend::Brute] {
                assert_eq!(choose_backend(backend, device, u64::MAX), Choice::Cpu(None));
            }
        }
    }
}
