//! Bytes on their way to the host.

use super::GpuError;
use super::gpu_device::GpuDevice;
use super::storage::BufferId;
use crate::layout::{Counters, Totals};
use bytemuck::{Pod, Zeroable};

/// The counts of a call.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct Counts {
    pub(super) counters: Counters,
    pub(super) totals: Totals,
}

impl Counts {
    pub(super) const BYTES: u64 = size_of::<Self>() as u64;

    /// Records the copy of the counts to the start of a staging buffer.
    pub(super) fn copy(encoder: &mut wgpu::CommandEncoder, [counters, totals, staging]: [&wgpu::Buffer; 3]) {
        let counters_bytes = size_of::<Counters>() as u64;
        encoder.copy_buffer_to_buffer(counters, 0, staging, 0, counters_bytes);
        encoder.copy_buffer_to_buffer(totals, 0, staging, counters_bytes, size_of::<Totals>() as u64);
    }
}

/// Bytes that are on their way to a staging buffer.
pub(super) struct Fetch {
    pub(super) staging: BufferId,
    pub(super) bytes: u64,
    pub(super) submission: wgpu::SubmissionIndex,
}

/// The content of a staging buffer, read where it lies.
pub(super) struct Mapped {
    view: Option<wgpu::BufferView>,
    buffer: wgpu::Buffer,
}

impl Mapped {
    /// Reads the first `bytes` of a staging buffer that the host has mapped.
    pub(super) fn new(device: &GpuDevice, staging: &wgpu::Buffer, bytes: u64) -> Result<Self, GpuError> {
        let view = staging.get_mapped_range(0..bytes).map_err(|_| device.give_up())?;
        Ok(Self { view: Some(view), buffer: staging.clone() })
    }
}

impl std::ops::Deref for Mapped {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        self.view.as_deref().unwrap_or(&[])
    }
}

impl Drop for Mapped {
    fn drop(&mut self) {
        self.view = None;
        self.buffer.unmap();
    }
}
