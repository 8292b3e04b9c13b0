//! A search on a device: one submission and one wait, unless there is more work or output than fits.

use super::changes::Trail;
use super::coding::CodingChoice;
use super::commands::{BindGroups, Groups};
use super::engine::Engine;
use super::error::Failure;
use super::flight::{Flight, Landed};
use super::readback::Clock;
use super::sink::Sink;
use super::start::{First, bit_words};
use super::storage::Storage;
use super::upload::{Mirror, News};
use super::{ChangeRequest, GpuError, map};
use crate::config::{Coding, GpuOptions};
use crate::layout::{BITS, Chunk, Counters, FILTERED, LANES, Motion, PACKED, Params};
use crate::plan::GpuPlan;
use crate::{Aabb, Config, ProxyFilter};
use pbig_shaders as shaders;
use std::collections::VecDeque;
use std::sync::Arc;

/// Times that a map is repeated before the call is left to the CPU: each repetition has the room that
/// the last one asked for.
const MOST_REPEATS: u32 = 6;

/// What a search is about.
#[derive(Clone, Copy)]
pub(super) enum Input<'a> {
    /// Boxes as they are.
    Boxes(&'a [Aabb]),
    /// Boxes as they are and were.
    Motions(&'a [Motion]),
    /// The same, as changes of what the device knows if it knows it.
    Changes(&'a ChangeRequest<'a>),
}

impl Input<'_> {
    pub(super) fn len(self) -> usize {
        match self {
            Self::Boxes(boxes) => boxes.len(),
            Self::Motions(motions) => motions.len(),
            Self::Changes(request) => request.boxes.len(),
        }
    }
}

/// Words of output for each changed box, at most, that are fetched before it is known how many there are:
/// four pairs. What a burst of pairs needed says nothing about an update that changes little.
const WORDS_A_CHANGE: u64 = 8;

/// One search.
pub(super) struct Job<'a> {
    pub(super) input: Input<'a>,
    pub(super) filters: Option<&'a [ProxyFilter]>,
    /// Only pairs of one box below and one from here on, unless 0.
    pub(super) split: u32,
    /// None: every pair is tested.
    pub(super) plan: Option<&'a GpuPlan>,
    pub(super) config: &'a Config,
}

/// The state of a finder on a device, kept from call to call.
#[derive(Debug)]
pub(super) struct Session {
    pub(super) engine: Arc<Engine>,
    pub(super) storage: Storage,
    pub(super) mirror: Mirror,
    /// What the device has been sent of boxes that it knows, until a submission takes it in.
    pub(super) news: Option<News>,
    pub(super) trail: Trail,
    /// Whether this job searches for changes rather than overlaps.
    pub(super) changes: bool,
    pub(super) binds: BindGroups,
    pub(super) clocks: [Option<Clock>; 2],
    pub(super) room: map::Room,
    /// The size of a set that turned out to need parts, and theirs, until buffers are looked through again.
    pub(super) parted: Option<(usize, usize)>,
    /// Words of output that a chunk is expected to have: how much is fetched before that is known.
    pub(super) words: u64,
    /// Most words of a chunk of this job; the room that the next one begins with.
    pub(super) most_words: u64,
    /// Room for output, in words.
    pub(super) word_room: u64,
    pub(super) coding: CodingChoice,
    pub(super) options: GpuOptions,
    /// The entries of this job's map, once fetched.
    pub(super) table: Option<Vec<u32>>,
}

impl Session {
    pub(super) fn new(engine: Arc<Engine>, options: &GpuOptions) -> Result<Self, GpuError> {
        let clocks = [Clock::new(&engine)?, Clock::new(&engine)?];
        Ok(Self {
            storage: Storage::new(&engine, options),
            mirror: Mirror::new(),
            news: None,
            trail: Trail::default(),
            changes: false,
            binds: BindGroups::default(),
            clocks,
            room: map::Room::default(),
            parted: None,
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
        let first = self.start(job, sink.left(), &mut sink.report)?;
        let result =
            if job.plan.is_some() { self.search_grid(first, sink) } else { self.search_all(first, sink) };
        sink.report.device_bytes = sink.report.device_bytes.max(self.storage.bytes());
        result
    }

    pub(super) fn upload(&mut self, job: &Job<'_>) -> Result<(), GpuError> {
        let (engine, storage, mirror) = (&self.engine, &mut self.storage, &mut self.mirror);
        self.changes = !matches!(job.input, Input::Boxes(_));
        self.news = None;
        match job.input {
            Input::Boxes(boxes) => mirror.upload(engine, storage, boxes, job.filters)?,
            Input::Motions(motions) => mirror.upload_motions(engine, storage, motions, job.filters)?,
            Input::Changes(request) => {
                self.news = mirror.upload_changes(engine, storage, request)?;
                self.words = self.words.min(WORDS_A_CHANGE * request.changed.len() as u64);
            }
        }
        Ok(())
    }

    /// To be called after a call, which is one job or several.
    pub(super) fn end_call(&mut self) {
        if self.storage.end_call() {
            self.parted = None;
        }
    }

    /// Makes room anew: what a set needed that was too large is not what its parts need.
    pub(super) fn forget_needs(&mut self) {
        self.room = map::Room::default();
        (self.words, self.most_words, self.word_room) = (0, 0, 0);
    }

    pub(super) fn params(&self, job: &Job<'_>) -> Params {
        let mut params = job.plan.map_or(Params::default(), GpuPlan::params);
        params.boxes = job.input.len() as u32;
        params.small_cell = job.config.small_cell.clamp(1, LANES);
        // An item's output must fit the smallest buffer.
        params.columns = if self.storage.most_bytes() < 8 << 20 { 1 } else { 8 };
        params.flags = if job.filters.is_some() { FILTERED } else { 0 };
        params.split = job.split;
        if let Some(news) = self.news {
            (params.known, params.moves, params.refilters) = (news.known, news.moves, news.refilters);
        }
        params
    }

    /// The wanted coding. Changes are rarely so many that records or bits are smaller, and bursts of them end.
    pub(super) fn coding(&self) -> Coding {
        match self.options.coding {
            Coding::Auto if self.changes => Coding::Plain,
            coding => coding,
        }
    }

    /// Work items in a chunk; a program that plays a GPU gets fewer, lest it passes for one that hangs.
    pub(super) fn chunk(&self) -> [u32; 2] {
        let share = if self.engine.software { 4 } else { 1 };
        self.options.chunk.map(|items| (items / share).max(1))
    }

    /// Without a grid (Avril 3.2), one submission.
    fn search_all(&mut self, first: First, sink: &mut Sink<'_>) -> Result<(), Failure> {
        let (mut params, mut first) = (first.params, Some(first.flight));
        for _ in 0..MOST_REPEATS {
            let flight = match first.take() {
                Some(flight) => flight,
                None => self.launch_all(&params, sink.left())?,
            };
            let fixed = (params.flags & BITS != 0).then(|| bit_words(&params));
            match self.land(flight, &params, fixed, sink)?.1 {
                Landed::Done => {
                    sink.report.chunks += 1;
                    return Ok(());
                }
                Landed::Overflow(words) => self.word_room = words,
                Landed::NoMap => {}
            }
            // One bit a pair has room in the smallest buffer.
            params.flags |= if self.word_room > self.storage.most_bytes() / 4 { BITS } else { 0 };
            sink.report.repeats += 1;
        }
        Err(self.no_room().into())
    }

    /// With a grid: map, schedule and the first chunk in one submission; the other chunks after it.
    fn search_grid(&mut self, first: First, sink: &mut Sink<'_>) -> Result<(), Failure> {
        let (mut params, mut first) = (first.params, Some(first.flight));
        let packed = params.flags & PACKED != 0;
        let before = (sink.written, sink.report.compression);
        for _ in 0..MOST_REPEATS {
            let flight = match first.take() {
                Some(flight) => flight,
                None => self.launch_grid(&mut params, sink.left())?,
            };
            let (counters, landed) = self.land(flight, &params, None, sink)?;
            self.room.needed = counters;
            if !matches!(landed, Landed::NoMap) {
                let rest = self.note(landed, self.first_chunk(), counters, sink);
                self.search_rest(&params, rest, sink)?;
                let (pairs, words) = (sink.written - before.0, sink.report.compression - before.1);
                self.coding.learn(packed, pairs, words as u64, self.room.needed.entries);
                return Ok(());
            }
            sink.report.repeats += 1;
        }
        Err(self.no_room().into())
    }

    /// What is left to do after the first chunk: all of it again if its output had no room.
    fn note(&mut self, landed: Landed, first: Chunk, found: Counters, sink: &mut Sink<'_>) -> Chunk {
        let done = match landed {
            Landed::Done | Landed::NoMap => first,
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
        let mut pending: VecDeque<Chunk> = cut(rest, self.chunk()).into();
        let mut flights: VecDeque<Flight> = VecDeque::new();
        let most = if self.options.pipelining { 2 } else { 1 };
        let mut side = 0;
        loop {
            while flights.len() < most
                && let Some(chunk) = pending.pop_front()
            {
                side = 1 - side;
                flights.push_back(self.launch_chunk(params, chunk, side, sink.left())?);
            }
            let Some(flight) = flights.pop_front() else { return Ok(()) };
            let chunk = flight.chunk;
            match self.land(flight, params, None, sink)?.1 {
                Landed::Done | Landed::NoMap => sink.report.chunks += 1,
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
        left: u64,
    ) -> Result<Flight, GpuError> {
        self.launch(params, chunk, side, self.word_room, left, &mut |commands| {
            if chunk.small_items > 0 {
                commands.run(&shaders::CHECK_SMALL, Groups::Direct(chunk.small_items))?;
            }
            if chunk.large_items > 0 {
                commands.run(&shaders::CHECK_LARGE, Groups::Direct(chunk.large_items))?;
            }
            Ok(())
        })
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
