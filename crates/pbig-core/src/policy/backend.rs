//! The choice between the CPU and a device: a function of counts, the same on every machine with the same devices.

use crate::Backend;
use std::fmt;

/// Minimum number of boxes for [`Backend::Auto`] to search them on a hardware device. With so many, an H100 took 0.7 to 1.0 of the time
/// of 16 threads, and 0.3 to 0.4 of that of four. No smaller device was measured.
pub(crate) const AUTO_DEVICE_FROM_BOXES: u64 = 100_000;

/// The work of a call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Work {
    /// A search of this number of boxes.
    Search(u64),
    Update,
}

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
    /// There are too few boxes for a search.
    FewBoxes,
    /// An update: [`Backend::Auto`] leaves all of them to the CPU.
    Update,
}

impl fmt::Display for NoDevice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotGiven => "none was given",
            Self::Software => "the given one is software",
            Self::FewBoxes => "there are too few boxes",
            Self::Update => "updates are made by the CPU",
        })
    }
}

/// Chooses the backend for a call. `is_software` tells about the device, if there is one.
///
/// | backend | device | work | choice |
/// | --- | --- | --- | --- |
/// | `Device` | any | any | device; without one the caller falls back to the CPU |
/// | `Cpu`, `Brute` | any | any | CPU |
/// | `Auto` | hardware | a search of at least [`AUTO_DEVICE_FROM_BOXES`] | device |
/// | `Auto` | any | any | CPU |
///
/// In an update a device searches all boxes. The CPU looks at the changed ones alone if they are few.
pub(crate) fn choose_backend(backend: Backend, is_software: Option<bool>, work: Work) -> Choice {
    Choice::Cpu(match (backend, is_software) {
        (Backend::Device, _) => return Choice::Device,
        (Backend::Cpu | Backend::Brute, _) => None,
        (Backend::Auto, None) => Some(NoDevice::NotGiven),
        (Backend::Auto, Some(true)) => Some(NoDevice::Software),
        (Backend::Auto, _) => match work {
            Work::Update => Some(NoDevice::Update),
            Work::Search(boxes) if boxes < AUTO_DEVICE_FROM_BOXES => Some(NoDevice::FewBoxes),
            Work::Search(_) => return Choice::Device,
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_auto_needs_a_reason_and_a_search_of_many_boxes() {
        let auto = |device, boxes| choose_backend(Backend::Auto, device, Work::Search(boxes));
        assert_eq!(auto(None, u64::MAX), Choice::Cpu(Some(NoDevice::NotGiven)));
        assert_eq!(auto(Some(true), u64::MAX), Choice::Cpu(Some(NoDevice::Software)));
        assert_eq!(auto(Some(false), 99_999), Choice::Cpu(Some(NoDevice::FewBoxes)));
        assert_eq!(auto(Some(false), 100_000), Choice::Device);
        let update = choose_backend(Backend::Auto, Some(false), Work::Update);
        assert_eq!(update, Choice::Cpu(Some(NoDevice::Update)));
        for device in [None, Some(true), Some(false)] {
            for work in [Work::Search(2), Work::Update] {
                assert_eq!(choose_backend(Backend::Device, device, work), Choice::Device);
            }
            for backend in [Backend::Cpu, Backend::Brute] {
                assert_eq!(choose_backend(backend, device, Work::Search(u64::MAX)), Choice::Cpu(None));
            }
        }
    }
}
