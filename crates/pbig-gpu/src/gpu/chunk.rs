//! A chunk of work items: submitted to the device, awaited, and decoded.

use super::coding::bit_words;
use super::error::Failure;
use super::gpu_device::Variant;
use super::items::rest;
use super::passes::{Recording, Step, check, lists_fit, sort};
use super::readback::{self, HEADER_BYTES, Header, Mapped};
use super::session::Session;
use super::storage::{BufferId, Side};
use super::{GpuError, wait};
use crate::decode::{self, DecodeError};
use crate::layout::{BITS, Chunk, Counters, PACKED, Params, SORTED, Totals, halves, wide};
use pbig_core::internal::Clock;
use pbig_shaders::{Buffer, Kernel};
use std::time::Duration;

/// A chunk that the device is working on.
#[derive(Debug)]
pub(super) struct PendingChunk {
    pub(super) items: Chunk,
    side: Side,
    submission: wgpu::SubmissionIndex,
    /// Number of submissions that the wait for it covers: those before it have no wait of their own.
    submissions: u32,
    /// Bytes of output that come with the header.
    prefetched: u64,
    passes: Vec<&'static Kernel>,
}

pub(super) enum ChunkResult {
    /// All of its pairs are found.
    Done,
    /// A list of the map did not fit, so nothing was checked.
    MapTooLarge,
    /// The plan was made for other boxes, so nothing was checked.
    TooManyTests,
    /// The output needs this many words.
    OutputTooLarge(u64),
    /// The pairs are on the device, to be sorted when the other chunks are done.
    Unsorted,
}

impl Session {
    /// Submits a chunk: uploads that wait, and `steps`.
    pub(super) fn submit(
        &mut self,
        items: Chunk,
        side: Side,
        steps: &[Step],
    ) -> Result<PendingChunk, GpuError> {
        let prefetched = self.make_room(side)?;
        self.write_chunk(items, side)?;
        let (submission, passes) = self.record(side, steps, Some(prefetched))?;
        Ok(PendingChunk { items, side, submission, submissions: 1, prefetched, passes })
    }

    /// Checks the `expected` work items after `done`, which add their pairs to those of the first. Sorts all.
    pub(super) fn submit_rest_and_sort(
        &mut self,
        done: &Chunk,
        expected: &Counters,
    ) -> Result<PendingChunk, GpuError> {
        let others = self.chunks_after(done, expected);
        for items in &others {
            self.submit_unread(*items, &check(items))?;
        }
        let Counters { small_items, large_items, .. } = *expected;
        let (small_items, large_items) =
            (small_items.max(done.small_items), large_items.max(done.large_items));
        let last = self.submit(Chunk { small_items, large_items, ..*done }, 0, &sort(&self.params))?;
        Ok(PendingChunk { submissions: others.len() as u32 + 2, ..last })
    }

    /// Submits a chunk whose output stays on the device.
    pub(super) fn submit_unread(&mut self, items: Chunk, steps: &[Step]) -> Result<(), GpuError> {
        self.write_chunk(items, 0)?;
        self.record(0, steps, None).map(|_| ())
    }

    /// Tells the kernels which work items to check, and how much output there may be: beyond the limit they count no more.
    fn write_chunk(&mut self, items: Chunk, side: Side) -> Result<(), GpuError> {
        let capacity = self.storage.size(BufferId::of(Buffer::Out, side)) / 4;
        let word_capacity = capacity.min(u64::from(u32::MAX) - 1) as u32;
        let items = Chunk { word_capacity, pairs_left: halves(self.sink.left()), ..items };
        self.storage.write(BufferId::of(Buffer::Chunk, side), &[items])
    }

    /// Records and submits uploads that wait, `steps`, and a readback of some bytes of output, if they are told.
    /// Returns the kernels.
    fn record(
        &mut self,
        side: Side,
        steps: &[Step],
        prefetched: Option<u64>,
    ) -> Result<(wgpu::SubmissionIndex, Vec<&'static Kernel>), GpuError> {
        let mut clock = Clock::start();
        self.storage.write(Buffer::Params, &[self.params])?;
        let timestamps = self.timestamps.as_ref().filter(|_| prefetched.is_some());
        let copies = self.storage.copies.take();
        let has_copies = copies.is_some();
        let mut recording = Recording {
            encoder: copies.unwrap_or_else(|| self.device.encoder()),
            storage: &mut self.storage,
            side,
            variant: Variant::new(&self.options),
            queries: timestamps.map(|timestamps| &timestamps.queries),
            passes: Vec::new(),
        };
        recording.record(steps);
        if let Some(prefetched) = prefetched {
            readback::record(&mut recording, timestamps, prefetched);
        }
        let Recording { encoder, passes, .. } = recording;
        let submission = self.device.submit(encoder);
        if has_copies {
            self.storage.take_staging_back();
        }
        self.sink.found.report.record += clock.lap();
        Ok((submission, passes))
    }

    /// Makes the buffers for the output of a chunk. Returns the bytes to prefetch.
    pub(super) fn make_room(&mut self, side: Side) -> Result<u64, GpuError> {
        let first_bytes = self.first_bytes();
        let (storage, sizes) = (&mut self.storage, &self.sizes);
        let (out, most) = (BufferId::of(Buffer::Out, side), storage.max_buffer_bytes);
        let (words, prefetched) = if self.params.flags & BITS == 0 {
            (sizes.word_capacity, sizes.expected_words + sizes.expected_words / 4 + 64)
        } else {
            // The last workgroup writes all of its eight words.
            let words = bit_words(&self.params).next_multiple_of(8);
            (words, words)
        };
        storage.ensure(out, (4 * words).clamp(first_bytes.min(most), most))?;
        storage.ensure(BufferId::of(Buffer::Totals, side), size_of::<Totals>() as u64)?;
        storage.ensure(Buffer::Counters, size_of::<Counters>() as u64)?;
        let prefetched = (4 * prefetched).min(storage.size(out)).min(most - HEADER_BYTES);
        storage.ensure(BufferId::Staging(side), HEADER_BYTES + prefetched)?;
        Ok(prefetched)
    }

    /// Waits for a chunk and decodes its output where it lies, if everything fitted.
    pub(super) async fn finish(&mut self, chunk: PendingChunk) -> Result<ChunkResult, Failure> {
        let staging = BufferId::Staging(chunk.side);
        let patience = self.options.patience.saturating_mul(chunk.submissions);
        let bytes = HEADER_BYTES + chunk.prefetched;
        let received = self.receive(staging, bytes, chunk.submission, patience).await?;
        let (header, prefetched) = received.split_at(HEADER_BYTES as usize);
        let header: Header = bytemuck::pod_read_unaligned(header);
        if self.timestamps.is_some() {
            let times = header.times(&chunk.passes, self.device.queue.get_timestamp_period());
            times.for_each(|(kernel, time)| self.sink.add_time(kernel, time));
        }
        let Header { totals, counters, .. } = header;
        let (out, needed) = (BufferId::of(Buffer::Out, chunk.side), output_words(&self.params, &totals));
        let repeat = self.refused(&counters);
        if repeat.is_none() {
            // The counts of a refused map are of no account.
            self.sink.check(found_pairs(&self.params, &totals))?;
        }
        let fits = needed <= self.storage.size(out) / 4;
        let report = &mut self.sink.found.report;
        if let Some(repeat) = repeat.or((!fits).then_some(ChunkResult::OutputTooLarge(needed))) {
            report.repeats += 1;
            return Ok(repeat);
        }
        report.chunks += chunk.submissions.saturating_sub(1).max(1);
        let is_sorted = totals.sorted != 0;
        if self.has(SORTED) && !is_sorted && !rest(&counters, &chunk.items).is_empty() {
            return Ok(ChunkResult::Unsorted);
        }
        self.sink.count(&self.params, &totals, needed);
        self.take_output(bytemuck::cast_slice(prefetched), out, needed, is_sorted).await?;
        Ok(ChunkResult::Done)
    }

    fn has(&self, flag: u32) -> bool {
        self.params.flags & flag != 0
    }

    /// Returns why the map has to be repeated, if it has.
    fn refused(&mut self, counters: &Counters) -> Option<ChunkResult> {
        if self.params.levels == 0 {
            return None;
        }
        self.sizes.lists = *counters;
        // First: lists that a plan for other boxes makes are not worth their memory.
        if counters.tests > self.params.most_tests || counters.too_many_tests != 0 {
            return Some(ChunkResult::TooManyTests);
        }
        (!lists_fit(&self.params, counters)).then_some(ChunkResult::MapTooLarge)
    }

    /// Reads the words of output that did not come with the header, and decodes all. Notes how many there were.
    async fn take_output(
        &mut self,
        prefetched: &[u32],
        out: BufferId,
        needed: u64,
        is_sorted: bool,
    ) -> Result<(), Failure> {
        self.sizes.max_words = self.sizes.max_words.max(needed);
        self.sizes.expected_words = self.sizes.max_words;
        let have = prefetched.len() as u64;
        if needed <= have {
            return self.decode_words(&prefetched[..needed as usize], is_sorted).await;
        }
        if self.has(PACKED) || self.has(BITS) {
            // A record may begin in one part and end in the other. The second is given back, for the entries.
            let rest = self.fetch(out, have, needed).await?;
            let words = [prefetched, bytemuck::cast_slice(&rest)].concat();
            drop(rest);
            return self.decode_words(&words, is_sorted).await;
        }
        // Plain pairs are decoded where they lie: a copy of many would take longer than the device.
        let whole_pairs = prefetched.len() & !1;
        self.decode_words(&prefetched[..whole_pairs], is_sorted).await?;
        let rest = self.fetch(out, whole_pairs as u64, needed).await?;
        self.decode_words(bytemuck::cast_slice(&rest), is_sorted).await
    }

    async fn decode_words(&mut self, words: &[u32], is_sorted: bool) -> Result<(), Failure> {
        // Records name entries, which are read once a job.
        let entries = u64::from(self.sizes.lists.entries);
        if self.has(PACKED) && self.table.is_none() && !words.is_empty() && entries > 0 {
            let entries = self.fetch(Buffer::Entries.into(), 0, entries).await?;
            self.table = Some(bytemuck::pod_collect_to_vec(&entries));
        }
        let mut clock = Clock::start();
        self.decode(words, is_sorted)?;
        self.sink.found.report.decode += clock.lap();
        self.sink.check(0)
    }

    fn decode(&mut self, words: &[u32], is_sorted: bool) -> Result<(), DecodeError> {
        let boxes = self.params.boxes;
        let (is_packed, is_bits) = (self.has(PACKED), self.has(BITS));
        let pairs = &mut self.sink.found.pairs;
        if is_bits {
            decode::bits(words, boxes, pairs)
        } else if is_packed {
            decode::records(words, self.table.as_deref().unwrap_or(&[]), boxes, pairs)
        } else {
            decode::plain(words, boxes, is_sorted, pairs)
        }
    }

    /// Reads the words `from..to` of a buffer, at least one, in a submission of its own.
    async fn fetch(&mut self, source: BufferId, from: u64, to: u64) -> Result<Mapped, GpuError> {
        let bytes = 4 * (to - from);
        self.storage.ensure(BufferId::FetchStaging, bytes)?;
        let staging = self.storage.get(BufferId::FetchStaging);
        let mut encoder = self.device.encoder();
        encoder.copy_buffer_to_buffer(self.storage.get(source), 4 * from, staging, 0, bytes);
        let submission = self.device.submit(encoder);
        self.receive(BufferId::FetchStaging, bytes, submission, self.options.patience).await
    }

    /// Waits for a submission. Returns the first `bytes` of the staging buffer that it has filled.
    async fn receive(
        &mut self,
        staging: BufferId,
        bytes: u64,
        submission: wgpu::SubmissionIndex,
        patience: Duration,
    ) -> Result<Mapped, GpuError> {
        let mut clock = Clock::start();
        let staging = self.storage.get(staging);
        wait::map(&self.device, staging, bytes, submission, patience).await?;
        let received = Mapped::new(&self.device, staging, bytes)?;
        let report = &mut self.sink.found.report;
        report.wait += clock.lap();
        report.downloaded += bytes;
        report.waits += 1;
        Ok(received)
    }
}

/// Returns the number of words of output. The device does not count bits.
fn output_words(params: &Params, totals: &Totals) -> u64 {
    if params.flags & BITS == 0 { wide(totals.words) } else { bit_words(params) }
}

/// Returns the number of pairs. The device does not count plain ones.
fn found_pairs(params: &Params, totals: &Totals) -> u64 {
    if params.flags & (PACKED | BITS) == 0 { wide(totals.words) / 2 } else { wide(totals.pairs) }
}
