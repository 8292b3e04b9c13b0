//! The search of one job: one submission and one wait, unless there is more work or output than fits. What did not fit is
//! repeated with larger buffers.

use super::GpuError;
use super::chunk::{ChunkResult, PendingChunk};
use super::error::Failure;
use super::items::{cut, rest, with_slack};
use super::job::Job;
use super::passes::{self, CLEAR_TOTALS, Groups, Step};
use super::session::Session;
use crate::decode::pair_count;
use crate::layout::{BITS, Chunk, Counters, LANES, Params, SORTED};
use pbig_shaders::CHECK_ALL;
use std::collections::VecDeque;

/// Maximum number of repetitions of a map before the set is split. Each one has the capacities that the last one asked for.
const MAX_REPEATS: u32 = 8;

/// Factor on the cells with which a plan of too many tests is tried once more.
const FINER_RETRY: f32 = 0.125;

impl Session {
    /// Searches with a grid, or tests every pair (Avril 3.2).
    pub(super) async fn search(&mut self, job: &Job<'_>) -> Result<(), Failure> {
        let uploaded = self.params;
        self.cell_factor = 1.0;
        for _ in 0..MAX_REPEATS {
            self.params = uploaded;
            self.add_plan(job)?;
            let Some(done) = self.try_to_search().await? else { continue };
            if self.params.levels > 0 {
                // The host sorts the chunks that are left.
                self.params.flags &= !SORTED;
                self.search_rest(&done).await?;
                self.sink.note_plan(self.plan.as_ref().map(|kept| &kept.plan));
                self.plan.take_if(|kept| kept.is_outgrown_after(&self.sizes.lists));
            }
            return Ok(());
        }
        Err(self.too_large().into())
    }

    /// Submits the first chunk, and the others if their pairs are sorted on the device. Returns the items that are done, or
    /// none if the map has to be repeated.
    async fn try_to_search(&mut self) -> Result<Option<Chunk>, Failure> {
        let mut chunk = self.submit_first()?;
        let mut items = chunk.items;
        let mut result = self.finish(chunk).await?;
        if matches!(result, ChunkResult::Unsorted) {
            let counted = self.sizes.lists;
            chunk = self.submit_rest_and_sort(&items, &counted)?;
            items = chunk.items;
            result = self.finish(chunk).await?;
        }
        match result {
            ChunkResult::Done => Ok(Some(items)),
            ChunkResult::MapTooLarge => Ok(None),
            ChunkResult::TooManyTests => self.replan().map(|()| None),
            ChunkResult::OutputTooLarge(words) => self.note_output(words),
            // The last submission has all pairs: it is done, or too large.
            ChunkResult::Unsorted => Err(self.too_large().into()),
        }
    }

    /// Gives up a plan that makes too many tests: it may have been made for other boxes. One that was made for these is tried once
    /// more, with finer cells: a few boxes far away leave too large ones.
    ///
    /// # Errors
    /// If that is done: the call is declined.
    fn replan(&mut self) -> Result<(), Failure> {
        let was_new = self.plan.take().is_some_and(|kept| kept.is_new());
        // Lists that such a plan makes are not worth their memory, and say nothing of the next one's.
        let Counters { tests, too_many_tests, .. } = std::mem::take(&mut self.sizes.lists);
        if !was_new {
            return Ok(());
        }
        if self.cell_factor > FINER_RETRY {
            self.cell_factor = FINER_RETRY;
            return Ok(());
        }
        let Params { boxes, most_tests, .. } = self.params;
        let [tests, most] = [tests, most_tests].map(|tests| u64::from(LANES) * u64::from(tests));
        // The number wraps around beyond 32 bits of workgroups.
        let tests = if too_many_tests > 0 { "over 2^40".to_owned() } else { tests.to_string() };
        Err(Failure::Declined(format!(
            "the device declined {tests} tests of {boxes} boxes, more than {most}"
        )))
    }

    /// Notes how much output there is. Returns the items that are done: none if the map can be used again.
    fn note_output(&mut self, words: u64) -> Result<Option<Chunk>, Failure> {
        self.sizes.word_capacity = words;
        let Params { levels, flags, .. } = self.params;
        let fits = words <= self.storage.max_buffer_bytes / 4;
        // Output that does not fit comes as bits the next time. Fewer boxes at a time have fewer of them.
        if levels == 0 && !fits && flags & BITS != 0 {
            return Err(self.too_large().into());
        }
        // The map is there, so only the checks are repeated, unless the pairs can be sorted with it.
        let is_repeated = levels == 0 || flags & SORTED != 0 && fits;
        Ok((!is_repeated).then(Chunk::default))
    }

    /// Submits the first chunk: with a grid also map and schedule, without one all pairs.
    fn submit_first(&mut self) -> Result<PendingChunk, GpuError> {
        if self.params.levels == 0 {
            let small_items = pair_count(self.params.boxes).div_ceil(u64::from(LANES)) as u32;
            let items = Chunk { small_items, ..Chunk::default() };
            let steps = [CLEAR_TOTALS, Step::Run(&CHECK_ALL, Groups::Direct(small_items))];
            return self.submit(items, 0, &steps);
        }
        let first_bytes = self.first_bytes();
        passes::make_buffers(&mut self.storage, &mut self.params, &self.sizes.lists, first_bytes)?;
        let [small_items, large_items] = self.chunk_items();
        let items = Chunk { small_items, large_items, ..Chunk::default() };
        if self.params.flags & SORTED == 0 {
            return self.submit(items, 0, &passes::map_and_check(&self.params, false));
        }
        let most = self.storage.max_buffer_bytes;
        let words = (4 * self.sizes.word_capacity).clamp(first_bytes.min(most), most) / 4;
        passes::make_sort_buffers(&mut self.storage, &mut self.params, words)?;
        // Kernels that are timed are all in one submission if they may be.
        let lists = self.sizes.lists;
        let expected = if self.options.time_kernels { lists } else { with_slack(&lists) };
        let is_all = rest(&expected, &items).is_empty();
        let steps = passes::map_and_check(&self.params, is_all);
        // A chunk that is not read is not timed.
        if is_all || self.options.time_kernels {
            return self.submit(items, 0, &steps);
        }
        // The chunks of the last call, and a few items more, without a wait in between. Items that are not there are skipped.
        self.make_room(0)?;
        self.submit_unread(items, &steps)?;
        self.submit_rest_and_sort(&items, &expected)
    }

    /// Returns the work items of a chunk. A software adapter gets fewer, so that it answers in time.
    fn chunk_items(&self) -> [u32; 2] {
        let share = if self.device.is_software { 4 } else { 1 };
        self.options.chunk.map(|items| (items / share).max(1))
    }

    /// Returns the chunks after the first one, of these work items.
    pub(super) fn chunks_after(&self, first: &Chunk, items: &Counters) -> Vec<Chunk> {
        cut(rest(items, first), self.chunk_items())
    }

    /// Searches the other chunks, two at a time: the device checks one while the host decodes the other (PBIG 5.3).
    async fn search_rest(&mut self, done: &Chunk) -> Result<(), Failure> {
        let mut pending: VecDeque<Chunk> = self.chunks_after(done, &self.sizes.lists).into();
        let mut in_progress: VecDeque<PendingChunk> = VecDeque::new();
        let most = if self.options.pipelining { 2 } else { 1 };
        let mut side = 0;
        loop {
            while in_progress.len() < most
                && let Some(items) = pending.pop_front()
            {
                side = 1 - side;
                let [small, large] = passes::check(&items);
                in_progress.push_back(self.submit(items, side, &[CLEAR_TOTALS, small, large])?);
            }
            let Some(chunk) = in_progress.pop_front() else { return Ok(()) };
            let items = chunk.items;
            match self.finish(chunk).await? {
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
