//! The state of a finder on a device, and the search of one job: one submission and one wait, unless there is more work or
//! output than fits.

use super::changes::MotionBounds;
use super::chunk::{ChunkResult, PendingChunk};
use super::coding::CodingChoice;
use super::commands::{BindGroups, Groups};
use super::device::GpuDevice;
use super::error::Failure;
use super::readback::Timestamps;
use super::sink::Sink;
use super::start::{FirstSubmission, bit_words};
use super::storage::{Side, Storage};
use super::upload::{PendingChanges, UploadCache};
use super::{ChangeRequest, GpuError, GpuPlan, map};
use crate::config::{Coding, GpuOptions};
use crate::layout::{BITS, Chunk, Counters, FILTERED, LANES, Motion, PACKED, Params};
use crate::{Aabb, ProxyFilter};
use pbig_shaders as shaders;
use std::collections::VecDeque;
use std::sync::Arc;

/// Most repetitions of a map before the call goes to the CPU. Each one has the capacities that the last one asked for.
const MAX_REPEATS: u32 = 6;

/// The boxes of a job.
#[derive(Clone, Copy)]
pub(super) enum Input<'a> {
    /// Boxes now.
    Boxes(&'a [Aabb]),
    /// Boxes now and at the last update.
    Motions(&'a [Motion]),
    /// The same as changes, for a device that has the boxes of the last update.
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

/// Most words of output per changed box that are prefetched: four pairs. The output of a burst of pairs says nothing about
/// an update with few changes.
const PREFETCHED_WORDS_PER_CHANGE: u64 = 8;

/// A search of boxes that fit the device at once.
pub(super) struct Job<'a> {
    pub(super) input: Input<'a>,
    pub(super) filters: Option<&'a [ProxyFilter]>,
    /// If not 0: only pairs of a box below this index and a box from it on are wanted.
    pub(super) split: u32,
    /// The grid; without one every pair is tested.
    pub(super) plan: Option<&'a GpuPlan>,
}

/// The state of a finder on a device, kept from call to call.
#[derive(Debug)]
pub(super) struct Session {
    pub(super) device: Arc<GpuDevice>,
    pub(super) storage: Storage,
    pub(super) uploaded: UploadCache,
    /// Uploaded changes that no submission has applied yet.
    pub(super) pending_changes: Option<PendingChanges>,
    pub(super) motion_bounds: MotionBounds,
    /// This job searches for changes instead of all overlaps.
    pub(super) finds_changes: bool,
    pub(super) bind_groups: BindGroups,
    pub(super) timestamps: [Option<Timestamps>; 2],
    pub(super) capacities: map::Capacities,
    /// Number of boxes of a set that needed parts, and of its parts, until the next window of [`Storage::end_call`].
    pub(super) split: Option<(usize, usize)>,
    /// Expected words of output of a chunk: these are prefetched.
    pub(super) expected_words: u64,
    /// Most words of a chunk of this job.
    pub(super) max_words: u64,
    /// Capacity for output, in words.
    pub(super) word_capacity: u64,
    pub(super) coding: CodingChoice,
    pub(super) options: GpuOptions,
    /// Entries of this job's map, once fetched.
    pub(super) table: Option<Vec<u32>>,
}

impl Session {
    pub(super) fn new(device: Arc<GpuDevice>, options: &GpuOptions) -> Result<Self, GpuError> {
        let timestamps = [Timestamps::new(&device)?, Timestamps::new(&device)?];
        Ok(Self {
            storage: Storage::new(&device, options),
            uploaded: UploadCache::default(),
            pending_changes: None,
            motion_bounds: MotionBounds::default(),
            finds_changes: false,
            bind_groups: BindGroups::default(),
            timestamps,
            capacities: map::Capacities::default(),
            split: None,
            expected_words: 0,
            max_words: 0,
            word_capacity: 0,
            coding: CodingChoice::default(),
            options: *options,
            table: None,
            device,
        })
    }

    /// Finds all pairs of a job.
    pub(super) fn run(&mut self, job: &Job<'_>, sink: &mut Sink) -> Result<(), Failure> {
        let first = self.start(job, sink.left(), &mut sink.report)?;
        let result =
            if job.plan.is_some() { self.search_grid(first, sink) } else { self.search_all(first, sink) };
        sink.report.device_bytes = sink.report.device_bytes.max(self.storage.bytes());
        result
    }

    /// Uploads the boxes of a job.
    pub(super) fn upload(&mut self, job: &Job<'_>) -> Result<(), GpuError> {
        let (device, storage, uploaded) = (&self.device, &mut self.storage, &mut self.uploaded);
        self.finds_changes = !matches!(job.input, Input::Boxes(_));
        self.pending_changes = None;
        match job.input {
            Input::Boxes(boxes) => uploaded.upload(device, storage, boxes, job.filters)?,
            Input::Motions(motions) => uploaded.upload_motions(device, storage, motions, job.filters)?,
            Input::Changes(request) => {
                self.pending_changes = uploaded.upload_changes(device, storage, request)?;
                self.expected_words =
                    self.expected_words.min(PREFETCHED_WORDS_PER_CHANGE * request.changed.len() as u64);
            }
        }
        Ok(())
    }

    /// Notes the end of a call, which is one job or several.
    pub(super) fn end_call(&mut self) {
        if self.storage.end_call() {
            self.split = None;
        }
    }

    /// Resets the capacities: a set that was too large says nothing about its parts.
    pub(super) fn reset_capacities(&mut self) {
        self.capacities = map::Capacities::default();
        (self.expected_words, self.max_words, self.word_capacity) = (0, 0, 0);
    }

    /// Returns the parameters of a job, without capacities.
    pub(super) fn params(&self, job: &Job<'_>) -> Params {
        let mut params = job.plan.map_or(Params::default(), GpuPlan::params);
        params.boxes = job.input.len() as u32;
        params.small_cell = self.options.small_cell.clamp(1, LANES);
        // The output of a work item must fit the smallest buffer.
        params.columns = if self.storage.max_buffer_bytes() < 8 << 20 { 1 } else { 8 };
        params.flags = if job.filters.is_some() { FILTERED } else { 0 };
        params.split = job.split;
        if let Some(changes) = self.pending_changes {
            params.known = changes.known;
            (params.box_changes, params.filter_changes) = (changes.boxes, changes.filters);
        }
        params
    }

    /// Returns the coding. Changes are rarely so many that records or bits are smaller, and bursts of them end.
    pub(super) fn coding(&self) -> Coding {
        match self.options.coding {
            Coding::Auto if self.finds_changes => Coding::Plain,
            coding => coding,
        }
    }

    /// Returns the work items of a chunk. A software adapter gets fewer, so that it answers in time.
    pub(super) fn chunk_items(&self) -> [u32; 2] {
        let share = if self.device.is_software { 4 } else { 1 };
        self.options.chunk.map(|items| (items / share).max(1))
    }

    /// Tests every pair (Avril 3.2), in one submission.
    fn search_all(&mut self, first: FirstSubmission, sink: &mut Sink) -> Result<(), Failure> {
        let (mut params, mut first) = (first.params, Some(first.chunk));
        for _ in 0..MAX_REPEATS {
            let chunk = match first.take() {
                Some(chunk) => chunk,
                None => self.submit_all(&params, sink.left())?,
            };
            let fixed = (params.flags & BITS != 0).then(|| bit_words(&params));
            match self.finish_chunk(chunk, &params, fixed, sink)?.1 {
                ChunkResult::Done => {
                    sink.report.chunks += 1;
                    return Ok(());
                }
                ChunkResult::OutputTooLarge(words) => self.word_capacity = words,
                ChunkResult::MapTooLarge => {}
            }
            // One bit a pair fits the smallest buffer.
            params.flags |= if self.word_capacity > self.storage.max_buffer_bytes() / 4 { BITS } else { 0 };
            sink.report.repeats += 1;
        }
        Err(self.too_large().into())
    }

    /// Searches with a grid: map, schedule and the first chunk in one submission, then the other chunks.
    fn search_grid(&mut self, first: FirstSubmission, sink: &mut Sink) -> Result<(), Failure> {
        let (mut params, mut first) = (first.params, Some(first.chunk));
        let packed = params.flags & PACKED != 0;
        let before = (sink.pair_count, sink.words);
        for _ in 0..MAX_REPEATS {
            let chunk = match first.take() {
                Some(chunk) => chunk,
                None => self.submit_grid(&mut params, sink.left())?,
            };
            let (counters, result) = self.finish_chunk(chunk, &params, None, sink)?;
            self.capacities.needed = counters;
            if !matches!(result, ChunkResult::MapTooLarge) {
                let rest = self.after_first(result, self.first_chunk(), counters, sink);
                self.search_rest(&params, rest, sink)?;
                let (pairs, words) = (sink.pair_count - before.0, sink.words - before.1);
                self.coding.learn(packed, pairs, words, counters.entries);
                return Ok(());
            }
            sink.report.repeats += 1;
        }
        Err(self.too_large().into())
    }

    /// Returns the work items that are left after the first chunk: all of them if its output did not fit.
    fn after_first(&mut self, result: ChunkResult, first: Chunk, found: Counters, sink: &mut Sink) -> Chunk {
        let is_done = matches!(result, ChunkResult::Done);
        let done = match result {
            ChunkResult::Done | ChunkResult::MapTooLarge => first,
            ChunkResult::OutputTooLarge(words) => {
                self.word_capacity = words;
                sink.report.repeats += 1;
                Chunk::default()
            }
        };
        sink.report.chunks += u32::from(is_done);
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

    /// Searches the other chunks, two at a time: the device checks one while the host decodes the other (PBIG 5.3).
    fn search_rest(&mut self, params: &Params, rest: Chunk, sink: &mut Sink) -> Result<(), Failure> {
        let mut pending: VecDeque<Chunk> = cut(rest, self.chunk_items()).into();
        let mut in_progress: VecDeque<PendingChunk> = VecDeque::new();
        let most = if self.options.pipelining { 2 } else { 1 };
        let mut side = Side::First;
        loop {
            while in_progress.len() < most
                && let Some(items) = pending.pop_front()
            {
                side = side.other();
                in_progress.push_back(self.submit_items(params, items, side, sink.left())?);
            }
            let Some(chunk) = in_progress.pop_front() else { return Ok(()) };
            let items = chunk.items;
            match self.finish_chunk(chunk, params, None, sink)?.1 {
                ChunkResult::Done | ChunkResult::MapTooLarge => sink.report.chunks += 1,
                ChunkResult::OutputTooLarge(words) => {
                    sink.report.repeats += 1;
                    for part in self.smaller(items, words)?.into_iter().rev() {
                        pending.push_front(part);
                    }
                }
            }
        }
    }

    /// Returns a chunk whose output was too large: whole with more capacity, or in halves if a buffer cannot be so large.
    fn smaller(&mut self, chunk: Chunk, words: u64) -> Result<Vec<Chunk>, GpuError> {
        if words <= self.storage.max_buffer_bytes() / 4 {
            self.word_capacity = self.word_capacity.max(words);
            return Ok(vec![chunk]);
        }
        self.word_capacity = self.storage.max_buffer_bytes() / 4;
        let halves = cut(chunk, [chunk.small_items.div_ceil(2).max(1), chunk.large_items.div_ceil(2).max(1)]);
        if halves.len() < 2 { Err(self.too_large()) } else { Ok(halves) }
    }

    fn too_large(&self) -> GpuError {
        let limit = self.storage.max_buffer_bytes();
        GpuError::TooLarge { what: "the output of one work item", bytes: 4 * self.word_capacity, limit }
    }

    fn submit_items(
        &mut self,
        params: &Params,
        items: Chunk,
        side: Side,
        left: u64,
    ) -> Result<PendingChunk, GpuError> {
        self.submit_chunk(params, items, side, self.word_capacity, left, &mut |commands| {
            if items.small_items > 0 {
                commands.run(&shaders::CHECK_SMALL, Groups::Direct(items.small_items))?;
            }
            if items.large_items > 0 {
                commands.run(&shaders::CHECK_LARGE, Groups::Direct(items.large_items))?;
            }
            Ok(())
        })
    }
}

/// Cuts a range of work items into chunks.
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
