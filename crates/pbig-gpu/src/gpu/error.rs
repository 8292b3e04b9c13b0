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
    /// There is no adapter, or none of the wanted name: the name in words, and those that exist.
    #[error("no GPU adapter{0}")]
    NoAdapter(String),
    /// `WGPU_BACKEND` has this value, which names no API that wgpu knows, so no adapter is looked for.
    #[error("no GPU adapter: WGPU_BACKEND={0:?} names no API (known: vulkan, metal, dx12, gl)")]
    UnknownApi(String),
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
    /// A buffer would be larger than a limit allows.
    #[error("the buffer {what} needs {bytes} bytes, but the device or GpuOptions::max_bytes allows {limit}")]
    TooLarge {
        /// The buffer's name.
        what: &'static str,
        /// The needed size, in bytes.
        bytes: u64,
        /// The limit, in bytes.
        limit: u64,
    },
    /// The boxes may have more entries of cells than 32 bits count.
    #[error(
        "{boxes} boxes may have {entries} entries in cells, but the device counts up to {max}",
        max = u32::MAX
    )]
    TooManyEntries {
        /// The number of boxes.
        boxes: u32,
        /// The largest number of their entries.
        entries: u64,
    },
    /// All buffers together would be larger than [`crate::GpuOptions::max_total_bytes`].
    #[error(
        "with the buffer {what} the device's buffers need {bytes} bytes, but GpuOptions::max_total_bytes allows {limit}"
    )]
    OverBudget {
        /// The name of the buffer that was to be made.
        what: &'static str,
        /// The size of all buffers with it, in bytes.
        bytes: u64,
        /// The limit, in bytes.
        limit: u64,
    },
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

/// Reason why a search on a device ended early.
#[derive(Debug, PartialEq)]
pub(super) enum Failure {
    /// There are more pairs than the caller allows.
    TooManyPairs,
    /// The CPU takes less work, for this reason.
    Declined(String),
    /// The device failed, and the CPU can do the work.
    Device(GpuError),
}

impl GpuError {
    /// Returns true if the set is too large for the device or for the options.
    pub(super) fn is_of_large_set(&self) -> bool {
        matches!(self, Self::TooLarge { .. } | Self::TooManyEntries { .. } | Self::OverBudget { .. })
    }
}

impl<E: Into<GpuError>> From<E> for Failure {
    fn from(error: E) -> Self {
        match error.into() {
            // The device works: it is the set that is too large.
            error if error.is_of_large_set() => Self::Declined(error.to_string()),
            error => Self::Device(error),
        }
    }
}

impl Failure {
    /// Returns the failure as the core knows it.
    pub(super) fn for_core(self) -> DeviceFailure {
        match self {
            Self::TooManyPairs => DeviceFailure::TooManyPairs,
            Self::Declined(why) => DeviceFailure::Declined(format!("{DECLINED}{why}")),
            Self::Device(error) => DeviceFailure::Failed(error.to_string()),
        }
    }
}
