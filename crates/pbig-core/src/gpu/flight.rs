//! A chunk of work on its way: launched on the device, landed with its pairs.

use super::GpuError;
use super::commands::{Commands, sided};
use super::engine::Variant;
use super::error::Failure;
use super::map::Room;
use super::readback::{self, HEAD, Head};
use super::session::Session;
use super::sink::Sink;
use crate::layout::{self, BITS, Chunk, Counters, PACKED, Params, Totals, wide};
use crate::report::lap;
use crate::{Error, Pair, decode};
use std::time::Instant;

/// A chunk that the device is working on.
#[derive(Debug)]
pub(super) struct Flight {
    pub(super) chunk: Chunk,
    side: usize,
    submission: wgpu::SubmissionIndex,
    prefetched: u64,
    passes: Vec<&'static str>,
}

/// What a chunk came to.
pub(super) enum Landed {
    Done,
    /// The map's lists had no room, so nothing was checked.
    NoMap,
    /// The output would have needed so many words.
    Overflow(u64),
}

impl Session {
    /// Submits what `record` records, on one of the two sets of buffers. The device stops counting beyond `left` pairs.
    pub(super) fn launch(
        &mut self,
        params: &Params,
        mut chunk: Chunk,
        side: usize,
        words: u64,
        left: u64,
        record: &mut dyn FnMut(&mut Commands<'_>) -> Result<(), GpuError>,
    ) -> Result<Flight, GpuError> {
        let (engine, storage) = (self.engine.clone(), &mut self.storage);
        // Taken in once, however often a map or a chunk is repeated.
        let news = self.news.take();
        let most = storage.most_bytes();
        let first = self.options.first_bytes.min(most);
        storage.ensure(&engine, sided("out", side), (4 * words).clamp(first, most))?;
        storage.ensure(&engine, sided("totals", side), size_of::<Totals>() as u64)?;
        storage.ensure(&engine, sided("chunk", side), size_of::<Chunk>() as u64)?;
        storage.ensure(&engine, "params", size_of::<Params>() as u64)?;
        storage.ensure(&engine, "counters", size_of::<Counters>() as u64)?;
        let room = storage.size(sided("out", side)) / 4;
        let prefetched = if params.flags & BITS != 0 { words } else { self.words + self.words / 4 + 64 };
        let prefetched = (4 * prefetched).min(4 * room).min(most - HEAD);
        storage.ensure(&engine, sided("staging", side), HEAD + prefetched)?;
        chunk.word_room = room.min(u64::from(u32::MAX) - 1) as u32;
        chunk.pairs_left = layout::halves(left);
        engine.queue.write_buffer(storage.get("params"), 0, bytemuck::bytes_of(params));
        engine.queue.write_buffer(storage.get(sided("chunk", side)), 0, bytemuck::bytes_of(&chunk));
        let clock = self.clocks[side].as_ref();
        let variant = Variant::new(&self.options, self.changes);
        let queries = clock.map(|clock| &clock.queries);
        let mut commands = Commands::new(&engine, &self.storage, &mut self.binds, variant, queries, side);
        let totals = commands.buffer("totals");
        commands.encoder.clear_buffer(totals, 0, None);
        if let Some(news) = news {
            news.record(&mut commands)?;
        }
        record(&mut commands)?;
        readback::record(&mut commands, clock, prefetched);
        let (encoder, passes) = (commands.encoder, commands.passes);
        let submission = engine.submit(encoder);
        Ok(Flight { chunk, side, submission, prefetched, passes })
    }

    /// Waits for a chunk and decodes its output. `fixed` is the length of the output where the device
    /// does not count it.
    pub(super) fn land(
        &mut self,
        flight: Flight,
        params: &Params,
        fixed: Option<u64>,
        sink: &mut Sink<'_>,
    ) -> Result<(Counters, Landed), Failure> {
        let (head, early) = self.receive(&flight, fixed, sink)?;
        let (totals, room) = (head.totals, self.storage.size(sided("out", flight.side)) / 4);
        if wide(totals.pairs) > sink.left() {
            return Err(Failure::Call(Error::TooManyPairs { limit: sink.limit }));
        }
        let words = fixed.unwrap_or(wide(totals.words));
        if params.cells > 0 && !Room::held(params, head.counters) {
            return Ok((head.counters, Landed::NoMap));
        }
        if words > room {
            return Ok((head.counters, Landed::Overflow(words)));
        }
        let mut clock = Instant::now();
        let rest = self.fetch(sided("out", flight.side), early.len() as u64, words, sink)?;
        sink.report.wait += lap(&mut clock);
        let words = if rest.is_empty() { early } else { [early, rest].concat() };
        self.most_words = self.most_words.max(words.len() as u64);
        self.words = self.most_words;
        sink.count(&totals);
        let pairs = self.decode(&words, params, head.counters.entries, sink)?;
        self.coding.pairs = wide(totals.pairs);
        sink.report.compression += words.len() as f64;
        sink.add(pairs).map_err(Failure::Call)?;
        sink.report.decode += lap(&mut clock);
        Ok((head.counters, Landed::Done))
    }

    /// Waits for a chunk: what it counted, and as much of its output as was fetched with it.
    fn receive(
        &mut self,
        flight: &Flight,
        fixed: Option<u64>,
        sink: &mut Sink<'_>,
    ) -> Result<(Head, Vec<u32>), GpuError> {
        let engine = self.engine.clone();
        let staging = self.storage.get(sided("staging", flight.side)).clone();
        let (bytes, submission) = (HEAD + flight.prefetched, flight.submission.clone());
        sink.report.downloaded += bytes;
        let mut clock = Instant::now();
        let patience = self.options.patience;
        // Copied, so that the buffer is free for the next chunk before this one is decoded.
        let (head, early) = readback::read(&engine, &staging, bytes, submission, patience, |bytes| {
            let head: Head = bytemuck::pod_read_unaligned(&bytes[..HEAD as usize]);
            let have = &bytes[HEAD as usize..];
            let used = fixed.unwrap_or(wide(head.totals.words)).saturating_mul(4);
            let used = used.min(have.len() as u64) as usize;
            (head, bytemuck::pod_collect_to_vec::<u8, u32>(&have[..used]))
        })?;
        sink.report.wait += lap(&mut clock);
        if engine.timestamps {
            sink.add_times(&head.times(&flight.passes, engine.queue.get_timestamp_period()));
        }
        Ok((head, early))
    }

    fn decode(
        &mut self,
        words: &[u32],
        params: &Params,
        entries: u32,
        sink: &mut Sink<'_>,
    ) -> Result<Vec<Vec<Pair>>, GpuError> {
        if params.flags & BITS != 0 {
            return Ok(decode::bits(words, params.boxes)?);
        }
        if params.flags & PACKED == 0 {
            return Ok(decode::plain(words, params.boxes)?);
        }
        if self.table.is_none() && !words.is_empty() {
            self.table = Some(self.fetch("entries", 0, u64::from(entries), sink)?);
        }
        Ok(decode::records(words, self.table.as_deref().unwrap_or(&[]), params.boxes)?)
    }

    /// Reads words `from..to` of a buffer, in a submission of its own.
    fn fetch(
        &mut self,
        name: &'static str,
        from: u64,
        to: u64,
        sink: &mut Sink<'_>,
    ) -> Result<Vec<u32>, GpuError> {
        if from >= to {
            return Ok(Vec::new());
        }
        let engine = self.engine.clone();
        let bytes = 4 * (to - from);
        self.storage.ensure(&engine, "table", bytes)?;
        sink.report.downloaded += bytes;
        let (source, table) = (self.storage.get(name), self.storage.get("table"));
        let descriptor = wgpu::CommandEncoderDescriptor { label: Some("pbig fetch") };
        let mut encoder = engine.device.create_command_encoder(&descriptor);
        encoder.copy_buffer_to_buffer(source, 4 * from, table, 0, bytes);
        let submission = engine.submit(encoder);
        readback::read(&engine, table, bytes, submission, self.options.patience, bytemuck::pod_collect_to_vec)
    }
}
