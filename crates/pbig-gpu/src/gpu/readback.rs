//! Readback: counts, pairs and times on their way to the host.

use super::error::Failure;
use super::gpu_device::GpuDevice;
use super::session::Session;
use super::storage::{BufferId, Storage};
use super::{GpuError, wait};
use crate::layout::{Counters, Totals};
use bytemuck::{Pod, Zeroable};
use pbig_core::internal::Clock;
use pbig_core::{BoxIds, Pair};
use pbig_shaders::{Buffer, Stage};
use std::ops::Range;

/// Bytes of pairs that may come with the counts. Few pairs then take one wait. A call reads at most 4 kB more than its pairs.
const PREFETCHED_BYTES: u64 = 3072;

/// Bytes that the host reads at a time: while threads copy and check one piece, the next one comes.
const PIECE_BYTES: u64 = 1 << 24;

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
struct Fetch {
    staging: BufferId,
    bytes: u64,
    submission: wgpu::SubmissionIndex,
}

impl Session {
    /// Waits for the counts of what was submitted, and prefetches the pairs if few are expected.
    pub(super) async fn counts(&mut self) -> Result<Counts, GpuError> {
        let is_short = 4 * self.forecast.words <= PREFETCHED_BYTES && self.found.report.waits == 0;
        let room = PREFETCHED_BYTES.min(self.storage.size(Buffer::Out));
        let pairs = if is_short { room } else { 0 };
        let fetch =
            self.fetch(BufferId::Staging(0), Counts::BYTES + pairs, |storage, encoder, staging| {
                let [counters, totals] = [Buffer::Counters, Buffer::Totals].map(|id| storage.get(id));
                Counts::copy(encoder, [counters, totals, staging]);
                if pairs > 0 {
                    encoder.copy_buffer_to_buffer(storage.get(Buffer::Out), 0, staging, Counts::BYTES, pairs);
                }
            })?;
        let received = self.receive(fetch).await?;
        let (counts, pairs) = received.split_at(Counts::BYTES as usize);
        self.prefetched = bytemuck::pod_collect_to_vec(pairs);
        Ok(bytemuck::pod_read_unaligned(counts))
    }

    /// Reads pairs of this number of words. With pipelining a piece comes while the one before is taken.
    pub(super) async fn read_pairs(&mut self, words: u64) -> Result<(), Failure> {
        let most = if self.options.pipelining { PIECE_BYTES } else { u64::MAX };
        let piece = self.storage.max_buffer_bytes.min(most) / 8 * 8;
        let mut next = Some(self.fetch_pairs(0..(4 * words).min(piece), 0)?);
        let mut from = piece;
        while let Some(fetch) = next {
            let range = from..(4 * words).min(from + piece);
            let which = (from / piece) as usize % 2;
            next = if range.is_empty() { None } else { Some(self.fetch_pairs(range, which)?) };
            from += piece;
            let received = self.receive(fetch).await?;
            self.append(bytemuck::cast_slice(&received))?;
        }
        Ok(())
    }

    fn fetch_pairs(&mut self, range: Range<u64>, which: usize) -> Result<Fetch, GpuError> {
        let bytes = range.end - range.start;
        self.fetch(BufferId::Staging(which), bytes, |storage, encoder, staging| {
            encoder.copy_buffer_to_buffer(storage.get(Buffer::Out), range.start, staging, 0, bytes);
        })
    }

    /// Copies pairs, and checks them on the way: the output of a device is untrusted input. Threads share the work.
    pub(super) fn append(&mut self, pairs: &[Pair]) -> Result<(), Failure> {
        let mut clock = Clock::start();
        let boxes = self.params.boxes;
        let fault = |i| GpuError::BadPairs(format!("pair {i} of a piece is not a < b < {boxes}"));
        self.found.pairs.append_checked(pairs, BoxIds::First(boxes)).map_err(fault)?;
        self.found.report.decode += clock.lap();
        Ok(())
    }

    /// Takes the times of the call's kernels, if they are wanted.
    pub(super) async fn take_times(&mut self) -> Result<(), GpuError> {
        let Some(timer) = self.timer.take() else { return Ok(()) };
        let copy = |_: &_, encoder: &mut _, staging: &_| timer.resolve(encoder, staging);
        let fetch = self.fetch(BufferId::Staging(0), timer.bytes(), copy)?;
        let ticks: Vec<[u64; 2]> = bytemuck::pod_collect_to_vec(&self.receive(fetch).await?);
        let timer = self.timer.insert(timer);
        let report = &mut self.found.report;
        for (kernel, time) in timer.take(&ticks, self.device.queue.get_timestamp_period()) {
            match report.kernels.iter_mut().find(|(known, _)| *known == kernel.name) {
                Some((_, sum)) => *sum += time,
                None => report.kernels.push((kernel.name, time)),
            }
            report.map += if kernel.stage == Stage::Map { time } else { Default::default() };
        }
        Ok(())
    }

    /// Submits copies to a staging buffer of this number of bytes.
    fn fetch(
        &mut self,
        staging: BufferId,
        bytes: u64,
        copy: impl FnOnce(&Storage, &mut wgpu::CommandEncoder, &wgpu::Buffer),
    ) -> Result<Fetch, GpuError> {
        self.storage.ensure(staging, bytes)?;
        let mut encoder = self.device.encoder();
        copy(&self.storage, &mut encoder, self.storage.get(staging));
        self.found.report.downloaded += bytes;
        self.submissions += 1;
        Ok(Fetch { staging, bytes, submission: self.device.submit(encoder) })
    }

    /// Waits for copies. Returns the bytes where they lie.
    async fn receive(&mut self, fetch: Fetch) -> Result<Mapped, GpuError> {
        let mut clock = Clock::start();
        let Fetch { staging, bytes, submission } = fetch;
        let patience = self.options.patience.saturating_mul(std::mem::take(&mut self.submissions).max(1));
        let staging = self.storage.get(staging);
        wait::map(&self.device, staging, bytes, submission, patience).await?;
        let received = Mapped::new(&self.device, staging, bytes)?;
        let report = &mut self.found.report;
        report.wait += clock.lap();
        report.waits += 1;
        Ok(received)
    }
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
