//! The state of a finder on a device, and what goes there and comes back.

use super::forecast::Forecast;
use super::gpu_device::GpuDevice;
use super::passes::{Recording, Step};
use super::readback::{Counts, Fetch, Mapped};
use super::storage::{BufferId, Storage};
use super::timer::Timer;
use super::{GpuError, wait};
use crate::GpuOptions;
use crate::layout::{Chunk, Params};
use pbig_core::DeviceFound;
use pbig_core::internal::Clock;
use pbig_shaders::{Buffer, Stage};
use std::ops::Range;
use std::sync::Arc;

/// Bytes of pairs that may come with the counts. Few pairs then take one wait. A call reads at most 4 kB more than its pairs.
const PREFETCHED_BYTES: u64 = 3072;

/// The state of a finder on a device, kept from call to call.
#[derive(Debug)]
pub(super) struct Session {
    pub(super) device: Arc<GpuDevice>,
    pub(super) options: GpuOptions,
    pub(super) storage: Storage,
    pub(super) timer: Option<Timer>,
    pub(super) forecast: Forecast,
    /// Parameters of this call.
    pub(super) params: Params,
    /// Maximum number of pairs.
    pub(super) max_pairs: u64,
    /// Pairs and report of this call.
    pub(super) found: DeviceFound,
    /// Words of pairs that came with the counts.
    pub(super) prefetched: Vec<u32>,
    /// Number of submissions since the last wait whose work grows with the tests or the pairs: each has the patience of the options.
    pub(super) submissions: u32,
}

impl Session {
    pub(super) fn new(device: Arc<GpuDevice>, options: &GpuOptions) -> Self {
        Self {
            options: *options,
            storage: Storage::new(device.clone(), options),
            timer: Timer::new(&device, options),
            forecast: Forecast::default(),
            params: Params::default(),
            max_pairs: 0,
            found: DeviceFound::default(),
            prefetched: Vec::new(),
            submissions: 0,
            device,
        }
    }

    /// Records and submits kernels that check these work items. Beyond the limits they count, and write no more.
    pub(super) fn submit(&mut self, items: Chunk, steps: &[Step]) -> Result<(), GpuError> {
        let mut clock = Clock::start();
        let chunk = self.storage.with_room(items, self.max_pairs);
        self.storage.write(Buffer::Params, &[self.params])?;
        self.storage.write(Buffer::Chunk, &[chunk])?;
        let mut encoder = self.device.encoder();
        let Self { storage, options, timer, .. } = self;
        let (is_balanced, timer) = (options.load_balancing, timer.as_mut());
        Recording { storage, encoder: &mut encoder, is_balanced, timer }.record(steps);
        self.device.submit(encoder);
        self.submissions += 1;
        self.found.report.record += clock.lap();
        Ok(())
    }

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

    /// Submits the copy of some bytes of pairs to a staging buffer.
    pub(super) fn fetch_pairs(&mut self, range: Range<u64>, which: usize) -> Result<Fetch, GpuError> {
        let bytes = range.end - range.start;
        self.fetch(BufferId::Staging(which), bytes, |storage, encoder, staging| {
            encoder.copy_buffer_to_buffer(storage.get(Buffer::Out), range.start, staging, 0, bytes);
        })
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
        Ok(Fetch { staging, bytes, submission: self.device.submit(encoder) })
    }

    /// Waits for copies. Returns the bytes where they lie.
    pub(super) async fn receive(&mut self, fetch: Fetch) -> Result<Mapped, GpuError> {
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
