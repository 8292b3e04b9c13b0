//! A chunk of work items: submitted to the device, awaited, and decoded.

use super::GpuError;
use super::commands::Commands;
use super::device::Variant;
use super::error::Failure;
use super::map::Capacities;
use super::readback::{self, HEADER_BYTES, Header};
use super::session::Session;
use super::sink::Sink;
use super::storage::{BufferId, Side};
use crate::layout::{self, BITS, Chunk, Counters, PACKED, Params, Totals, wide};
use crate::report::Clock;
use crate::{Error, Pair, decode};
use pbig_shaders::Buffer;

/// A chunk that the device is working on.
#[derive(Debug)]
pub(super) struct PendingChunk {
    pub(super) items: Chunk,
    side: Side,
    submission: wgpu::SubmissionIndex,
    prefetched: u64,
    passes: Vec<&'static str>,
}

/// The outcome of a chunk.
pub(super) enum ChunkResult {
    /// All of its pairs are found.
    Done,
    /// A list of the map did not fit, so nothing was checked.
    MapTooLarge,
    /// The output needs this many words.
    OutputTooLarge(u64),
}

impl Session {
    /// Submits a chunk: changes that wait, and what `record` records. The device stops counting beyond `left` pairs.
    pub(super) fn submit_chunk(
        &mut self,
        params: &Params,
        mut items: Chunk,
        side: Side,
        words: u64,
        left: u64,
        record: &mut dyn FnMut(&mut Commands<'_>) -> Result<(), GpuError>,
    ) -> Result<PendingChunk, GpuError> {
        let (device, storage) = (self.device.clone(), &mut self.storage);
        // Applied once, however often a map or a chunk is repeated.
        let pending_changes = self.pending_changes.take();
        let most = storage.max_buffer_bytes();
        let sided = |buffer| BufferId::Sided(buffer, side);
        let first = self.options.first_bytes.min(most);
        storage.ensure(&device, sided(Buffer::Out), (4 * words).clamp(first, most))?;
        storage.ensure(&device, sided(Buffer::Totals), size_of::<Totals>() as u64)?;
        storage.ensure(&device, sided(Buffer::Chunk), size_of::<Chunk>() as u64)?;
        storage.ensure_bound(&device, Buffer::Params, size_of::<Params>() as u64)?;
        storage.ensure_bound(&device, Buffer::Counters, size_of::<Counters>() as u64)?;
        let capacity = storage.size(sided(Buffer::Out)) / 4;
        let prefetched =
            if params.flags & BITS != 0 { words } else { self.expected_words + self.expected_words / 4 + 64 };
        let prefetched = (4 * prefetched).min(4 * capacity).min(most - HEADER_BYTES);
        storage.ensure(&device, BufferId::Staging(side), HEADER_BYTES + prefetched)?;
        items.word_capacity = capacity.min(u64::from(u32::MAX) - 1) as u32;
        items.pairs_left = layout::halves(left);
        device.queue.write_buffer(storage.bound(Buffer::Params), 0, bytemuck::bytes_of(params));
        device.queue.write_buffer(storage.get(sided(Buffer::Chunk)), 0, bytemuck::bytes_of(&items));
        let timestamps = self.timestamps[side as usize].as_ref();
        let variant = Variant::new(&self.options, self.finds_changes);
        let queries = timestamps.map(|timestamps| &timestamps.queries);
        let mut commands =
            Commands::new(&device, &self.storage, &mut self.bind_groups, variant, queries, side);
        let totals = commands.buffer(Buffer::Totals);
        commands.encoder.clear_buffer(totals, 0, None);
        if let Some(changes) = pending_changes {
            changes.record(&mut commands)?;
        }
        record(&mut commands)?;
        readback::record(&mut commands, timestamps, prefetched);
        let (encoder, passes) = (commands.encoder, commands.passes);
        let submission = device.submit(encoder);
        Ok(PendingChunk { items, side, submission, prefetched, passes })
    }

    /// Waits for a chunk and decodes its output. `fixed` is the number of words of the output if the device does not
    /// count them.
    pub(super) fn finish_chunk(
        &mut self,
        chunk: PendingChunk,
        params: &Params,
        fixed: Option<u64>,
        sink: &mut Sink,
    ) -> Result<(Counters, ChunkResult), Failure> {
        let (header, early) = self.receive(&chunk, fixed, sink)?;
        let out = BufferId::Sided(Buffer::Out, chunk.side);
        let (totals, capacity) = (header.totals, self.storage.size(out) / 4);
        if wide(totals.pairs) > sink.left() {
            return Err(Failure::Call(Error::TooManyPairs { limit: sink.limit }));
        }
        let words = fixed.unwrap_or(wide(totals.words));
        if params.cells > 0 && !Capacities::sufficed(params, header.counters) {
            return Ok((header.counters, ChunkResult::MapTooLarge));
        }
        if words > capacity {
            return Ok((header.counters, ChunkResult::OutputTooLarge(words)));
        }
        let mut clock = Clock::start();
        let rest = self.fetch(out, early.len() as u64, words, sink)?;
        sink.report.wait += clock.lap();
        let words = if rest.is_empty() { early } else { [early, rest].concat() };
        self.max_words = self.max_words.max(words.len() as u64);
        self.expected_words = self.max_words;
        sink.count(&totals);
        let pairs = self.decode(&words, params, header.counters.entries, sink)?;
        self.coding.pairs = wide(totals.pairs);
        sink.words += words.len() as u64;
        sink.add(pairs).map_err(Failure::Call)?;
        sink.report.decode += clock.lap();
        Ok((header.counters, ChunkResult::Done))
    }

    /// Waits for a chunk. Returns its counts and the prefetched part of its output.
    fn receive(
        &mut self,
        chunk: &PendingChunk,
        fixed: Option<u64>,
        sink: &mut Sink,
    ) -> Result<(Header, Vec<u32>), GpuError> {
        let device = self.device.clone();
        let staging = self.storage.get(BufferId::Staging(chunk.side)).clone();
        let (bytes, submission) = (HEADER_BYTES + chunk.prefetched, chunk.submission.clone());
        sink.report.downloaded += bytes;
        let mut clock = Clock::start();
        let patience = self.options.patience;
        // The copy frees the buffer for the next chunk before this one is decoded.
        let (header, early) = readback::read(&device, &staging, bytes, submission, patience, |bytes| {
            let header: Header = bytemuck::pod_read_unaligned(&bytes[..HEADER_BYTES as usize]);
            let have = &bytes[HEADER_BYTES as usize..];
            let used = fixed.unwrap_or(wide(header.totals.words)).saturating_mul(4);
            let used = used.min(have.len() as u64) as usize;
            (header, bytemuck::pod_collect_to_vec::<u8, u32>(&have[..used]))
        })?;
        sink.report.wait += clock.lap();
        if device.has_timestamps {
            sink.add_times(&header.times(&chunk.passes, device.queue.get_timestamp_period()));
        }
        Ok((header, early))
    }

    /// Decodes words of output.
    fn decode(
        &mut self,
        words: &[u32],
        params: &Params,
        entries: u32,
        sink: &mut Sink,
    ) -> Result<Vec<Vec<Pair>>, GpuError> {
        if params.flags & BITS != 0 {
            return Ok(decode::bits(words, params.boxes)?);
        }
        if params.flags & PACKED == 0 {
            return Ok(decode::plain(words, params.boxes)?);
        }
        if self.table.is_none() && !words.is_empty() {
            self.table = Some(self.fetch(BufferId::Bound(Buffer::Entries), 0, u64::from(entries), sink)?);
        }
        Ok(decode::records(words, self.table.as_deref().unwrap_or(&[]), params.boxes)?)
    }

    /// Reads the words `from..to` of a buffer, in a submission of its own.
    fn fetch(&mut self, source: BufferId, from: u64, to: u64, sink: &mut Sink) -> Result<Vec<u32>, GpuError> {
        if from >= to {
            return Ok(Vec::new());
        }
        let device = self.device.clone();
        let bytes = 4 * (to - from);
        self.storage.ensure(&device, BufferId::FetchStaging, bytes)?;
        sink.report.downloaded += bytes;
        let (source, staging) = (self.storage.get(source), self.storage.get(BufferId::FetchStaging));
        let descriptor = wgpu::CommandEncoderDescriptor { label: Some("pbig fetch") };
        let mut encoder = device.handle.create_command_encoder(&descriptor);
        encoder.copy_buffer_to_buffer(source, 4 * from, staging, 0, bytes);
        let submission = device.submit(encoder);
        readback::read(
            &device,
            staging,
            bytes,
            submission,
            self.options.patience,
            bytemuck::pod_collect_to_vec,
        )
    }
}
