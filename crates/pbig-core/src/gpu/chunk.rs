//! A chunk of work items: submitted to the device, awaited, and decoded.

use super::GpuError;
use super::coding::bit_words;
use super::device::Variant;
use super::error::Failure;
use super::passes::{Recording, Step, apply_changes, lists_fit};
use super::readback::{self, HEADER_BYTES, Header};
use super::session::Session;
use super::sink::Sink;
use super::storage::{BufferId, Side};
use crate::layout::{BITS, Chunk, Counters, PACKED, Params, Totals, halves, wide};
use crate::report::Clock;
use crate::{Pair, decode};
use pbig_shaders::Buffer;

/// A chunk that the device is working on.
#[derive(Debug)]
pub(super) struct PendingChunk {
    pub(super) items: Chunk,
    side: Side,
    submission: wgpu::SubmissionIndex,
    /// Bytes of output that come with the header.
    prefetched: u64,
    passes: Vec<&'static str>,
}

pub(super) enum ChunkResult {
    /// All of its pairs are found.
    Done,
    /// A list of the map did not fit, so nothing was checked.
    MapTooLarge,
    /// The output needs this many words.
    OutputTooLarge(u64),
}

impl Session {
    /// Submits a chunk: changes that wait, and `steps`. The device stops counting beyond `left` pairs.
    pub(super) fn submit(
        &mut self,
        params: &Params,
        mut items: Chunk,
        side: Side,
        steps: &[Step],
        left: u64,
    ) -> Result<PendingChunk, GpuError> {
        let prefetched = self.make_room(params, side)?;
        let capacity = self.storage.size(BufferId::of(Buffer::Out, side)) / 4;
        items.word_capacity = capacity.min(u64::from(u32::MAX) - 1) as u32;
        items.pairs_left = halves(left);
        self.storage.upload(Buffer::Params, &[*params])?;
        self.storage.upload(BufferId::of(Buffer::Chunk, side), &[items])?;
        let timestamps = self.timestamps[side].as_ref();
        let descriptor = wgpu::CommandEncoderDescriptor { label: Some("pbig") };
        let mut recording = Recording {
            encoder: self.device.handle.create_command_encoder(&descriptor),
            storage: &mut self.storage,
            side,
            variant: Variant::new(&self.options, self.finds_changes),
            queries: timestamps.map(|timestamps| &timestamps.queries),
            passes: Vec::new(),
        };
        // Applied once, however often a map or a chunk is repeated.
        if std::mem::take(&mut self.has_pending_changes) {
            recording.record(&apply_changes(params))?;
        }
        recording.record(&[Step::Clear(Buffer::Totals, size_of::<Totals>() as u64)])?;
        recording.record(steps)?;
        readback::record(&mut recording, timestamps, prefetched);
        let Recording { encoder, passes, .. } = recording;
        let submission = self.device.submit(encoder);
        Ok(PendingChunk { items, side, submission, prefetched, passes })
    }

    /// Makes the buffers for the output of a chunk. Returns the bytes to prefetch.
    fn make_room(&mut self, params: &Params, side: Side) -> Result<u64, GpuError> {
        let (storage, sizes) = (&mut self.storage, &self.sizes);
        let (out, most) = (BufferId::of(Buffer::Out, side), storage.max_buffer_bytes);
        let (words, prefetched) = if params.flags & BITS == 0 {
            (sizes.word_capacity, sizes.expected_words + sizes.expected_words / 4 + 64)
        } else {
            // The last workgroup writes all of its eight words.
            let words = bit_words(params).next_multiple_of(8);
            (words, words)
        };
        storage.ensure(out, (4 * words).clamp(self.options.first_bytes.min(most), most))?;
        storage.ensure(BufferId::of(Buffer::Totals, side), size_of::<Totals>() as u64)?;
        storage.ensure(Buffer::Counters, size_of::<Counters>() as u64)?;
        let prefetched = (4 * prefetched).min(storage.size(out)).min(most - HEADER_BYTES);
        storage.ensure(BufferId::Staging(side), HEADER_BYTES + prefetched)?;
        Ok(prefetched)
    }

    /// Waits for a chunk and decodes its output, if everything fitted.
    pub(super) fn finish(
        &mut self,
        chunk: PendingChunk,
        params: &Params,
        sink: &mut Sink,
    ) -> Result<ChunkResult, Failure> {
        let (Header { totals, counters, .. }, mut words) = self.receive(&chunk, params, sink)?;
        sink.check(wide(totals.pairs))?;
        let (out, needed) = (BufferId::of(Buffer::Out, chunk.side), output_words(params, &totals));
        if params.levels > 0 {
            self.sizes.lists = counters;
            if !lists_fit(params, &counters) {
                sink.found.report.repeats += 1;
                return Ok(ChunkResult::MapTooLarge);
            }
        }
        if needed > self.storage.size(out) / 4 {
            sink.found.report.repeats += 1;
            return Ok(ChunkResult::OutputTooLarge(needed));
        }
        sink.found.report.chunks += 1;
        let mut clock = Clock::start();
        words.extend(self.fetch(out, words.len() as u64, needed, sink)?);
        sink.found.report.wait += clock.lap();
        self.sizes.max_words = self.sizes.max_words.max(needed);
        self.sizes.expected_words = self.sizes.max_words;
        self.coding.pairs = wide(totals.pairs);
        sink.count(&totals, needed);
        let pieces = self.decode(&words, params, sink)?;
        sink.add(pieces)?;
        sink.found.report.decode += clock.lap();
        Ok(ChunkResult::Done)
    }

    /// Waits for a chunk. Returns its counts and the prefetched part of its output.
    fn receive(
        &mut self,
        chunk: &PendingChunk,
        params: &Params,
        sink: &mut Sink,
    ) -> Result<(Header, Vec<u32>), GpuError> {
        let device = &self.device;
        let staging = self.storage.get(BufferId::Staging(chunk.side));
        let (bytes, submission) = (HEADER_BYTES + chunk.prefetched, chunk.submission.clone());
        let mut clock = Clock::start();
        // The copy frees the buffer for the next chunk before this one is decoded.
        let read = |bytes: &[u8]| {
            let (header, words) = bytes.split_at(HEADER_BYTES as usize);
            let header: Header = bytemuck::pod_read_unaligned(header);
            let used = output_words(params, &header.totals).saturating_mul(4).min(words.len() as u64);
            (header, bytemuck::pod_collect_to_vec::<u8, u32>(&words[..used as usize]))
        };
        let (header, words) =
            readback::read(device, staging, bytes, submission, self.options.patience, read)?;
        sink.found.report.downloaded += bytes;
        sink.found.report.wait += clock.lap();
        if device.has_timestamps {
            let times = header.times(&chunk.passes, device.queue.get_timestamp_period());
            times.for_each(|(name, time)| sink.add_time(name, time));
        }
        Ok((header, words))
    }

    fn decode(
        &mut self,
        words: &[u32],
        params: &Params,
        sink: &mut Sink,
    ) -> Result<Vec<Vec<Pair>>, GpuError> {
        if params.flags & BITS != 0 {
            return Ok(decode::bits(words, params.boxes)?);
        }
        if params.flags & PACKED == 0 {
            return Ok(decode::plain(words, params.boxes)?);
        }
        if self.table.is_none() && !words.is_empty() {
            let entries = u64::from(self.sizes.lists.entries);
            self.table = Some(self.fetch(Buffer::Entries.into(), 0, entries, sink)?);
        }
        Ok(decode::records(words, self.table.as_deref().unwrap_or(&[]), params.boxes)?)
    }

    /// Reads the words `from..to` of a buffer, in a submission of its own.
    fn fetch(&mut self, source: BufferId, from: u64, to: u64, sink: &mut Sink) -> Result<Vec<u32>, GpuError> {
        if from >= to {
            return Ok(Vec::new());
        }
        let bytes = 4 * (to - from);
        self.storage.ensure(BufferId::FetchStaging, bytes)?;
        sink.found.report.downloaded += bytes;
        let staging = self.storage.get(BufferId::FetchStaging);
        let descriptor = wgpu::CommandEncoderDescriptor { label: Some("pbig fetch") };
        let mut encoder = self.device.handle.create_command_encoder(&descriptor);
        encoder.copy_buffer_to_buffer(self.storage.get(source), 4 * from, staging, 0, bytes);
        let submission = self.device.submit(encoder);
        let read = bytemuck::pod_collect_to_vec;
        readback::read(&self.device, staging, bytes, submission, self.options.patience, read)
    }
}

/// Returns the number of words of output. The device does not count bits.
fn output_words(params: &Params, totals: &Totals) -> u64 {
    if params.flags & BITS == 0 { wide(totals.words) } else { bit_words(params) }
}
