//! The counts of searches, and those that nobody waits for: each call copies them into a small buffer, which a later call reads when it
//! is mapped.

use super::gpu_device::GpuDevice;
use super::storage::Storage;
use crate::layout::{Counters, Params, SUMMARY_WORDS, Totals};
use crate::pbig::Summary;
use bytemuck::{Pod, Zeroable};
use pbig_shaders::Buffer;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use wgpu::CommandEncoder;

/// Maximum number of calls whose counts are on their way. The counts of further calls stay on the device.
const MOST_REPORTS: usize = 4;

pub(super) const SUMMARY_BYTES: u64 = 4 * SUMMARY_WORDS as u64;

/// The counts of a call.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct Counts {
    pub(super) counters: Counters,
    pub(super) totals: Totals,
}

impl Counts {
    pub(super) const BYTES: u64 = size_of::<Self>() as u64;

    pub(super) fn copy(storage: &Storage, encoder: &mut CommandEncoder, staging: &wgpu::Buffer) {
        let [counters, totals] = [size_of::<Counters>() as u64, size_of::<Totals>() as u64];
        encoder.copy_buffer_to_buffer(storage.get(Buffer::Counters), 0, staging, 0, counters);
        encoder.copy_buffer_to_buffer(storage.get(Buffer::Totals), 0, staging, counters, totals);
    }
}

/// A buffer for a report, and the call that it reports on.
#[derive(Debug)]
struct Report {
    staging: wgpu::Buffer,
    /// Shared with the callback of the mapping, which is dropped with commands that are never submitted.
    is_mapped: Arc<AtomicBool>,
    params: Params,
    has_summary: bool,
}

#[derive(Debug, Default)]
pub(super) struct Reports(Vec<Report>);

impl Report {
    fn new(device: &GpuDevice) -> Self {
        let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let staging = device.buffer("report", Counts::BYTES + SUMMARY_BYTES, usage);
        Self { staging, is_mapped: Arc::default(), params: Params::default(), has_summary: false }
    }

    /// Returns true if the device has not been told to fill the buffer, or its commands were thrown away.
    fn is_free(&mut self) -> bool {
        Arc::get_mut(&mut self.is_mapped).is_some_and(|is_mapped| !*is_mapped.get_mut())
    }
}

impl Reports {
    /// Gives the reports that have arrived to `learn`, with the parameters of their calls. Does not wait for others.
    pub(super) fn take(&self, device: &GpuDevice, mut learn: impl FnMut(&Params, Counts, Option<Summary>)) {
        device.poll_now();
        for report in self.0.iter().filter(|report| report.is_mapped.swap(false, Ordering::Acquire)) {
            let params = &report.params;
            let bytes = Counts::BYTES + if report.has_summary { SUMMARY_BYTES } else { 0 };
            // A lost device has no report.
            _ = device.read(&report.staging, bytes, |bytes| {
                let (counts, summary) = bytes.split_at(Counts::BYTES as usize);
                let summary = || Summary::of_device(bytemuck::cast_slice(summary), params.boxes);
                learn(params, bytemuck::pod_read_unaligned(counts), report.has_summary.then(summary));
            });
        }
    }

    /// Records the copies of a report on a call, unless too many are on their way.
    pub(super) fn record(
        &mut self,
        storage: &Storage,
        encoder: &mut CommandEncoder,
        params: &Params,
        has_summary: bool,
    ) {
        while self.0.len() < MOST_REPORTS {
            self.0.push(Report::new(&storage.device));
        }
        let Some(report) = self.0.iter_mut().find_map(|it| it.is_free().then_some(it)) else { return };
        (report.params, report.has_summary) = (*params, has_summary);
        Counts::copy(storage, encoder, &report.staging);
        if has_summary {
            let summary = storage.get(Buffer::Summary);
            encoder.copy_buffer_to_buffer(summary, 0, &report.staging, Counts::BYTES, SUMMARY_BYTES);
        }
        let is_mapped = report.is_mapped.clone();
        encoder.map_buffer_on_submit(&report.staging, wgpu::MapMode::Read, .., move |result| {
            is_mapped.store(result.is_ok(), Ordering::Release);
        });
    }
}
