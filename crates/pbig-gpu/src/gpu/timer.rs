//! Timestamps of the kernels of a call.

use super::gpu_device::GpuDevice;
use crate::GpuOptions;
use pbig_shaders::Kernel;
use std::time::Duration;
use wgpu::CommandEncoder;

/// Maximum number of kernels of a call that are timed: each takes two timestamps, and no query set of WebGPU holds more.
const MOST_TIMED: u32 = wgpu::QUERY_SET_MAX_QUERIES / 2;

/// A query set, and the kernels that it has timed in this call.
#[derive(Debug)]
pub(super) struct Timer {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    kernels: Vec<&'static Kernel>,
}

impl Timer {
    /// Makes a timer if times are wanted: some drivers allow about 32 query sets in all.
    pub(super) fn new(device: &GpuDevice, options: &GpuOptions) -> Option<Self> {
        if !options.time_kernels || !device.handle.features().contains(wgpu::Features::TIMESTAMP_QUERY) {
            return None;
        }
        let (label, ty, count) = (Some("times"), wgpu::QueryType::Timestamp, 2 * MOST_TIMED);
        let queries = device.handle.create_query_set(&wgpu::QuerySetDescriptor { label, ty, count });
        let usage = wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC;
        let resolved = device.buffer("times", u64::from(count) * 8, usage);
        Some(Self { queries, resolved, kernels: Vec::new() })
    }

    /// Forgets the kernels of a call that failed.
    pub(super) fn start(&mut self) {
        self.kernels.clear();
    }

    /// Returns the timestamps of a pass that runs one kernel, unless all are taken.
    pub(super) fn time(&mut self, kernel: &'static Kernel) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        let at = 2 * self.kernels.len() as u32;
        (at < 2 * MOST_TIMED).then(|| self.kernels.push(kernel))?;
        Some(wgpu::ComputePassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: Some(at),
            end_of_pass_write_index: Some(at + 1),
        })
    }

    /// Records the copy of the timestamps into a staging buffer.
    pub(super) fn resolve(&self, encoder: &mut CommandEncoder, staging: &wgpu::Buffer) {
        encoder.resolve_query_set(&self.queries, 0..2 * self.kernels.len() as u32, &self.resolved, 0);
        encoder.copy_buffer_to_buffer(&self.resolved, 0, staging, 0, self.bytes());
    }

    pub(super) fn bytes(&self) -> u64 {
        16 * self.kernels.len() as u64
    }

    /// Returns the kernels of the call with their times. Some drivers' ticks run backwards across a reset: then a time is 0.
    pub(super) fn take(&mut self, ticks: &[[u64; 2]], period: f32) -> Vec<(&'static Kernel, Duration)> {
        let time = |[start, end]: &[u64; 2]| end.saturating_sub(*start) as f64 * f64::from(period);
        let times = ticks.iter().map(|ticks| Duration::from_nanos(time(ticks) as u64));
        self.kernels.drain(..).zip(times).collect()
    }
}
