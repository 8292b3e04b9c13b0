//! The search of one job: one submission and one wait, unless there is more work or output than fits. What did not fit is
//! repeated with larger buffers.

use super::GpuError;
use super::chunk::{ChunkResult, PendingChunk};
use super::coding::Counted;
use super::error::Failure;
use super::items::{cut, rest};
use super::job::Job;
use super::passes::{self, CLEAR_TOTALS, Groups, Step};
use super::session::Session;
use super::sink::Sink;
use crate::decode::pair_count;
use crate::layout::{BITS, Chunk, Counters, LANES, Params, SORTED};
use pbig_shaders::CHECK_ALL;
use std::collections::VecDeque;

/// Maximum number of repetitions of a map before the set is split. Each one has the capacities that the last one asked for.
const MAX_REPEATS: u32 = 8;

/// Factor on the cell size with which a plan of too many tests is tried once more.
const FINEST_RETRY: f32 = 0.125;

impl Session {
    /// Searches with a grid, or tests every pair (Avril 3.2).
    pub(super) async fn search(
        &mut self,
        job: &Job<'_>,
        uploaded: Params,
        sink: &mut Sink,
    ) -> Result<(), Failure> {
        let before = sink.pairs();
        for _ in 0..MAX_REPEATS {
            let mut params = self.with_plan(job, uploaded, &mut sink.found.report).await?;
            let Some(done) = self.try_to_search(&mut params, sink).await? else { continue };
            if params.levels > 0 {
                // The host sorts the chunks that are left.
                params.flags &= !SORTED;
                self.search_rest(&params, rest(&self.sizes.lists, &done), sink).await?;
                sink.note_plan(self.plan.as_ref().map(|kept| &kept.plan));
                self.plan.take_if(|kept| kept.is_outgrown_after(&self.sizes.lists));
            }
            let entries = u64::from(self.sizes.lists.entries);
            self.counted = Counted { pairs: sink.pairs() - before, entries };
            return Ok(());
        }
        Err(self.too_large().into())
    }

    /// Submits the first chunk, and the others if their pairs are sorted on the device. Returns the items that are done, or
    /// none if the map has to be repeated.
    async fn try_to_search(
        &mut self,
        params: &mut Params,
        sink: &mut Sink,
    ) -> Result<Option<Chunk>, Failure> {
        let mut chunk = self.submit_first(params, sink.left())?;
        let mut items = chunk.items;
        let mut result = self.finish(chunk, params, sink).await?;
        if matches!(result, ChunkResult::Unsorted) {
            let others = cut(rest(&self.sizes.lists, &items), self.chunk_items());
            chunk = self.submit_rest_and_sort(params, &items, &others, sink.left())?;
            items = chunk.items;
            result = self.finish(chunk, params, sink).await?;
        }
        match result {
            ChunkResult::Done => Ok(Some(items)),
            ChunkResult::MapTooLarge => Ok(None),
            ChunkResult::TooManyTests => self.replan(params).map(|()| None),
            ChunkResult::OutputTooLarge(words) => self.note_output(words, params),
            // The last submission has all pairs: it is done, or too large.
            ChunkResult::Unsorted => Err(self.too_large().into()),
        }
    }

    /// Gives up a plan that makes too many tests. A new one is tried once more, with finer cells.
    ///
    /// # Errors
    /// If that is done: the call is declined.
    fn replan(&mut self, params: &Params) -> Result<(), Failure> {
        let was_new = self.plan.take().is_some_and(|kept| kept.is_new());
        // Lists that such a plan makes are not worth their memory.
        let Counters { tests, too_many_tests, .. } = std::mem::take(&mut self.sizes.lists);
        if !was_new {
            return Ok(());
        }
        if self.cell_factor > FINEST_RETRY {
            self.cell_factor = FINEST_RETRY;
            return Ok(());
        }
        self.cell_factor = 1.0;
        let [tests, most] = [tests, params.most_tests].map(|tests| u64::from(LANES) * u64::from(tests));
        // The number wraps around beyond 32 bits of workgroups.
        let tests = if too_many_tests > 0 { "over 2^40".to_owned() } else { tests.to_string() };
        let boxes = params.boxes;
        Err(Failure::Declined(format!(
            "the device declined {tests} tests of {boxes} boxes, more than {most}"
        )))
    }

    /// Notes how much output there is. Returns the items that are done: none if the map can be used again.
    fn note_output(&mut self, words: u64, params: &Params) -> Result<Option<Chunk>, Failure> {
        self.sizes.word_capacity = words;
        let fits = words <= self.storage.max_buffer_bytes / 4;
        // Output that does not fit comes as bits the next time. They have no mark that tells ended pairs from new ones. Fewer boxes at
        // a time have fewer of both.
        if params.levels == 0 && !fits && (self.finds_changes || params.flags & BITS != 0) {
            return Err(self.too_large().into());
        }
        // The map is there, so only the checks are repeated, unless the pairs can be sorted with it.
        let is_repeated = params.levels == 0 || params.flags & SORTED != 0 && fits;
        Ok((!is_repeated).then(Chunk::default))
    }

    /// Submits the first chunk: with a grid also map and schedule, without one all pairs.
    fn submit_first(&mut self, params: &mut Params, left: u64) -> Result<PendingChunk, GpuError> {
        if params.levels == 0 {
            let small_items = pair_count(params.boxes).div_ceil(u64::from(LANES)) as u32;
            let items = Chunk { small_items, ..Chunk::default() };
            let steps = [CLEAR_TOTALS, Step::Run(&CHECK_ALL, Groups::Direct(small_items))];
            return self.submit(params, items, 0, &steps, left);
        }
        let first_bytes = self.first_bytes(params.boxes);
        passes::make_buffers(&mut self.storage, params, &self.sizes.lists, first_bytes)?;
        let [small_items, large_items] = self.chunk_items();
        let items = Chunk { small_items, large_items, ..Chunk::default() };
        if params.flags & SORTED == 0 {
            return self.submit(params, items, 0, &passes::map_and_check(params, false), left);
        }
        let most = self.storage.max_buffer_bytes;
        let words = (4 * self.sizes.word_capacity).clamp(first_bytes.min(most), most) / 4;
        passes::make_sort_buffers(&mut self.storage, params, words)?;
        let others = cut(rest(&self.sizes.lists, &items), self.chunk_items());
        let steps = passes::map_and_check(params, others.is_empty());
        // A chunk that is not read is not timed.
        if others.is_empty() || self.options.time_kernels {
            return self.submit(params, items, 0, &steps, left);
        }
        // As many chunks as in the last call, without a wait in between. Items that are not there are skipped.
        self.make_room(params, 0)?;
        self.submit_unread(params, items, &steps, left)?;
        self.submit_rest_and_sort(params, &items, &others, left)
    }

    /// Returns the work items of a chunk. A software adapter gets fewer, so that it answers in time.
    fn chunk_items(&self) -> [u32; 2] {
        let share = if self.device.is_software { 4 } else { 1 };
        self.options.chunk.map(|items| (items / share).max(1))
    }

    /// Searches the other chunks, two at a time: the device checks one while the host decodes the other (PBIG 5.3).
    async fn search_rest(&mut self, params: &Params, left: Chunk, sink: &mut Sink) -> Result<(), Failure> {
        let mut pending: VecDeque<Chunk> = cut(left, self.chunk_items()).into();
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
            match self.finish(chunk, params, sink).await? {
                ChunkResult::Done => {}
                ChunkResult::OutputTooLarge(words) => {
                    let smaller = self.smaller(items, words)?;
                    smaller.into_iter().rev().for_each(|part| pending.push_front(part));
                }
                // The first chunk has said that the map is right, and a map does not change.
                _ => return Err(GpuError::Refused("a chunk that contradicts the first".into()).into()),
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
        GpuError::TooLarge {
            what: "the lists or the output of a search",
            bytes: 4 * self.sizes.word_capacity,
            limit,
        }
    }
}
