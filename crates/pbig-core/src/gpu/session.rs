//! A search on a device: one submission and one wait, unless there is more work or output than fits.

use super::commands::{BindGroups, Commands, Groups, sided};
use super::engine::{Engine, Variant};
use super::error::Failure;
use super::readback::{self, Clock, HEAD, Head};
use super::storage::Storage;
use super::upload::Mirror;
use super::{GpuError, map};
use crate::config::{Coding, GpuOptions};
use crate::cpu::find::Found;
use crate::layout::{self, BITS, Chunk, Counters, FILTERED, LANES, PACKED, Params, Totals, wide};
use crate::pair_index::pair_count;
use crate::plan::GpuPlan;
use crate::report::{Checks, GpuReport, lap};
use crate::{Aabb, Config, Error, Pair, ProxyFilter, decode};
use pbig_shaders as shaders;
use rayon::prelude::*;
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Times that a map is repeated before the call is left to the CPU: each repetition has the room that
/// the last one asked for.
const MOST_REPEATS: u32 = 6;

/// Boxes of one cell that records can name: 2^16 segments.
const MOST_PACKED: usize = 1 << 24;

/// One search.
pub(super) struct Job<'a> {
    pub(super) boxes: &'a [Aabb],
    pub(super) filters: Option<&'a [ProxyFilter]>,
    /// Only pairs of one box below and one from here on, unless 0.
    pub(super) split: u32,
    /// None: every pair is tested.
    pub(super) plan: Option<&'a GpuPlan>,
    pub(super) config: &'a Config,
}

/// Where pairs go.
pub(super) struct Sink<'a> {
    pub(super) found: &'a mut Found,
    /// Buffers of `found` that are in use.
    pub(super) used: usize,
    pub(super) pairs: u64,
    pub(super) limit: u64,
    /// What the boxes of the job are called.
    pub(super) ids: Option<&'a [u32]>,
    /// Whether a pair is wanted, beyond what the device has tested.
    pub(super) accept: Option<&'a (dyn Fn(u32, u32) -> bool + Sync)>,
    pub(super) checks: Checks,
    pub(super) report: GpuReport,
}

impl Sink<'_> {
    fn add(&mut self, pieces: Vec<Vec<Pair>>) -> Result<(), Error> {
        let (ids, accept) = (self.ids, self.accept);
        let settle = |mut piece: Vec<Pair>| {
            if let Some(ids) = ids {
                piece.iter_mut().for_each(|p| *p = Pair::new(ids[p.a as usize], ids[p.b as usize]));
            }
            if let Some(accept) = accept {
                piece.retain(|p| accept(p.a, p.b));
            }
            piece
        };
        let pieces: Vec<Vec<Pair>> = pieces.into_par_iter().map(settle).collect();
        self.pairs += pieces.iter().map(|piece| piece.len() as u64).sum::<u64>();
        if self.pairs > self.limit {
            return Err(Error::TooManyPairs { limit: self.limit });
        }
        for piece in pieces {
            self.found.put(self.used, piece);
            self.used += 1;
        }
        Ok(())
    }

    fn count(&mut self, totals: &Totals) {
        let (made, redundant, overlaps) = (wide(totals.made), wide(totals.redundant), wide(totals.overlaps));
        self.checks.made += made;
        self.checks.redundant += redundant;
        self.checks.unnecessary += made.saturating_sub(redundant + overlaps);
        self.found.overlaps += overlaps;
        self.found.checks += made;
    }
}

/// A chunk that the device is working on.
struct Flight {
    chunk: Chunk,
    side: usize,
    submission: wgpu::SubmissionIndex,
    prefetched: u64,
    passes: Vec<&'static str>,
}

/// What a chunk came to.
enum Landed {
    Done,
    /// The output would have needed so many words.
    Overflow(u64),
}

/// The state of a finder on a device, kept from call to call.
#[derive(Debug)]
pub(super) struct Session {
    pub(super) engine: Arc<Engine>,
    pub(super) storage: Storage,
    mirror: Mirror,
    binds: BindGroups,
    clocks: [Option<Clock>; 2],
    room: map::Room,
    /// Words of output of the last chunk: how much is fetched before the length is known.
    words: u64,
    /// Most words of a chunk of this job; the room that the next one begins with.
    most_words: u64,
    /// Room for output, in words.
    word_room: u64,
    coding: CodingChoice,
    options: GpuOptions,
    /// The entries of this job's map, once fetched.
    table: Option<Vec<u32>>,
}

impl Session {
    pub(super) fn new(engine: Arc<Engine>, options: &GpuOptions) -> Result<Self, GpuError> {
        let clocks = [Clock::new(&engine)?, Clock::new(&engine)?];
        Ok(Self {
            storage: Storage::new(&engine, options),
            mirror: Mirror::new(),
            binds: BindGroups::default(),
            clocks,
            room: map::Room::default(),
            words: 0,
            most_words: 0,
            word_room: 0,
            coding: CodingChoice::default(),
            options: *options,
            table: None,
            engine,
        })
    }

    /// Finds the pairs of a job, completely.
    pub(super) fn run(&mut self, job: &Job<'_>, sink: &mut Sink<'_>) -> Result<(), Failure> {
        self.table = None;
        self.word_room = std::mem::take(&mut self.most_words);
        let mut clock = Instant::now();
        self.mirror.upload(&self.engine, &mut self.storage, job.boxes, job.filters)?;
        sink.report.uploaded += self.mirror.sent;
        sink.report.upload += lap(&mut clock);
        let result =
            if job.plan.is_some() { self.search_grid(job, sink) } else { self.search_all(job, sink) };
        sink.report.device_bytes = sink.report.device_bytes.max(self.storage.bytes());
        result
    }

    /// To be called after a call, which is one job or several.
    pub(super) fn end_call(&mut self) {
        if self.storage.end_call() && !self.storage.has("boxes") {
            self.mirror.forget();
        }
    }

    fn params(&self, job: &Job<'_>) -> Params {
        let mut params = job.plan.map_or(Params::default(), GpuPlan::params);
        params.boxes = job.boxes.len() as u32;
        params.small_cell = job.config.small_cell.clamp(1, LANES);
        // An item's output must fit the smallest buffer.
        params.columns = if self.storage.most_bytes() < 8 << 20 { 1 } else { 8 };
        params.flags = if job.filters.is_some() { FILTERED } else { 0 };
        params.split = job.split;
        params
    }

    /// Without a grid (Avril 3.2), one submission.
    fn search_all(&mut self, job: &Job<'_>, sink: &mut Sink<'_>) -> Result<(), Failure> {
        let mut params = self.params(job);
        let all = pair_count(job.boxes.len() as u64);
        let bit_words = all.div_ceil(32);
        let bits = match job.config.gpu.coding {
            Coding::Auto => bit_words <= 2 * self.coding.pairs,
            coding => coding == Coding::Packed,
        };
        params.flags |= if bits { BITS } else { 0 };
        for _ in 0..MOST_REPEATS {
            // The last workgroup writes all its words.
            let words = if bits { bit_words.next_multiple_of(8) } else { self.word_room };
            let chunk = Chunk { small_items: all.div_ceil(u64::from(LANES)) as u32, ..Chunk::default() };
            let flight = self.launch(&params, chunk, 0, words, sink, &mut |commands| {
                commands.run(&shaders::CHECK_ALL, Groups::Direct(chunk.small_items))
            })?;
            let fixed = bits.then_some(bit_words);
            match self.land(flight, &params, fixed, sink)?.1 {
                Landed::Done => {
                    sink.report.chunks += 1;
                    return Ok(());
                }
                Landed::Overflow(words) => self.word_room = words,
            }
            sink.report.repeats += 1;
        }
        Err(self.no_room().into())
    }

    /// With a grid: map, schedule and the first chunk in one submission; the other chunks after it.
    fn search_grid(&mut self, job: &Job<'_>, sink: &mut Sink<'_>) -> Result<(), Failure> {
        let mut params = self.params(job);
        let packed = self.coding.packed(job.config.gpu.coding) && job.boxes.len() < MOST_PACKED;
        params.flags |= if packed { PACKED } else { 0 };
        let [small_items, large_items] = self.options.chunk.map(|items| items.max(1));
        let first = Chunk { small_items, large_items, ..Chunk::default() };
        for _ in 0..MOST_REPEATS {
            self.room.make(&self.engine, &mut self.storage, &mut params, self.options.first_bytes)?;
            let flight = self.launch(&params, first, 0, self.word_room, sink, &mut |commands| {
                map::record(commands, &params)?;
                commands.run(&shaders::CHECK_SMALL, Groups::Indirect(0))?;
                commands.run(&shaders::CHECK_LARGE, Groups::Indirect(12))
            })?;
            let (counters, landed) = self.land(flight, &params, None, sink)?;
            if self.room.held(&params, counters) {
                let rest = self.note(landed, first, counters, sink);
                self.search_rest(&params, rest, sink)?;
                self.coding.learn(packed, sink.pairs, self.room.needed.entries, &sink.report);
                return Ok(());
            }
            sink.report.repeats += 1;
        }
        Err(self.no_room().into())
    }

    /// What is left to do after the first chunk: all of it again if its output had no room.
    fn note(&mut self, landed: Landed, first: Chunk, found: Counters, sink: &mut Sink<'_>) -> Chunk {
        let done = match landed {
            Landed::Done => first,
            Landed::Overflow(words) => {
                self.word_room = words;
                sink.report.repeats += 1;
                Chunk::default()
            }
        };
        sink.report.chunks += u32::from(matches!(landed, Landed::Done));
        let (first_small, first_large) =
            (found.small_items.min(done.small_items), found.large_items.min(done.large_items));
        Chunk {
            first_small,
            small_items: found.small_items - first_small,
            first_large,
            large_items: found.large_items - first_large,
            ..Chunk::default()
        }
    }

    /// The other chunks: two at a time, so that the device checks one while the host decodes the other
    /// (PBIG 5.3).
    fn search_rest(&mut self, params: &Params, rest: Chunk, sink: &mut Sink<'_>) -> Result<(), Failure> {
        let mut pending: VecDeque<Chunk> = cut(rest, self.options.chunk).into();
        let mut flights: VecDeque<Flight> = VecDeque::new();
        let most = if self.options.pipelining { 2 } else { 1 };
        let mut side = 0;
        loop {
            while flights.len() < most
                && let Some(chunk) = pending.pop_front()
            {
                side = 1 - side;
                flights.push_back(self.launch_chunk(params, chunk, side, sink)?);
            }
            let Some(flight) = flights.pop_front() else { return Ok(()) };
            let chunk = flight.chunk;
            match self.land(flight, params, None, sink)?.1 {
                Landed::Done => sink.report.chunks += 1,
                Landed::Overflow(words) => {
                    sink.report.repeats += 1;
                    for part in self.smaller(chunk, words)?.into_iter().rev() {
                        pending.push_front(part);
                    }
                }
            }
        }
    }

    /// A chunk again with the room it needs, or in halves if that is more than a buffer may have.
    fn smaller(&mut self, chunk: Chunk, words: u64) -> Result<Vec<Chunk>, GpuError> {
        if words <= self.storage.most_bytes() / 4 {
            self.word_room = self.word_room.max(words);
            return Ok(vec![chunk]);
        }
        self.word_room = self.storage.most_bytes() / 4;
        let halves = cut(chunk, [chunk.small_items.div_ceil(2).max(1), chunk.large_items.div_ceil(2).max(1)]);
        if halves.len() < 2 { Err(self.no_room()) } else { Ok(halves) }
    }

    fn no_room(&self) -> GpuError {
        let limit = self.storage.most_bytes();
        GpuError::TooLarge { what: "the output of one work item", bytes: 4 * self.word_room, limit }
    }

    fn launch_chunk(
        &mut self,
        params: &Params,
        chunk: Chunk,
        side: usize,
        sink: &Sink<'_>,
    ) -> Result<Flight, GpuError> {
        self.launch(params, chunk, side, self.word_room, sink, &mut |commands| {
            if chunk.small_items > 0 {
                commands.run(&shaders::CHECK_SMALL, Groups::Direct(chunk.small_items))?;
            }
            if chunk.large_items > 0 {
                commands.run(&shaders::CHECK_LARGE, Groups::Direct(chunk.large_items))?;
            }
            Ok(())
        })
    }

    /// Submits what `record` records, on one of the two sets of buffers.
    fn launch(
        &mut self,
        params: &Params,
        mut chunk: Chunk,
        side: usize,
        words: u64,
        sink: &Sink<'_>,
        record: &mut dyn FnMut(&mut Commands<'_>) -> Result<(), GpuError>,
    ) -> Result<Flight, GpuError> {
        let (engine, storage) = (self.engine.clone(), &mut self.storage);
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
        chunk.pairs_left = layout::halves(sink.limit.saturating_sub(sink.pairs));
        if sink.accept.is_some() {
            // What the device counts is not what the limit is about.
            chunk.pairs_left = [u32::MAX; 2];
        }
        engine.queue.write_buffer(storage.get("params"), 0, bytemuck::bytes_of(params));
        engine.queue.write_buffer(storage.get(sided("chunk", side)), 0, bytemuck::bytes_of(&chunk));
        let clock = self.clocks[side].as_ref();
        let variant = Variant::new(&self.options);
        let queries = clock.map(|clock| &clock.queries);
        let mut commands = Commands::new(&engine, &self.storage, &mut self.binds, variant, queries, side);
        let totals = commands.buffer("totals");
        commands.encoder.clear_buffer(totals, 0, None);
        record(&mut commands)?;
        readback::record(&mut commands, clock, true, prefetched);
        let (encoder, passes) = (commands.encoder, commands.passes);
        let submission = engine.submit(encoder);
        Ok(Flight { chunk, side, submission, prefetched, passes })
    }

    /// Waits for a chunk and decodes its output. `fixed` is the length of the output where the device
    /// does not count it.
    fn land(
        &mut self,
        flight: Flight,
        params: &Params,
        fixed: Option<u64>,
        sink: &mut Sink<'_>,
    ) -> Result<(Counters, Landed), Failure> {
        let engine = self.engine.clone();
        let period = engine.queue.get_timestamp_period();
        let staging = self.storage.get(sided("staging", flight.side)).clone();
        let bytes = HEAD + flight.prefetched;
        sink.report.downloaded += bytes;
        let patience = self.options.patience;
        let mut clock = Instant::now();
        // The words leave the mapped memory only if they must wait for the table or for the rest.
        let (head, early) =
            readback::read(&engine, &staging, bytes, flight.submission.clone(), patience, |bytes| {
                let head: Head = bytemuck::pod_read_unaligned(&bytes[..HEAD as usize]);
                let words = fixed.unwrap_or(wide(head.totals.words)) as usize;
                let have = &bytes[HEAD as usize..];
                let whole = 4 * words <= have.len();
                let used = if whole { &have[..4 * words] } else { have };
                (head, bytemuck::pod_collect_to_vec::<u8, u32>(used))
            })?;
        sink.report.wait += lap(&mut clock);
        if engine.timestamps {
            add_times(&mut sink.report.kernels, &head.times(&flight.passes, period));
        }
        let (totals, room) = (head.totals, self.storage.size(sided("out", flight.side)) / 4);
        if wide(totals.pairs) > sink.limit.saturating_sub(sink.pairs) && sink.accept.is_none() {
            return Err(Failure::Call(Error::TooManyPairs { limit: sink.limit }));
        }
        let words = fixed.unwrap_or(wide(totals.words));
        let plan_failed = params.cells > 0 && !self.room.clone().held(params, head.counters);
        if plan_failed {
            return Ok((head.counters, Landed::Done));
        }
        if words > room {
            return Ok((head.counters, Landed::Overflow(words)));
        }
        let rest = self.fetch(sided("out", flight.side), early.len() as u64, words, sink)?;
        sink.report.wait += lap(&mut clock);
        let words = if rest.is_empty() { early } else { [early, rest].concat() };
        self.words = words.len() as u64;
        self.most_words = self.most_words.max(self.words);
        sink.count(&totals);
        let pairs = self.decode(&words, params, head.counters.entries, sink)?;
        self.coding.pairs = wide(totals.pairs);
        sink.report.compression += words.len() as f64;
        sink.add(pairs).map_err(Failure::Call)?;
        sink.report.decode += lap(&mut clock);
        Ok((head.counters, Landed::Done))
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

/// A range of work items in chunks.
fn cut(all: Chunk, [small, large]: [u32; 2]) -> Vec<Chunk> {
    let (small, large) = (small.max(1), large.max(1));
    let count = all.small_items.div_ceil(small).max(all.large_items.div_ceil(large));
    let part = |i: u32| {
        let (s, l) = ((i * small).min(all.small_items), (i * large).min(all.large_items));
        Chunk {
            first_small: all.first_small + s,
            small_items: small.min(all.small_items - s),
            first_large: all.first_large + l,
            large_items: large.min(all.large_items - l),
            ..Chunk::default()
        }
    };
    (0..count).map(part).collect()
}

fn add_times(sum: &mut Vec<(&'static str, Duration)>, times: &[(&'static str, Duration)]) {
    for &(name, time) in times {
        match sum.iter_mut().find(|(known, _)| *known == name) {
            Some((_, sum)) => *sum += time,
            None => sum.push((name, time)),
        }
    }
}

/// Whether records would be smaller than plain pairs, by what the calls before have shown.
#[derive(Clone, Copy, Debug, Default)]
struct CodingChoice {
    /// Pairs of the last chunk.
    pairs: u64,
    packed: bool,
    /// Calls until records are tried again after they turned out larger.
    wait: u32,
}

impl CodingChoice {
    fn packed(&self, wanted: Coding) -> bool {
        match wanted {
            Coding::Auto => self.packed,
            coding => coding == Coding::Packed,
        }
    }

    /// Records need the entries for decoding, 4 bytes each, and take a quarter of 8 bytes a pair where
    /// pairs share rows, up to half of it where they do not.
    fn learn(&mut self, packed: bool, pairs: u64, entries: u32, report: &GpuReport) {
        let (plain, table) = (8 * pairs, 4 * u64::from(entries));
        self.wait = self.wait.saturating_sub(1);
        if packed {
            self.packed = 4 * report.compression as u64 + table < plain;
            self.wait = if self.packed { 0 } else { 64 };
        } else {
            self.packed = self.wait == 0 && plain / 2 + table < plain;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chunks_cover_every_item_once() {
        for (small, large) in [(0, 0), (1, 0), (0, 7), (10, 3), (9, 9)] {
            let all = Chunk {
                first_small: 5,
                small_items: small,
                first_large: 2,
                large_items: large,
                ..Chunk::default()
            };
            let chunks = cut(all, [3, 2]);
            let items = |of: fn(&Chunk) -> (u32, u32)| -> Vec<u32> {
                chunks.iter().map(of).flat_map(|(first, n)| first..first + n).collect()
            };
            assert_eq!(items(|c| (c.first_small, c.small_items)), (5..5 + small).collect::<Vec<_>>());
            assert_eq!(items(|c| (c.first_large, c.large_items)), (2..2 + large).collect::<Vec<_>>());
            assert!(chunks.iter().all(|c| c.small_items + c.large_items > 0));
        }
    }
}
