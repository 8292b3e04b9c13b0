//! What can go wrong with a device. None of it reaches a caller of [`crate::Finder`]: the call
//! finishes on the CPU, and the report says why.

use crate::Error;
use crate::decode::DecodeError;

/// Why a device could not do the work.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GpuError {
    /// No adapter, or none of the wanted name.
    #[error("no GPU adapter{wanted}; there are: {found}")]
    NoAdapter {
        /// The name asked for, in words.
        wanted: String,
        /// The adapters that exist.
        found: String,
    },
    /// `WGPU_BACKEND` is set, and names nothing that wgpu knows: no adapter is looked for.
    #[error("no GPU adapter: WGPU_BACKEND={value:?} names no API (known: vulkan, metal, dx12, gl)")]
    UnknownApi {
        /// What it is set to.
        value: String,
    },
    /// The adapter gave no device.
    #[error("the adapter {adapter} gave no device: {why}")]
    NoDevice {
        /// The adapter.
        adapter: String,
        /// What it said.
        why: String,
    },
    /// The device's limits are below those that every WebGPU device has.
    #[error("the device allows {found} {what}, but {needed} are needed")]
    TooLimited {
        /// Which limit.
        what: &'static str,
        /// What the device has.
        found: u64,
        /// What pbig needs.
        needed: u64,
    },
    /// The device was lost, before or during the call.
    #[error("the device was lost")]
    Lost,
    /// The device did not answer in time.
    #[error("the device did not answer within {0:?}")]
    Timeout(std::time::Duration),
    /// The device has no memory left.
    #[error("out of device memory")]
    OutOfMemory,
    /// wgpu refused a shader or a command.
    #[error("refused: {0}")]
    Refused(String),
    /// A buffer would be larger than a limit allows, and the work cannot be split further.
    #[error(
        "{bytes} bytes for {what} are more than the {limit} that the device or GpuOptions::max_bytes allows"
    )]
    TooLarge {
        /// Which buffer.
        what: &'static str,
        /// Its size.
        bytes: u64,
        /// The limit.
        limit: u64,
    },
    /// The device returned words that are no pairs.
    #[error(transparent)]
    Decode(#[from] DecodeError),
    /// The device failed a short while ago.
    #[error("the device failed {ago:?} ago ({why}); it is tried again after {pause:?}")]
    Paused {
        /// When.
        ago: std::time::Duration,
        /// How.
        why: String,
        /// See [`crate::GpuOptions::pause`].
        pause: std::time::Duration,
    },
}

/// Why a search on a device ended early.
#[derive(Debug, PartialEq)]
pub(crate) enum Failure {
    /// The call is at an end: the CPU would say the same.
    Call(Error),
    /// The CPU can do what the device could not.
    Device(GpuError),
}

impl<E: Into<GpuError>> From<E> for Failure {
    fn from(error: E) -> Self {
        Self::Device(error.into())
    }
}
