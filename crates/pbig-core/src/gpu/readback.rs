//! Readback: copies the output of a submission to the host.

use super::GpuError;
use super::commands::{Commands, MAX_PASSES};
use super::device::GpuDevice;
use super::storage::BufferId;
use crate::layout::{Counters, Totals};
use bytemuck::{Pod, Zeroable};
use pbig_shaders::Buffer;
use std::sync::mpsc;
use std::time::Duration;

/// The content of a staging buffer before the words of output.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct Header {
    pub(super) counters: Counters,
    pub(super) totals: Totals,
    /// Begins at byte 56: timestamps must begin at a multiple of 8.
    ticks: [u64; 2 * MAX_PASSES as usize],
}

pub(super) const HEADER_BYTES: u64 = size_of::<Header>() as u64;
const TOTALS_AT: u64 = size_of::<Counters>() as u64;
const TICKS_AT: u64 = TOTALS_AT + size_of::<Totals>() as u64;

impl Header {
    /// Returns the device time of each pass. Some drivers' ticks run backwards across a reset: then it is 0.
    pub(super) fn times(&self, passes: &[&'static str], period: f32) -> Vec<(&'static str, Duration)> {
        let time = |i: usize| {
            let ticks = self.ticks[2 * i + 1].saturating_sub(self.ticks[2 * i]);
            Duration::from_nanos((ticks as f64 * f64::from(period)) as u64)
        };
        passes.iter().enumerate().map(|(i, &name)| (name, time(i))).collect()
    }
}

/// Timestamps of the passes of a submission: a query set, and the buffer that it is resolved to.
#[derive(Debug)]
pub(super) struct Timestamps {
    pub(super) queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
}

impl Timestamps {
    /// Makes the query set, if the device has timestamps.
    pub(super) fn new(device: &GpuDevice) -> Result<Option<Self>, GpuError> {
        if !device.has_timestamps {
            return Ok(None);
        }
        let count = 2 * MAX_PASSES;
        let usage = wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC;
        Ok(Some(Self {
            queries: device.handle.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("times"),
                ty: wgpu::QueryType::Timestamp,
                count,
            }),
            resolved: device.buffer("times", u64::from(count) * 8, usage)?,
        }))
    }
}

/// Records the copies that end a submission: the header, and the first `prefetch` bytes of output, about as many as the
/// last call needed (PBIG 5.3).
pub(super) fn record(commands: &mut Commands<'_>, timestamps: Option<&Timestamps>, prefetch: u64) {
    let staging = commands.storage.get(BufferId::Staging(commands.side));
    let (totals, out) = (commands.buffer(Buffer::Totals), commands.buffer(Buffer::Out));
    let counters = commands.buffer(Buffer::Counters);
    let encoder = &mut commands.encoder;
    encoder.copy_buffer_to_buffer(counters, 0, staging, 0, TOTALS_AT);
    encoder.copy_buffer_to_buffer(totals, 0, staging, TOTALS_AT, size_of::<Totals>() as u64);
    if let Some(timestamps) = timestamps {
        let used = 2 * commands.passes.len() as u32;
        encoder.resolve_query_set(&timestamps.queries, 0..used, &timestamps.resolved, 0);
        encoder.copy_buffer_to_buffer(&timestamps.resolved, 0, staging, TICKS_AT, u64::from(used) * 8);
    }
    if prefetch > 0 {
        encoder.copy_buffer_to_buffer(out, 0, staging, HEADER_BYTES, prefetch);
    }
}

/// Waits for a submission, and passes the first `bytes` of the staging buffer that it has filled to `read`.
pub(super) fn read<T>(
    device: &GpuDevice,
    staging: &wgpu::Buffer,
    bytes: u64,
    submission: wgpu::SubmissionIndex,
    patience: Duration,
    read: impl FnOnce(&[u8]) -> T,
) -> Result<T, GpuError> {
    let (sender, mapped) = mpsc::channel();
    staging.map_async(wgpu::MapMode::Read, 0..bytes, move |result| {
        // The receiver is gone if the wait was given up.
        let _ = sender.send(result);
    });
    device.wait(submission, patience)?;
    // If another thread polls the device, that thread calls back, perhaps a moment later.
    if !matches!(mapped.recv_timeout(patience), Ok(Ok(()))) {
        return Err(device.give_up());
    }
    let view = staging.get_mapped_range(0..bytes).map_err(|_| device.give_up())?;
    let result = read(&view);
    drop(view);
    staging.unmap();
    Ok(result)
}
