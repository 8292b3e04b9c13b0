//! A chunk of work items: submitted to the device, awaited, and decoded.

use super::GpuError;
use super::coding::bit_words;
use super::device::Variant;
use super::error::Failure;
use super::items::{covered, rest};
use super::passes::{CLASSES_BYTES, Recording, Step, apply_changes, check, lists_fit, measure, sort};
use super::readback::{self, HEADER_BYTES, Header};
use super::session::Session;
use super::sink::Sink;
use super::storage::{BufferId, Side};
use crate::decode;
use crate::layout::{BITS, Chunk, Counters, PACKED, Params, SORTED, Totals, halves, wide};
use crate::pbig::{CLASSES, SizeClass};
use pbig_core::{DeviceReport, internal::Clock};
use pbig_shaders::{Buffer, Kernel};
use std::borrow::Cow;

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
    /// Submits a chunk: uploads and changes that wait, and `steps`. The device stops counting beyond `left` pairs.
    pub(super) fn submit(
        &mut self,
        params: &Params,
        items: Chunk,
        side: Side,
        steps: &[Step],
        left: u64,
    ) -> Result<PendingChunk, GpuError> {
        let mut clock = Clock::start();
        let prefetched = self.make_room(params, side)?;
        self.write_chunk(items, side, left)?;
        let (submission, passes) = self.record(params, side, steps, Some(prefetched))?;
        self.recording += clock.lap();
        Ok(PendingChunk { items, side, submission, submissions: 1, prefetched, passes })
    }

    /// Checks the chunks after `done`, which add their pairs to those of the first, and sorts all.
    pub(super) fn submit_rest_and_sort(
        &mut self,
        params: &Params,
        done: &Chunk,
        others: &[Chunk],
        left: u64,
    ) -> Result<PendingChunk, GpuError> {
        for items in others {
            let steps = check(items.small_items, items.large_items);
            self.submit_unread(params, *items, &steps, left)?;
        }
        let last = self.submit(params, covered(done, others), 0, &sort(params), left)?;
        Ok(PendingChunk { submissions: others.len() as u32 + 2, ..last })
    }

    /// Submits a chunk whose output stays on the device.
    pub(super) fn submit_unread(
        &mut self,
        params: &Params,
        items: Chunk,
        steps: &[Step],
        left: u64,
    ) -> Result<(), GpuError> {
        let mut clock = Clock::start();
        self.write_chunk(items, 0, left)?;
        self.record(params, 0, steps, None)?;
        self.recording += clock.lap();
        Ok(())
    }

    /// Tells the kernels which work items to check, and how much output there may be.
    fn write_chunk(&mut self, items: Chunk, side: Side, left: u64) -> Result<(), GpuError> {
        let capacity = self.storage.size(BufferId::of(Buffer::Out, side)) / 4;
        let word_capacity = capacity.min(u64::from(u32::MAX) - 1) as u32;
        let items = Chunk { word_capacity, pairs_left: halves(left), ..items };
        self.storage.write(BufferId::of(Buffer::Chunk, side), &[items])
    }

    /// Records and submits uploads and changes that wait, `steps`, and a readback of some bytes of output, if they are told.
    /// Returns the kernels.
    fn record(
        &mut self,
        params: &Params,
        side: Side,
        steps: &[Step],
        prefetched: Option<u64>,
    ) -> Result<(wgpu::SubmissionIndex, Vec<&'static Kernel>), GpuError> {
        self.storage.write(Buffer::Params, &[*params])?;
        let is_timed = prefetched.is_some() && self.options.time_kernels;
        let timestamps = self.timestamps[side].as_ref().filter(|_| is_timed);
        let descriptor = wgpu::CommandEncoderDescriptor { label: Some("pbig") };
        let mut encoder = self.device.handle.create_command_encoder(&descriptor);
        let has_copies = self.storage.record_copies(&mut encoder);
        let mut recording = Recording {
            encoder,
            storage: &mut self.storage,
            side,
            variant: Variant::new(&self.options, self.finds_changes),
            queries: timestamps.map(|timestamps| &timestamps.queries),
            passes: Vec::new(),
        };
        // Applied once, however often a map or a chunk is repeated.
        let has_changes = std::mem::take(&mut self.has_pending_changes);
        let changes = has_changes.then(|| apply_changes(params));
        let steps: Vec<Step> = changes.into_iter().flatten().chain(steps.iter().copied()).collect();
        recording.record(&steps);
        if let Some(prefetched) = prefetched {
            readback::record(&mut recording, timestamps, prefetched);
        }
        let Recording { encoder, passes, .. } = recording;
        let submission = self.device.submit(encoder);
        if has_copies {
            self.storage.take_staging_back();
        }
        Ok((submission, passes))
    }

    /// Counts the boxes on the device by size.
    pub(super) async fn measure(
        &mut self,
        params: &Params,
        report: &mut DeviceReport,
    ) -> Result<Box<[SizeClass; CLASSES]>, GpuError> {
        self.storage.ensure(Buffer::Classes, CLASSES_BYTES)?;
        let mut clock = Clock::start();
        self.record(params, 0, &measure(params), None)?;
        self.recording += clock.lap();
        let words = self.fetch(Buffer::Classes.into(), 0, CLASSES_BYTES / 4, report).await?;
        report.wait += clock.lap();
        let mut classes = Box::new([SizeClass::default(); CLASSES]);
        for (class, four) in classes.iter_mut().zip(words.as_chunks::<4>().0) {
            let [boxes, x, y, z] = *four;
            *class = SizeClass { boxes, max_extent: [x, y, z].map(f32::from_bits) };
        }
        Ok(classes)
    }

    /// Makes the buffers for the output of a chunk. Returns the bytes to prefetch.
    pub(super) fn make_room(&mut self, params: &Params, side: Side) -> Result<u64, GpuError> {
        let first_bytes = self.first_bytes(params.boxes);
        let (storage, sizes) = (&mut self.storage, &self.sizes);
        let (out, most) = (BufferId::of(Buffer::Out, side), storage.max_buffer_bytes);
        let (words, prefetched) = if params.flags & BITS == 0 {
            (sizes.word_capacity, sizes.expected_words + sizes.expected_words / 4 + 64)
        } else {
            // The last workgroup writes all of its eight words.
            let words = bit_words(params).next_multiple_of(8);
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
    pub(super) async fn finish(
        &mut self,
        chunk: PendingChunk,
        params: &Params,
        sink: &mut Sink,
    ) -> Result<ChunkResult, Failure> {
        let patience = self.options.patience.saturating_mul(chunk.submissions);
        let submission = chunk.submission.clone();
        let staging = self.storage.get(BufferId::Staging(chunk.side));
        let bytes = HEADER_BYTES + chunk.prefetched;
        let mut clock = Clock::start();
        let received = readback::read(&self.device, staging, bytes, submission, patience).await?;
        sink.found.report.wait += clock.lap();
        sink.found.report.downloaded += bytes;
        sink.found.report.waits += 1;
        let (header, prefetched) = received.split_at(HEADER_BYTES as usize);
        let header: Header = bytemuck::pod_read_unaligned(header);
        self.note_times(&chunk, &header, sink);
        let Header { totals, counters, .. } = header;
        let (out, needed) = (BufferId::of(Buffer::Out, chunk.side), output_words(params, &totals));
        let mut repeat = self.refused(params, &counters);
        if repeat.is_none() {
            // The counts of a refused map are of no account.
            sink.check(found_pairs(params, &totals))?;
            repeat = self.too_much_output(needed, out);
        }
        if let Some(repeat) = repeat {
            sink.found.report.repeats += 1;
            return Ok(repeat);
        }
        sink.found.report.chunks += chunk.submissions.saturating_sub(1).max(1);
        if params.flags & SORTED != 0 && totals.sorted == 0 && !rest(&counters, &chunk.items).is_empty() {
            return Ok(ChunkResult::Unsorted);
        }
        let words = self.words(bytemuck::cast_slice(prefetched), out, needed, sink).await?;
        self.fetch_entries(params, needed, sink).await?;
        sink.found.report.wait += clock.lap();
        self.take_output(&words, params, &totals, sink)?;
        Ok(ChunkResult::Done)
    }

    /// Decodes the output of a chunk, and notes how much it was.
    fn take_output(
        &mut self,
        words: &[u32],
        params: &Params,
        totals: &Totals,
        sink: &mut Sink,
    ) -> Result<(), Failure> {
        let needed = words.len() as u64;
        self.sizes.max_words = self.sizes.max_words.max(needed);
        self.sizes.expected_words = self.sizes.max_words;
        sink.count(params, totals, needed);
        let mut clock = Clock::start();
        self.decode(words, params, totals.sorted != 0, sink)?;
        sink.found.report.decode += clock.lap();
        sink.check(0)
    }

    /// Returns why the map has to be repeated, if it has.
    fn refused(&mut self, params: &Params, counters: &Counters) -> Option<ChunkResult> {
        if params.levels > 0 {
            self.sizes.lists = *counters;
            // First: lists that a plan for other boxes makes are not worth their memory.
            if counters.tests > params.most_tests || counters.too_many_tests != 0 {
                return Some(ChunkResult::TooManyTests);
            }
            if !lists_fit(params, counters) {
                return Some(ChunkResult::MapTooLarge);
            }
        }
        None
    }

    fn too_much_output(&self, needed: u64, out: BufferId) -> Option<ChunkResult> {
        (needed > self.storage.size(out) / 4).then_some(ChunkResult::OutputTooLarge(needed))
    }

    /// Returns the words of output: those that came with the header, and the rest if there are more.
    async fn words<'a>(
        &mut self,
        prefetched: &'a [u32],
        out: BufferId,
        needed: u64,
        sink: &mut Sink,
    ) -> Result<Cow<'a, [u32]>, GpuError> {
        let have = prefetched.len() as u64;
        if needed <= have {
            return Ok(Cow::Borrowed(&prefetched[..needed as usize]));
        }
        let mut words = prefetched.to_vec();
        words.extend(self.fetch(out, have, needed, &mut sink.found.report).await?);
        Ok(Cow::Owned(words))
    }

    /// Reads the entries, which records name, once a job.
    async fn fetch_entries(&mut self, params: &Params, words: u64, sink: &mut Sink) -> Result<(), GpuError> {
        if params.flags & PACKED != 0 && self.table.is_none() && words > 0 {
            let entries = u64::from(self.sizes.lists.entries);
            self.table = Some(self.fetch(Buffer::Entries.into(), 0, entries, &mut sink.found.report).await?);
        }
        Ok(())
    }

    fn note_times(&self, chunk: &PendingChunk, header: &Header, sink: &mut Sink) {
        if self.device.has_timestamps && self.options.time_kernels {
            let times = header.times(&chunk.passes, self.device.queue.get_timestamp_period());
            times.for_each(|(kernel, time)| sink.add_time(kernel, time));
        }
    }

    fn decode(
        &mut self,
        words: &[u32],
        params: &Params,
        is_sorted: bool,
        sink: &mut Sink,
    ) -> Result<(), GpuError> {
        let (pairs, boxes) = (&mut sink.found.pairs, params.boxes);
        if params.flags & BITS != 0 {
            decode::bits(words, boxes, pairs)?;
        } else if params.flags & PACKED != 0 {
            decode::records(words, self.table.as_deref().unwrap_or(&[]), boxes, pairs)?;
        } else if self.finds_changes {
            decode::events(words, boxes, is_sorted, pairs, &mut sink.found.ended)?;
        } else {
            decode::plain(words, boxes, is_sorted, pairs)?;
        }
        Ok(())
    }

    /// Reads the words `from..to` of a buffer, in a submission of its own.
    async fn fetch(
        &mut self,
        source: BufferId,
        from: u64,
        to: u64,
        report: &mut DeviceReport,
    ) -> Result<Vec<u32>, GpuError> {
        if from >= to {
            return Ok(Vec::new());
        }
        let bytes = 4 * (to - from);
        self.storage.ensure(BufferId::FetchStaging, bytes)?;
        report.downloaded += bytes;
        report.waits += 1;
        let staging = self.storage.get(BufferId::FetchStaging);
        let descriptor = wgpu::CommandEncoderDescriptor { label: Some("pbig fetch") };
        let mut encoder = self.device.handle.create_command_encoder(&descriptor);
        encoder.copy_buffer_to_buffer(self.storage.get(source), 4 * from, staging, 0, bytes);
        let submission = self.device.submit(encoder);
        let read = readback::read(&self.device, staging, bytes, submission, self.options.patience).await?;
        Ok(bytemuck::pod_collect_to_vec(&read))
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
