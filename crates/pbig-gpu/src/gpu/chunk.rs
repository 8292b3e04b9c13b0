//! A chunk of work items: submitted to the device, awaited, and decoded.

use super::coding::bit_words;
use super::error::Failure;
use super::gpu_device::Variant;
use super::items::rest;
use super::passes::{
    ALL_GROUPED, Groups, MOST_RANKED, Recording, Step, check, group, lists_fit, pair_capacity, rank,
};
use super::readback::{self, HEADER_BYTES, Header, Mapped};
use super::session::{Session, first_bytes};
use super::storage::BufferId;
use super::{GpuError, wait};
use crate::decode::{self, DecodeError};
use crate::layout::{BITS, Chunk, Counters, LANES, PACKED, Params, SORTED, Totals, halves, wide};
use pbig_core::BoxIds;
use pbig_core::internal::Clock;
use pbig_shaders::{Buffer, Kernel};
use std::ops::Range;
use std::time::Duration;

/// Bytes of output that may come with the counts. Few pairs then take one wait. A call reads at most 4 kB more than its pairs.
const PREFETCHED_BYTES: u64 = 3072;

/// Bytes that the host reads at a time: while threads copy and check one piece, the next one comes.
const PIECE_BYTES: u64 = 1 << 24;

/// A chunk that the device is working on.
#[derive(Debug)]
pub(super) struct PendingChunk {
    pub(super) items: Chunk,
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
    /// There are more work items. Their pairs come behind these, in one list.
    Partial,
}

/// A piece of a buffer that is on its way to the host.
struct Fetch {
    staging: BufferId,
    bytes: u64,
    submission: wgpu::SubmissionIndex,
}

impl Session {
    /// Submits a chunk: uploads that wait, and `steps`. If the pairs are sorted, the device begins with that while their number comes
    /// home; unless the sort is timed, or so short that all pairs may come at once.
    pub(super) fn submit(&mut self, items: Chunk, steps: &[Step]) -> Result<PendingChunk, GpuError> {
        let prefetched = self.make_room()?;
        self.write_chunk(items)?;
        let mut all = steps.to_vec();
        let is_fused = prefetched > 0 || self.timestamps.is_some();
        if self.has(SORTED) && is_fused {
            self.params.pair_capacity = self.params.pair_capacity.min(MOST_RANKED);
            all.extend(group(&self.params));
            all.extend(rank(ALL_GROUPED, true));
        }
        let (submission, passes) = self.record(&all, Some(prefetched))?;
        if self.has(SORTED) && !is_fused {
            self.record(&group(&self.params), None)?;
        }
        Ok(PendingChunk { items, submission, submissions: 1, prefetched, passes })
    }

    /// Checks the `expected` work items after `done`, which add their pairs to those of the first. Sorts all.
    pub(super) fn submit_rest(
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
        let last = self.submit(Chunk { small_items, large_items, ..*done }, &[])?;
        Ok(PendingChunk { submissions: others.len() as u32 + 2, ..last })
    }

    /// Submits a chunk whose output stays on the device.
    pub(super) fn submit_unread(&mut self, items: Chunk, steps: &[Step]) -> Result<(), GpuError> {
        self.write_chunk(items)?;
        self.record(steps, None).map(|_| ())
    }

    /// Orders this number of pairs, which are grouped or will be. Each submission ranks a part of them.
    fn submit_ranks(&mut self, items: Chunk, pairs: u32) -> Result<(), GpuError> {
        for first_pair in (0..pairs).step_by(MOST_RANKED as usize) {
            let left = pairs - first_pair;
            let groups = Groups::Direct(left.min(MOST_RANKED).div_ceil(LANES));
            self.submit_unread(Chunk { first_pair, ..items }, &rank(groups, left <= MOST_RANKED))?;
        }
        Ok(())
    }

    /// Tells the kernels which work items to check, and how much output there may be: beyond the limit they count no more.
    fn write_chunk(&mut self, items: Chunk) -> Result<(), GpuError> {
        let capacity = self.storage.size(Buffer::Out) / 4;
        let word_capacity = capacity.min(u64::from(u32::MAX) - 1) as u32;
        let items = Chunk { word_capacity, pairs_left: halves(self.sink.left()), ..items };
        self.storage.write(Buffer::Chunk, &[items])
    }

    /// Records and submits uploads that wait, `steps`, and a readback of some bytes of output, if they are told.
    /// Returns the kernels.
    fn record(
        &mut self,
        steps: &[Step],
        prefetched: Option<u64>,
    ) -> Result<(wgpu::SubmissionIndex, Vec<&'static Kernel>), GpuError> {
        let mut clock = Clock::start();
        self.storage.write(Buffer::Params, &[self.params])?;
        let timestamps = self.timestamps.as_ref().filter(|_| prefetched.is_some());
        let (mut encoder, uploaded) =
            self.storage.copies.take().unwrap_or_else(|| (self.device.encoder(), vec![]));
        let mut recording = Recording {
            encoder: &mut encoder,
            storage: &mut self.storage,
            variant: Variant::new(&self.options),
            queries: timestamps.map(|timestamps| &timestamps.queries),
            passes: Vec::new(),
        };
        recording.record(steps);
        let report = &mut self.sink.found.report;
        if let Some(prefetched) = prefetched {
            report.downloaded += readback::record(&mut recording, timestamps, prefetched);
        }
        let passes = recording.passes;
        let submission = self.device.submit(encoder);
        self.storage.take_staging_back(&uploaded);
        report.record += clock.lap();
        Ok((submission, passes))
    }

    /// Makes the buffers for the output of a chunk. Returns the bytes to prefetch.
    pub(super) fn make_room(&mut self) -> Result<u64, GpuError> {
        let first_bytes = first_bytes(&self.options, self.params.boxes);
        let (storage, sizes) = (&mut self.storage, &self.sizes);
        let most = storage.max_buffer_bytes;
        let are_few = 4 * sizes.expected_words <= PREFETCHED_BYTES && self.sink.found.report.waits == 0;
        let (words, prefetched) = if self.params.flags & BITS == 0 {
            (sizes.word_capacity, if are_few { PREFETCHED_BYTES } else { 0 })
        } else {
            // The last workgroup writes all of its eight words.
            let words = bit_words(&self.params);
            (words.next_multiple_of(8), 4 * words)
        };
        storage.ensure(Buffer::Out, (4 * words).clamp(first_bytes.min(most), most))?;
        storage.ensure(Buffer::Totals, size_of::<Totals>() as u64)?;
        storage.ensure(Buffer::Counters, size_of::<Counters>() as u64)?;
        let prefetched = prefetched.min(storage.size(Buffer::Out)).min(most - HEADER_BYTES);
        storage.ensure(BufferId::Staging, HEADER_BYTES + prefetched)?;
        Ok(prefetched)
    }

    /// Waits for the counts of a chunk, and takes its output, if everything fitted.
    pub(super) async fn finish(&mut self, chunk: PendingChunk) -> Result<ChunkResult, Failure> {
        let patience = self.options.patience.saturating_mul(chunk.submissions);
        let bytes = HEADER_BYTES + chunk.prefetched;
        let received = self.receive(BufferId::Staging, bytes, chunk.submission, patience).await?;
        let (header, prefetched) = received.split_at(HEADER_BYTES as usize);
        let header: Header = bytemuck::pod_read_unaligned(header);
        if self.timestamps.is_some() {
            let times = header.times(&chunk.passes, self.device.queue.get_timestamp_period());
            times.for_each(|(kernel, time)| self.sink.add_time(kernel, time));
        }
        let Header { totals, counters, .. } = header;
        let needed = output_words(&self.params, &totals);
        if let Some(refused) = self.refused(&counters) {
            // The counts of a refused map are of no account.
            self.sink.found.report.repeats += 1;
            return Ok(refused);
        }
        self.sink.check(found_pairs(&self.params, &totals))?;
        // Without a grid the counters are those of an earlier call.
        if self.params.levels > 0 && !rest(&counters, &chunk.items).is_empty() {
            return Ok(ChunkResult::Partial);
        }
        let report = &mut self.sink.found.report;
        if needed > self.storage.size(Buffer::Out) / 4 {
            report.repeats += 1;
            return Ok(ChunkResult::OutputTooLarge(needed));
        }
        report.chunks += chunk.submissions.saturating_sub(1).max(1);
        self.sink.count(&self.params, &totals, needed);
        self.sizes.max_words = self.sizes.max_words.max(needed);
        self.sizes.expected_words = self.sizes.max_words;
        let is_sorted = self.sort(chunk.items, totals.sorted != 0, needed)?;
        if 4 * needed <= chunk.prefetched && (is_sorted || !self.has(SORTED)) {
            let words: &[u32] = bytemuck::cast_slice(prefetched);
            self.prepare_table(needed).await?;
            self.decode_words(&words[..needed as usize], is_sorted)?;
        } else {
            drop(received);
            self.take_output(needed, is_sorted).await?;
        }
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

    /// Reads exactly the words of output, and decodes them. Plain pairs are read once, where they lie in mapped memory.
    async fn take_output(&mut self, needed: u64, is_sorted: bool) -> Result<(), Failure> {
        self.prepare_table(needed).await?;
        if !self.has(PACKED) && !self.has(BITS) {
            let decode = |session: &mut Self, words: &[u32]| session.decode_words(words, is_sorted);
            return self.read(Buffer::Out, needed, decode).await;
        }
        // A record may begin in one piece and end in the next one.
        let words = self.collect(Buffer::Out, needed).await?;
        self.decode_words(&words, is_sorted)
    }

    /// Reads the entries that records name, once a job.
    async fn prepare_table(&mut self, needed: u64) -> Result<(), Failure> {
        if self.has(PACKED) && self.table.is_none() && needed > 0 {
            let entries = u64::from(self.sizes.lists.entries);
            self.table = Some(self.collect(Buffer::Entries, entries).await?);
        }
        Ok(())
    }

    fn decode_words(&mut self, words: &[u32], is_sorted: bool) -> Result<(), Failure> {
        let mut clock = Clock::start();
        self.decode(words, is_sorted)?;
        self.sink.found.report.decode += clock.lap();
        self.sink.check(0)
    }

    fn decode(&mut self, words: &[u32], is_sorted: bool) -> Result<(), DecodeError> {
        let (is_packed, is_bits) = (self.has(PACKED), self.has(BITS));
        let ids = self.part_ids.as_deref().map_or(BoxIds::First(self.params.boxes), BoxIds::Part);
        let pairs = &mut self.sink.found.pairs;
        if is_bits {
            decode::bits(words, ids, pairs)
        } else if is_packed {
            decode::records(words, self.table.as_deref().unwrap_or(&[]), ids, pairs)
        } else {
            decode::plain(words, ids, is_sorted, pairs)
        }
    }

    /// Copies words of a buffer.
    async fn collect(&mut self, source: Buffer, words: u64) -> Result<Vec<u32>, Failure> {
        let mut all = Vec::with_capacity(words as usize);
        let add = |_: &mut Self, words: &[u32]| {
            all.extend_from_slice(words);
            Ok(())
        };
        self.read(source, words, add).await?;
        Ok(all)
    }

    /// Reads the first words of a buffer, in submissions of their own. With pipelining a piece comes while the one before is taken.
    async fn read(
        &mut self,
        source: Buffer,
        words: u64,
        mut take: impl FnMut(&mut Self, &[u32]) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let most = if self.options.pipelining { PIECE_BYTES } else { u64::MAX };
        let piece = self.storage.max_buffer_bytes.min(most);
        let mut next = self.fetch(source, 0..(4 * words).min(piece), 0)?;
        let mut from = piece;
        while let Some(fetch) = next {
            next = self.fetch(source, from..(4 * words).min(from + piece), (from / piece) as usize % 2)?;
            from += piece;
            let received =
                self.receive(fetch.staging, fetch.bytes, fetch.submission, self.options.patience).await?;
            take(self, bytemuck::cast_slice(&received))?;
        }
        Ok(())
    }

    /// Begins to read some bytes of a buffer, if there are any.
    fn fetch(&mut self, source: Buffer, range: Range<u64>, which: usize) -> Result<Option<Fetch>, GpuError> {
        if range.is_empty() {
            return Ok(None);
        }
        let (staging, bytes) = (BufferId::FetchStaging(which), range.end - range.start);
        self.storage.ensure(staging, bytes)?;
        let mut encoder = self.device.encoder();
        let (from, to) = (self.storage.get(source), self.storage.get(staging));
        encoder.copy_buffer_to_buffer(from, range.start, to, 0, bytes);
        self.sink.found.report.downloaded += bytes;
        let submission = self.device.submit(encoder);
        Ok(Some(Fetch { staging, bytes, submission }))
    }

    /// Sorts the pairs of the last chunk, unless they are sorted. Returns true if they are in order when they are read.
    fn sort(&mut self, items: Chunk, is_sorted: bool, words: u64) -> Result<bool, GpuError> {
        let pairs = u32::try_from(words / 2).unwrap_or(u32::MAX);
        if !self.has(SORTED) || is_sorted {
            return Ok(self.has(SORTED));
        }
        let capacity = pair_capacity(&self.storage);
        if pairs > capacity {
            return Ok(false);
        }
        if pairs > self.params.pair_capacity {
            // A sort that is submitted with the check leaves so many.
            self.params.pair_capacity = capacity;
            self.submit_unread(items, &group(&self.params))?;
        }
        self.submit_ranks(items, pairs)?;
        Ok(true)
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
