//! The choice between the CPU and a device: a function of counts, the same on every machine with the same devices.

use std::fmt;

/// Minimum number of boxes for a search on a hardware device that nobody asked for. With so many, an H100 took 0.7 to 1.0 of the time of
/// 16 threads, and 0.3 to 0.4 of that of four. No smaller device was measured.
const AUTO_DEVICE_FROM_BOXES: u64 = 100_000;

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
    /// An update: [`Backend::Auto`](crate::Backend::Auto) leaves all of them to the CPU.
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

/// Returns the reason that keeps a call of `Backend::Auto` from the device; none if the device does it.
/// `is_software` tells about the device, if there is one. `searched` is the number of boxes in a search; none in an update, in which a
/// device would search all boxes, although few may have changed.
pub(crate) fn no_device(is_software: Option<bool>, searched: Option<u64>) -> Option<NoDevice> {
    match (is_software, searched) {
        (None, _) => Some(NoDevice::NotGiven),
        (Some(true), _) => Some(NoDevice::Software),
        (_, None) => Some(NoDevice::Update),
        (_, Some(boxes)) => (boxes < AUTO_DEVICE_FROM_BOXES).then_some(NoDevice::FewBoxes),
    }
}
