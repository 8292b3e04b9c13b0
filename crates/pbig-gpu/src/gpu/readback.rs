//! Readback: copies the output of a submission to the host.

use super::GpuError;
use super::gpu_device::GpuDevice;
use super::passes::{MAX_PASSES, Recording};
use super::storage::BufferId;
use crate::GpuOptions;
use crate::layout::{Counters, Totals};
use bytemuck::{Pod, Zeroable};
use pbig_shaders::{Buffer, Kernel};
use std::time::Duration;

/// The content of a staging buffer before the words of output.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct Header {
    pub(super) counters: Counters,
    pub(super) totals: Totals,
    /// Begins at byte 80: timestamps must begin at a multiple of 8.
    ticks: [u64; 2 * MAX_PASSES as usize],
}

pub(super) const HEADER_BYTES: u64 = size_of::<Header>() as u64;
const TOTALS_AT: u64 = size_of::<Counters>() as u64;
const TICKS_AT: u64 = TOTALS_AT + size_of::<Totals>() as u64;

impl Header {
    /// Returns the device time of each pass. Some drivers' ticks run backwards across a reset: then it is 0.
    pub(super) fn times(
        &self,
        passes: &[&'static Kernel],
        period: f32,
    ) -> impl Iterator<Item = (&'static Kernel, Duration)> {
        passes.iter().zip(self.ticks.as_chunks::<2>().0).map(move |(&kernel, [start, end])| {
            (kernel, Duration::from_nanos((end.saturating_sub(*start) as f64 * f64::from(period)) as u64))
        })
    }
}

/// Timestamps of the passes of a submission: a query set, and the buffer that it is resolved to.
#[derive(Debug)]
pub(super) struct Timestamps {
    pub(super) queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
}

impl Timestamps {
    /// Makes them if times are wanted: some drivers allow about 32 query sets in all.
    pub(super) fn new(device: &GpuDevice, options: &GpuOptions) -> Result<Option<Self>, GpuError> {
        if !device.has_timestamps || !options.time_kernels {
            return Ok(None);
        }
        let (label, ty, count) = (Some("times"), wgpu::QueryType::Timestamp, 2 * MAX_PASSES);
        let queries = device.handle.create_query_set(&wgpu::QuerySetDescriptor { label, ty, count });
        let usage = wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC;
        Ok(Some(Self { queries, resolved: device.buffer("times", u64::from(count) * 8, usage, false)? }))
    }
}

/// Records the copies that end a submission: the header, and the first `prefetch` bytes of output. Returns their bytes.
pub(super) fn record(recording: &mut Recording<'_>, timestamps: Option<&Timestamps>, prefetch: u64) -> u64 {
    let Recording { storage, encoder, passes, .. } = recording;
    let staging = storage.get(BufferId::Staging);
    let mut copied = 0;
    let mut copy = |buffer, at, bytes| {
        copied += bytes;
        encoder.copy_buffer_to_buffer(storage.get(buffer), 0, staging, at, bytes);
    };
    copy(Buffer::Counters, 0, TOTALS_AT);
    copy(Buffer::Totals, TOTALS_AT, TICKS_AT - TOTALS_AT);
    if prefetch > 0 {
        copy(Buffer::Out, HEADER_BYTES, prefetch);
    }
    if let Some(timestamps) = timestamps {
        let used = 2 * passes.len() as u32;
        encoder.resolve_query_set(&timestamps.queries, 0..used, &timestamps.resolved, 0);
        encoder.copy_buffer_to_buffer(&timestamps.resolved, 0, staging, TICKS_AT, u64::from(used) * 8);
        copied += u64::from(used) * 8;
    }
    copied
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
