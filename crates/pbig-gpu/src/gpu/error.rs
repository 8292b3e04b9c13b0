//! Errors of a device. None of them reaches a caller of [`pbig_core::Finder`]: the call finishes on the CPU, and the report
//! says why.

use pbig_core::DeviceFailure;

/// The first words of [`pbig_core::Report::fallback`] after a call that a working device left to the CPU: the set was too large, or
/// would have taken too many tests.
pub const DECLINED: &str = "the device declined: ";

/// Reason why a device could not do the work.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GpuError {
    /// There is no adapter, or none of the wanted name: the name in words, and those that exist; or `WGPU_BACKEND` names no API.
    #[error("no GPU adapter{0}")]
    NoAdapter(String),
    /// The adapter refused to open a device, for this reason.
    #[error("the adapter opened no device: {0}")]
    NoDevice(String),
    /// A limit of the device is below that of every WebGPU device: the limit, and the value that pbig needs.
    #[error("the device allows {0}")]
    TooLimited(String),
    /// The device was lost, before or during the call.
    #[error("the device was lost")]
    Lost,
    /// The device did not answer in time.
    #[error("the device did not answer within {0:?} (GpuOptions::patience)")]
    Timeout(std::time::Duration),
    /// A page may not block: it uses the `async` functions of [`crate::GpuFinder`].
    #[error("a page may not block: use GpuFinder::open_async and find_all_async")]
    WouldBlock,
    /// Another call of the page uses the device.
    #[error("another call of the page uses the device")]
    Busy,
    /// The device has no memory left.
    #[error("out of device memory")]
    OutOfMemory,
    /// wgpu refused a shader or a command.
    #[error("refused by wgpu: {0}")]
    Refused(String),
    /// The device works, but leaves the call to the CPU, for this reason: a list exceeds a limit, or there are too many tests.
    #[error("{0}")]
    Declined(String),
    /// There are more pairs than the caller allows.
    #[error("there are more pairs than the caller allows")]
    TooManyPairs,
    /// An argument is wrong, for this reason.
    #[error("{0}")]
    Argument(String),
    /// The device returned pairs that cannot be, for this reason.
    #[error("the device returned wrong pairs: {0}")]
    BadPairs(String),
    /// The device failed a short while ago, and calls wait before they try it again ([`crate::GpuOptions::pause`]).
    #[error("the device failed {0}")]
    Paused(String),
}

/// The result of what a device may fail to do.
pub(super) type Result<T, E = GpuError> = std::result::Result<T, E>;

impl GpuError {
    /// Returns true if the device failed, so that the state of buffers and forecasts may be wrong.
    pub(super) fn is_failure(&self) -> bool {
        !matches!(self, Self::Argument(_) | Self::Busy | Self::Declined(_) | Self::TooManyPairs)
    }

    /// Returns the error as the core knows it.
    pub(super) fn for_core(self) -> DeviceFailure {
        match self {
            Self::TooManyPairs => DeviceFailure::TooManyPairs,
            Self::Declined(why) => DeviceFailure::Declined(format!("{DECLINED}{why}")),
            error => DeviceFailure::Failed(error.to_string()),
        }
    }
}
