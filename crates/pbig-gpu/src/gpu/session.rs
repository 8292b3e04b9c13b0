//! The state of a finder on a device, and what goes there and comes back.

use super::error::Result;
use super::forecast::Forecast;
use super::gpu_device::GpuDevice;
use super::passes::{self, Step};
use super::reports::Counts;
use super::storage::{BufferId, Fetch, Storage};
use super::timer::Timer;
use super::wait;
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
    pub(super) fn new(device: &Arc<GpuDevice>, options: &GpuOptions) -> Self {
        Self {
            storage: Storage::new(device, options),
            timer: Timer::new(device, options),
            forecast: Forecast::default(),
            params: Params::default(),
            max_pairs: 0,
            found: DeviceFound::default(),
            prefetched: Vec::new(),
            submissions: 0,
        }
    }

    /// Records and submits kernels that check these work items. Beyond the limits they count, and write no more.
    pub(super) fn submit(&mut self, items: Chunk, steps: &[Step]) -> Result<()> {
        let mut clock = Clock::start();
        let storage = &mut self.storage;
        let chunk = storage.with_room(items, self.max_pairs);
        storage.write(Buffer::Params, &[self.params])?;
        storage.write(Buffer::Chunk, &[chunk])?;
        let mut encoder = storage.device.encoder();
        passes::record(storage, &mut encoder, steps, self.timer.as_mut());
        storage.device.submit(encoder);
        self.submissions += 1;
        self.found.report.record += clock.lap();
        Ok(())
    }

    /// Waits for the counts of what was submitted, and prefetches the pairs if few are expected.
    pub(super) async fn counts(&mut self) -> Result<Counts> {
        let is_short = 4 * self.forecast.words <= PREFETCHED_BYTES && self.found.report.waits == 0;
        let room = PREFETCHED_BYTES.min(self.storage.size(Buffer::Out));
        let pairs = if is_short { room } else { 0 };
        let copy = |storage: &Storage, encoder: &mut _, staging: &_| {
            Counts::copy(storage, encoder, staging);
            if pairs > 0 {
                encoder.copy_buffer_to_buffer(storage.get(Buffer::Out), 0, staging, Counts::BYTES, pairs);
            }
        };
        let fetch = self.storage.fetch(BufferId::Staging(0), Counts::BYTES + pairs, copy)?;
        let take = |session: &mut Self, bytes: &[u8]| {
            let (counts, pairs) = bytes.split_at(Counts::BYTES as usize);
            session.prefetched = bytemuck::pod_collect_to_vec(pairs);
            Ok(bytemuck::pod_read_unaligned(counts))
        };
        self.receive(fetch, take).await
    }

    /// Submits the copy of some bytes of pairs to a staging buffer.
    pub(super) fn fetch_pairs(&mut self, range: Range<u64>, which: usize) -> Result<Fetch> {
        let bytes = range.end - range.start;
        self.storage.fetch(BufferId::Staging(which), bytes, |storage, encoder, staging| {
            encoder.copy_buffer_to_buffer(storage.get(Buffer::Out), range.start, staging, 0, bytes);
        })
    }

    /// Takes the times of the call's kernels, if they are wanted.
    pub(super) async fn take_times(&mut self) -> Result<()> {
        let Some(timer) = &self.timer else { return Ok(()) };
        let copy = |_: &_, encoder: &mut _, staging: &_| timer.resolve(encoder, staging);
        let fetch = self.storage.fetch(BufferId::Staging(0), timer.bytes(), copy)?;
        let collect = |_: &mut Self, bytes: &[u8]| Ok(bytemuck::pod_collect_to_vec(bytes));
        let ticks: Vec<[u64; 2]> = self.receive(fetch, collect).await?;
        let (report, period) = (&mut self.found.report, self.storage.device.queue.get_timestamp_period());
        for (kernel, time) in self.timer.iter_mut().flat_map(|timer| timer.take(&ticks, period)) {
            match report.kernels.iter_mut().find(|(known, _)| *known == kernel.name) {
                Some((_, sum)) => *sum += time,
                None => report.kernels.push((kernel.name, time)),
            }
            report.map += if kernel.stage == Stage::Map { time } else { Default::default() };
        }
        Ok(())
    }

    /// Waits for copies, and gives the bytes to `take` where they lie.
    pub(super) async fn receive<T>(
        &mut self,
        Fetch { staging, bytes, submission, submitting }: Fetch,
        take: impl FnOnce(&mut Self, &[u8]) -> Result<T>,
    ) -> Result<T> {
        let (mut clock, device) = (Clock::start(), self.storage.device.clone());
        let submissions = std::mem::take(&mut self.submissions).max(1);
        let patience = self.storage.options.patience.saturating_mul(submissions);
        wait::map(&device, &staging, bytes, submission, patience).await?;
        let report = &mut self.found.report;
        report.wait += submitting + clock.lap();
        (report.waits, report.downloaded) = (report.waits + 1, report.downloaded + bytes);
        device.read(&staging, bytes, |bytes| take(self, bytes))?
    }
}
