//! The search of one job: one submission and one wait, unless there is more work or output than fits. What did not fit is
//! repeated with larger buffers.

use super::GpuError;
use super::chunk::{ChunkResult, PendingChunk};
use super::error::Failure;
use super::items::{cut, rest, with_slack};
use super::job::Job;
use super::kept_plan::FINER_RETRY;
use super::passes::{self, CLEAR_TOTALS, Groups, Step};
use super::session::{Session, first_bytes};
use crate::decode::pair_count;
use crate::layout::{BITS, Chunk, Counters, LANES, Params, SORTED};
use pbig_shaders::CHECK_ALL;

/// Maximum number of repetitions of a map before the set is split. Each one has the capacities that the last one asked for.
const MAX_REPEATS: u32 = 8;

impl Session {
    /// Searches with a grid, or tests every pair (Avril 3.2).
    pub(super) async fn search(&mut self, job: &Job<'_>) -> Result<(), Failure> {
        let uploaded = self.params;
        self.cell_factor = 1.0;
        for _ in 0..MAX_REPEATS {
            self.params = uploaded;
            self.add_plan(job)?;
            if !self.try_to_search().await? {
                continue;
            }
            if self.params.levels > 0 {
                self.sink.note_plan(self.plan.as_ref().map(|kept| &kept.plan));
                self.plan.take_if(|kept| kept.is_outgrown_after(&self.sizes.lists));
            }
            return Ok(());
        }
        Err(self.too_large().into())
    }

    /// Submits the chunks that are expected, and those that the last call did not have. Returns false if something has to be repeated.
    async fn try_to_search(&mut self) -> Result<bool, Failure> {
        let chunk = self.submit_first()?;
        let items = chunk.items;
        let mut result = self.finish(chunk).await?;
        if matches!(result, ChunkResult::Partial) {
            let counted = self.sizes.lists;
            let last = self.submit_rest(&items, &counted)?;
            result = self.finish(last).await?;
        }
        match result {
            ChunkResult::Done => Ok(true),
            ChunkResult::MapTooLarge => Ok(false),
            ChunkResult::TooManyTests => self.replan().map(|()| false),
            ChunkResult::OutputTooLarge(words) => self.note_output(words).map(|()| false),
            // The last submission has all items.
            ChunkResult::Partial => Err(GpuError::Refused("counts that contradict each other".into()).into()),
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

    /// Notes how much output there is.
    ///
    /// # Errors
    /// If no buffer can hold it: fewer boxes at a time have less output.
    fn note_output(&mut self, words: u64) -> Result<(), Failure> {
        self.sizes.word_capacity = words;
        let fits = words <= self.storage.max_buffer_bytes / 4;
        // Without a grid, pairs that do not fit come as bits the next time.
        let may_be_bits = self.params.levels == 0 && self.params.flags & BITS == 0;
        if fits || may_be_bits { Ok(()) } else { Err(self.too_large().into()) }
    }

    /// Submits the first chunk: with a grid also map and schedule, without one all pairs.
    fn submit_first(&mut self) -> Result<PendingChunk, GpuError> {
        if self.params.levels == 0 {
            let small_items = pair_count(self.params.boxes).div_ceil(u64::from(LANES)) as u32;
            let items = Chunk { small_items, ..Chunk::default() };
            let steps = [CLEAR_TOTALS, Step::Run(&CHECK_ALL, Groups::Direct(small_items))];
            return self.submit(items, &steps);
        }
        let first_bytes = first_bytes(&self.options, self.params.boxes);
        passes::make_buffers(&mut self.storage, &mut self.params, &self.sizes.lists, first_bytes)?;
        let [small_items, large_items] = self.chunk_items();
        let items = Chunk { small_items, large_items, ..Chunk::default() };
        if self.params.flags & SORTED != 0 {
            let most = self.storage.max_buffer_bytes;
            let words = (4 * self.sizes.word_capacity).clamp(first_bytes.min(most), most) / 4;
            passes::make_sort_buffers(&mut self.storage, &mut self.params, words)?;
        }
        let is_timed = self.options.time_kernels;
        let lists = self.sizes.lists;
        let expected = if is_timed { lists } else { with_slack(&lists) };
        let steps = passes::map_and_check(&self.params);
        // A chunk that is not read is not timed.
        if rest(&expected, &items).is_empty() || is_timed {
            return self.submit(items, &steps);
        }
        // The chunks of the last call, and a few items more, without a wait in between. Items that are not there are skipped.
        self.make_room()?;
        self.submit_unread(items, &steps)?;
        self.submit_rest(&items, &expected)
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

    fn too_large(&self) -> GpuError {
        let limit = self.storage.max_buffer_bytes;
        GpuError::TooLarge {
            what: "the lists or the output of a search",
            bytes: 4 * self.sizes.word_capacity,
            limit,
        }
    }
}
