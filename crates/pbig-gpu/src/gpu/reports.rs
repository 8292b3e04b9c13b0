//! The counts of calls that nobody waits for: each call copies them into a small buffer, which a later call reads when it is mapped.

use super::gpu_device::GpuDevice;
use super::readback::{Counts, Mapped};
use crate::layout::SUMMARY_WORDS;
use crate::pbig::Summary;
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

/// Maximum number of calls whose counts are on their way. The counts of further calls stay on the device.
const MOST_REPORTS: usize = 4;

const REPORT_BYTES: u64 = Counts::BYTES + 4 * SUMMARY_WORDS as u64;

/// The device has not been told to fill the buffer, or its commands were thrown away.
const FREE: u8 = 0;
const IN_FLIGHT: u8 = 1;
const MAPPED: u8 = 2;

/// A call's report.
#[derive(Debug)]
pub(super) struct Learned {
    pub(super) counts: Counts,
    /// Set if the call measured its boxes.
    pub(super) summary: Option<Summary>,
    /// Number of boxes of the call.
    pub(super) boxes: u32,
    /// Number of the call's plan.
    pub(super) plan: u32,
}

/// A buffer for a report.
#[derive(Debug)]
struct Slot {
    staging: wgpu::Buffer,
    /// Shared with the callback of the mapping, which is dropped with commands that are never submitted.
    state: Arc<AtomicU8>,
    has_summary: bool,
    boxes: u32,
    plan: u32,
}

/// The buffers for reports.
#[derive(Debug, Default)]
pub(super) struct Reports {
    slots: Vec<Slot>,
}

impl Slot {
    fn new(device: &GpuDevice) -> Self {
        let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let staging = device.buffer("report", REPORT_BYTES, usage, false);
        Self { staging, state: Arc::new(AtomicU8::new(FREE)), has_summary: false, boxes: 0, plan: 0 }
    }

    fn is_free(&self) -> bool {
        let state = self.state.load(Ordering::Acquire);
        state == FREE || (state == IN_FLIGHT && Arc::strong_count(&self.state) == 1)
    }

    /// Reads a report, and frees the buffer.
    fn read(&self, device: &GpuDevice) -> Option<Learned> {
        self.state.store(FREE, Ordering::Relaxed);
        let bytes = if self.has_summary { REPORT_BYTES } else { Counts::BYTES };
        let mapped = Mapped::new(device, &self.staging, bytes).ok()?;
        let (counts, words) = mapped.split_at(Counts::BYTES as usize);
        let summary = self.has_summary.then(|| Summary::of_device(bytemuck::cast_slice(words), self.boxes));
        Some(Learned {
            counts: bytemuck::pod_read_unaligned(counts),
            summary,
            boxes: self.boxes,
            plan: self.plan,
        })
    }
}

impl Reports {
    /// Returns the reports that have arrived. Does not wait for others.
    pub(super) fn take(&mut self, device: &GpuDevice) -> Vec<Learned> {
        device.poll_now();
        let arrived = self.slots.iter().filter(|slot| slot.state.load(Ordering::Acquire) == MAPPED);
        arrived.filter_map(|slot| slot.read(device)).collect()
    }

    /// Records the copies of a report, from the buffers of counters and totals and that of the summary, of a call with this number of boxes
    /// and this plan.
    pub(super) fn record(
        &mut self,
        device: &GpuDevice,
        encoder: &mut wgpu::CommandEncoder,
        (counters, totals, summary): (&wgpu::Buffer, &wgpu::Buffer, Option<&wgpu::Buffer>),
        (boxes, plan): (u32, u32),
    ) {
        let Some(slot) = self.free(device) else { return };
        (slot.has_summary, slot.boxes, slot.plan) = (summary.is_some(), boxes, plan);
        Counts::copy(encoder, [counters, totals, &slot.staging]);
        if let Some(summary) = summary {
            encoder.copy_buffer_to_buffer(summary, 0, &slot.staging, Counts::BYTES, 4 * SUMMARY_WORDS as u64);
        }
        slot.state.store(IN_FLIGHT, Ordering::Relaxed);
        let state = slot.state.clone();
        encoder.map_buffer_on_submit(&slot.staging, wgpu::MapMode::Read, .., move |result| {
            state.store(if result.is_ok() { MAPPED } else { FREE }, Ordering::Release);
        });
    }

    /// Returns a buffer that the device does not use, or none if too many are on their way.
    fn free(&mut self, device: &GpuDevice) -> Option<&mut Slot> {
        while self.slots.len() < MOST_REPORTS {
            self.slots.push(Slot::new(device));
        }
        self.slots.iter_mut().find(|slot| slot.is_free())
    }
}
