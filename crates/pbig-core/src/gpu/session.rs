//! The state of a finder on a device, and the search of one job: one submission and one wait, unless there is more work or
//! output than fits, or no plan.

use super::chunk::{ChunkResult, PendingChunk};
use super::coding::{CodingChoice, bits_that_fit};
use super::device::GpuDevice;
use super::error::Failure;
use super::kept_plan::KeptPlan;
use super::passes::{self, CLEAR_TOTALS, Groups, Step};
use super::readback::Timestamps;
use super::sink::{GpuFound, Sink};
use super::storage::Storage;
use super::upload::UploadCache;
use super::{Change, ChangeRequest, GpuError, GpuPlan};
use crate::config::{Coding, GpuOptions};
use crate::decode::pair_count;
use crate::layout::{BITS, COUNTED, Chunk, Counters, FILTERED, LANES, Motion, PACKED, Params, RAW, SORTED};
use crate::pbig::Summary;
use crate::report::{Clock, GpuReport};
use crate::{Aabb, ProxyFilter};
use pbig_shaders::CHECK_ALL;
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

/// Most repetitions of a map before the call goes to the CPU. Each one has the capacities that the last one asked for.
const MAX_REPEATS: u32 = 8;

/// Most words of output per changed box that are prefetched: four pairs. The output of a burst of pairs says nothing about
/// an update with few changes.
const PREFETCHED_WORDS_PER_CHANGE: u64 = 8;

/// Most cells of a plan.
const MAX_CELLS: u64 = 1 << 28;

#[derive(Clone, Copy)]
pub(super) enum Input<'a> {
    Boxes,
    /// Boxes now and at the last update.
    Motions(&'a [Motion]),
    /// The same as changes, for a device that has the boxes of the last update.
    Changes(&'a ChangeRequest<'a>),
}

/// A search of boxes that fit the device at once.
pub(super) struct Job<'a> {
    /// The boxes now.
    pub(super) boxes: &'a [Aabb],
    pub(super) input: Input<'a>,
    pub(super) filters: Option<&'a [ProxyFilter]>,
    /// If not 0: only pairs of a box below this index and a box from it on are wanted.
    pub(super) split: u32,
    /// Without a grid every pair is tested.
    pub(super) needs_grid: bool,
    /// The caller wants the pairs in order.
    pub(super) is_sorted: bool,
}

impl Job<'_> {
    /// Returns the number of boxes that are valid now or were at the last update.
    fn valid(&self) -> u32 {
        let now = self.boxes.iter().filter(|one| one.is_valid()).count();
        let Input::Changes(request) = self.input else { return now as u32 };
        let ended = |change: &&Change| change.aabb.is_valid() && !self.boxes[change.id as usize].is_valid();
        (now + request.changed.iter().filter(ended).count()) as u32
    }
}

/// Lengths of lists and output that earlier calls needed.
#[derive(Debug, Default)]
pub(super) struct Sizes {
    /// Lengths of the lists of the map in the last call.
    pub(super) lists: Counters,
    /// Expected words of output of a chunk: these are prefetched.
    pub(super) expected_words: u64,
    /// Most words of a chunk of this job.
    pub(super) max_words: u64,
    pub(super) word_capacity: u64,
}

/// The state of a finder on a device, kept from call to call.
#[derive(Debug)]
pub(super) struct Session {
    pub(super) device: Arc<GpuDevice>,
    pub(super) options: GpuOptions,
    pub(super) storage: Storage,
    pub(super) uploaded: UploadCache,
    pub(super) timestamps: [Option<Timestamps>; 2],
    pub(super) sizes: Sizes,
    pub(super) coding: CodingChoice,
    pub(super) plan: Option<KeptPlan>,
    /// Factor on the cell size: smaller while cells hold too many boxes.
    pub(super) cell_factor: f32,
    /// Number of boxes of a set that needed parts, and of its parts, until the next window of [`Storage::end_call`].
    pub(super) split: Option<(usize, usize)>,
    /// This job searches for changes instead of all overlaps.
    pub(super) finds_changes: bool,
    /// Changes were uploaded that no submission has applied yet.
    pub(super) has_pending_changes: bool,
    /// The boxes on the device are floats: no map has turned them into ordered integers yet.
    pub(super) has_raw_boxes: bool,
    /// Entries of this job's map, once fetched.
    pub(super) table: Option<Vec<u32>>,
    /// Time of the host in this job, recording and submitting.
    pub(super) recording: Duration,
}

impl Session {
    pub(super) fn new(device: Arc<GpuDevice>, options: &GpuOptions) -> Result<Self, GpuError> {
        Ok(Self {
            options: *options,
            storage: Storage::new(device.clone(), options),
            uploaded: UploadCache::default(),
            timestamps: [Timestamps::new(&device)?, Timestamps::new(&device)?],
            sizes: Sizes::default(),
            coding: CodingChoice::default(),
            plan: None,
            cell_factor: 1.0,
            split: None,
            finds_changes: false,
            has_pending_changes: false,
            has_raw_boxes: false,
            table: None,
            recording: Duration::ZERO,
            device,
        })
    }

    /// Notes the end of a call, which is one job or several. Makes the cells of the next search finer if these held far
    /// too many boxes, coarser if they were nearly empty.
    pub(super) fn end_call(&mut self, found: &GpuFound, kept: u64) {
        const TOO_FULL: u64 = 64;
        const NEARLY_EMPTY: u64 = 4;
        if self.storage.end_call() {
            self.split = None;
        }
        if found.plan.is_none() {
            return;
        }
        let pairs = (found.pairs.len() + found.ended.len()) as u64;
        let useful_tests = (u64::from(found.valid) + kept.max(pairs)).max(1);
        let factor = match found.checks.made / useful_tests {
            0..NEARLY_EMPTY => (self.cell_factor * 2.0).min(1.0),
            NEARLY_EMPTY..=TOO_FULL => self.cell_factor,
            _ => (self.cell_factor * 0.5).max(1.0 / 64.0),
        };
        if factor != self.cell_factor {
            (self.cell_factor, self.plan) = (factor, None);
        }
    }

    pub(super) fn run(&mut self, job: &Job<'_>, sink: &mut Sink) -> Result<(), Failure> {
        let params = self.upload(job, &mut sink.found.report)?;
        let result = self.search(job, params, sink);
        sink.found.valid = if job.needs_grid { self.sizes.lists.valid } else { job.valid() };
        if !self.options.count_tests {
            sink.found.checks.made += if job.needs_grid {
                u64::from(LANES) * u64::from(self.sizes.lists.tests)
            } else {
                pair_count(params.boxes)
            };
        }
        let report = &mut sink.found.report;
        report.device_bytes = report.device_bytes.max(self.storage.bytes());
        report.record += std::mem::take(&mut self.recording);
        result
    }

    /// Uploads the boxes of a job. Returns its parameters, without grid and capacities.
    fn upload(&mut self, job: &Job<'_>, report: &mut GpuReport) -> Result<Params, GpuError> {
        self.table = None;
        self.sizes.expected_words = std::mem::take(&mut self.sizes.max_words);
        self.sizes.word_capacity = self.sizes.expected_words;
        self.finds_changes = !matches!(job.input, Input::Boxes);
        self.storage.bytes_sent = 0;
        let mut params = self.params(job);
        let mut clock = Clock::start();
        let (storage, uploaded, filters) = (&mut self.storage, &mut self.uploaded, job.filters);
        match job.input {
            Input::Boxes if job.needs_grid => {
                uploaded.upload_raw(storage, job.boxes, filters, &mut params)?;
            }
            Input::Boxes => uploaded.upload_few(storage, job.boxes, filters, &mut params)?,
            Input::Motions(motions) => uploaded.upload_motions(storage, motions, filters, &mut params)?,
            Input::Changes(request) => {
                let most = PREFETCHED_WORDS_PER_CHANGE * request.changed.len() as u64;
                self.sizes.expected_words = self.sizes.expected_words.min(most);
                uploaded.upload_changes(storage, request, &mut params)?;
            }
        };
        report.uploaded += self.storage.bytes_sent;
        report.upload += clock.lap();
        self.has_pending_changes = params.known > 0;
        self.has_raw_boxes = params.flags & RAW != 0;
        Ok(params)
    }

    fn params(&self, job: &Job<'_>) -> Params {
        let flags = [(job.filters.is_some(), FILTERED), (self.options.count_tests, COUNTED)];
        Params {
            small_cell: self.options.small_cell.clamp(1, LANES),
            // The output of a work item must fit the smallest buffer.
            columns: if self.storage.max_buffer_bytes < 8 << 20 { 1 } else { 8 },
            flags: flags.into_iter().filter(|(is_set, _)| *is_set).map(|(_, flag)| flag).sum(),
            split: job.split,
            ..Params::default()
        }
    }

    /// Adds to the parameters of a job what a plan and the coding of the output set.
    fn with_plan(
        &mut self,
        job: &Job<'_>,
        mut params: Params,
        report: &mut GpuReport,
    ) -> Result<Params, GpuError> {
        if !self.has_raw_boxes {
            params.flags &= !RAW;
        }
        if job.needs_grid {
            let kept = self.plan(job, &params, report)?;
            check_entries(kept, params.boxes)?;
            params = kept.plan.add_to(params);
            params.most_tests = kept.most_tests(params.boxes);
        }
        params.flags |= self.coding_flags(job, &params);
        Ok(params)
    }

    /// Returns the plan: the kept one, or one for the boxes that the device has now.
    fn plan(
        &mut self,
        job: &Job<'_>,
        params: &Params,
        report: &mut GpuReport,
    ) -> Result<&KeptPlan, GpuError> {
        let plan = match self.plan.take_if(|kept| kept.suits(job.boxes.len())) {
            Some(kept) => kept,
            None => {
                let classes = self.measure(params, report)?;
                let mut clock = Clock::start();
                let plan = self.plan_for(&Summary::of_classes(classes, job.boxes));
                report.plan += clock.lap();
                KeptPlan::new(plan, params.boxes)
            }
        };
        Ok(self.plan.insert(plan))
    }

    fn plan_for(&self, summary: &Summary) -> GpuPlan {
        let max_cells = (self.storage.max_buffer_bytes / 8).min(MAX_CELLS) as u32;
        GpuPlan::new(summary, &self.options, self.cell_factor, max_cells)
    }

    /// Returns the flags of the coding: plain pairs where the device sorts, and for changes. These are rarely so many that
    /// records or bits are smaller, and need a mark.
    fn coding_flags(&self, job: &Job<'_>, params: &Params) -> u32 {
        let has_grid = params.levels > 0;
        let flags = match self.options.coding {
            _ if self.finds_changes => 0,
            Coding::Auto if job.is_sorted && has_grid => 0,
            Coding::Auto if job.is_sorted => bits_that_fit(params, self.storage.max_buffer_bytes),
            wanted => self.coding.flag(wanted, params),
        };
        if flags == 0 && has_grid && job.is_sorted { SORTED } else { flags }
    }

    /// Searches with a grid, or tests every pair (Avril 3.2).
    fn search(&mut self, job: &Job<'_>, uploaded: Params, sink: &mut Sink) -> Result<(), Failure> {
        let before = (sink.pairs(), sink.words);
        let mut forced_flags = 0;
        for _ in 0..MAX_REPEATS {
            let mut params = self.with_plan(job, uploaded, &mut sink.found.report)?;
            params.flags |= forced_flags;
            let has_grid = params.levels > 0;
            if has_grid {
                sink.found.plan = self.plan.as_ref().map(|kept| kept.plan.clone());
            }
            let chunk = self.submit_first(&mut params, sink.left())?;
            let mut first = chunk.items;
            let mut result = self.finish(chunk, &params, sink)?;
            if matches!(result, ChunkResult::Unsorted) {
                let rest = cut(rest(&self.sizes.lists, &first), self.chunk_items());
                let chunk = self.submit_rest_and_sort(&params, &rest, sink)?;
                first = chunk.items;
                result = self.finish(chunk, &params, sink)?;
            }
            let done = match result {
                ChunkResult::Done => Some(first),
                // The last submission has all pairs, so it is done, or too large.
                ChunkResult::Unsorted => return Err(self.too_large().into()),
                ChunkResult::MapTooLarge => None,
                ChunkResult::TooManyTests => {
                    self.plan = None;
                    None
                }
                ChunkResult::OutputTooLarge(words) => {
                    self.sizes.word_capacity = words;
                    // The map is there, so only the checks are repeated, unless the pairs can be sorted with it.
                    let is_sorted = params.flags & SORTED != 0 && words <= self.storage.max_buffer_bytes / 4;
                    (has_grid && !is_sorted).then(Chunk::default)
                }
            };
            if let Some(done) = done.filter(|_| has_grid) {
                // The host sorts the chunks that are left.
                params.flags &= !SORTED;
                self.search_rest(&params, rest(&self.sizes.lists, &done), sink)?;
                let (pairs, words) = (sink.pairs() - before.0, sink.words - before.1);
                self.coding.learn(params.flags & PACKED != 0, pairs, words, self.sizes.lists.entries);
                let lists = self.sizes.lists;
                self.plan.take_if(|kept| kept.is_outgrown_after(&lists));
            }
            if done.is_some() {
                return Ok(());
            }
            if !has_grid && self.sizes.word_capacity > self.storage.max_buffer_bytes / 4 {
                // Bits have no mark that tells ended pairs from new ones: fewer boxes at a time have fewer of both.
                if self.finds_changes {
                    break;
                }
                // One bit a pair fits the smallest buffer.
                forced_flags = BITS;
            }
        }
        Err(self.too_large().into())
    }

    /// Submits the first chunk: with a grid also map and schedule, without one all pairs.
    fn submit_first(&mut self, params: &mut Params, left: u64) -> Result<PendingChunk, GpuError> {
        if params.levels == 0 {
            let small_items = pair_count(params.boxes).div_ceil(u64::from(LANES)) as u32;
            let items = Chunk { small_items, ..Chunk::default() };
            let steps = [CLEAR_TOTALS, Step::Run(&CHECK_ALL, Groups::Direct(small_items))];
            return self.submit(params, items, 0, &steps, left);
        }
        passes::make_buffers(&mut self.storage, params, &self.sizes.lists, self.options.first_bytes)?;
        if params.flags & SORTED != 0 {
            let most = self.storage.max_buffer_bytes;
            let words = (4 * self.sizes.word_capacity).clamp(self.options.first_bytes.min(most), most) / 4;
            passes::make_sort_buffers(&mut self.storage, params, words)?;
        }
        let [small_items, large_items] = self.chunk_items();
        let items = Chunk { small_items, large_items, ..Chunk::default() };
        let is_all = rest(&self.sizes.lists, &items).is_empty();
        self.submit(params, items, 0, &passes::map_and_check(params, is_all), left)
    }

    /// Returns the work items of a chunk. A software adapter gets fewer, so that it answers in time.
    fn chunk_items(&self) -> [u32; 2] {
        let share = if self.device.is_software { 4 } else { 1 };
        self.options.chunk.map(|items| (items / share).max(1))
    }

    /// Searches the other chunks, two at a time: the device checks one while the host decodes the other (PBIG 5.3).
    fn search_rest(&mut self, params: &Params, rest: Chunk, sink: &mut Sink) -> Result<(), Failure> {
        let mut pending: VecDeque<Chunk> = cut(rest, self.chunk_items()).into();
        let mut in_progress: VecDeque<PendingChunk> = VecDeque::new();
        let most = if self.options.pipelining { 2 } else { 1 };
        let mut side = 0;
        loop {
            while in_progress.len() < most
                && let Some(items) = pending.pop_front()
            {
                side = 1 - side;
                let [small, large] = passes::check(items.small_items, items.large_items);
                let steps = [CLEAR_TOTALS, small, large];
                in_progress.push_back(self.submit(params, items, side, &steps, sink.left())?);
            }
            let Some(chunk) = in_progress.pop_front() else { return Ok(()) };
            let items = chunk.items;
            if let ChunkResult::OutputTooLarge(words) = self.finish(chunk, params, sink)? {
                let smaller = self.smaller(items, words)?;
                smaller.into_iter().rev().for_each(|part| pending.push_front(part));
            }
        }
    }

    /// Returns a chunk whose output was too large: whole with more capacity, or in halves if a buffer cannot be so large.
    fn smaller(&mut self, chunk: Chunk, words: u64) -> Result<Vec<Chunk>, GpuError> {
        let most = self.storage.max_buffer_bytes / 4;
        if words <= most {
            self.sizes.word_capacity = self.sizes.word_capacity.max(words);
            return Ok(vec![chunk]);
        }
        self.sizes.word_capacity = most;
        let halves = cut(chunk, [chunk.small_items.div_ceil(2), chunk.large_items.div_ceil(2)]);
        if halves.len() < 2 { Err(self.too_large()) } else { Ok(halves) }
    }

    fn too_large(&self) -> GpuError {
        let limit = self.storage.max_buffer_bytes;
        GpuError::TooLarge { what: "the output of one work item", bytes: 4 * self.sizes.word_capacity, limit }
    }
}

/// Returns an error if 32 bits might not count the entries of so many boxes: up to 4 x 4 x 4 in each level but the last.
fn check_entries(kept: &KeptPlan, boxes: u32) -> Result<(), GpuError> {
    let entries = u64::from(boxes) * (64 * (kept.plan.levels.len() as u64 - 1) + 1);
    let limit = u64::from(u32::MAX);
    if entries > limit { Err(GpuError::TooLarge { what: "entries", bytes: entries, limit }) } else { Ok(()) }
}

/// Returns the work items that are left after the first chunk.
pub(super) fn rest(all: &Counters, done: &Chunk) -> Chunk {
    let first_small = all.small_items.min(done.small_items);
    let first_large = all.large_items.min(done.large_items);
    let (small_items, large_items) = (all.small_items - first_small, all.large_items - first_large);
    Chunk { first_small, small_items, first_large, large_items, ..Chunk::default() }
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
