//! A search whose boxes come from the host and whose pairs go there. One wait tells the counts, another one brings the pairs, unless they
//! are few. Lists that did not fit are made longer, and the search is repeated.

use super::error::{GpuError, Result};
use super::passes::{self, MOST_RANKED, pair_count};
use super::reports::Counts;
use super::session::Session;
use super::storage::BufferId;
use super::timer::Timer;
use crate::layout::{Chunk, Counters, LANES, Params, Totals, wide};
use crate::pbig::Summary;
use pbig_core::internal::Clock;
use pbig_core::{Aabb, DeviceFound, Pair, PairList, SearchRequest};
use pbig_shaders::Buffer;

/// Maximum number of repetitions. Each one has the room that the last one asked for.
const MAX_REPEATS: u32 = 8;

/// Bytes that the host reads at a time: while threads copy and check one piece, the next one comes.
const PIECE_BYTES: u64 = 1 << 24;

impl Session {
    /// Finds all pairs. The result uses the memory of `pairs`.
    pub(super) async fn search(
        &mut self,
        request: &SearchRequest<'_>,
        pairs: PairList,
    ) -> Result<DeviceFound> {
        self.found = DeviceFound::default();
        (self.found.pairs, self.max_pairs, self.submissions) = (pairs, request.max_pairs, 0);
        self.found.pairs.clear();
        self.timer.iter_mut().for_each(Timer::start);
        let result = self.find(request).await;
        result.inspect_err(|error| self.forecast.note_error(error, &mut self.storage))?;
        Ok(std::mem::take(&mut self.found))
    }

    async fn find(&mut self, request: &SearchRequest<'_>) -> Result<()> {
        if request.boxes.len() < 2 {
            self.found.valid = count_valid(request.boxes);
            return Ok(());
        }
        self.upload(request)?;
        let counts = self.count(request).await?;
        self.note(request, &counts);
        self.take_pairs(wide(counts.totals.words), request.is_sorted).await?;
        self.take_times().await?;
        self.storage.end_call();
        Ok(())
    }

    /// Uploads all boxes: to find those that moved, the host would have to read a copy of the last call's, too.
    fn upload(&mut self, request: &SearchRequest<'_>) -> Result<()> {
        let mut clock = Clock::start();
        self.storage.check_boxes(request.boxes.len() as u64)?;
        self.found.report.uploaded = self.storage.upload(Buffer::Boxes, request.boxes)?
            + self.storage.upload(Buffer::Filters, request.filters.unwrap_or(&[]))?;
        self.found.report.upload = clock.lap();
        Ok(())
    }

    /// Checks all pairs, again with more room if lists or pairs did not fit. Returns the counts.
    async fn count(&mut self, request: &SearchRequest<'_>) -> Result<Counts> {
        self.forecast.start();
        let boxes = request.boxes.len() as u32;
        for _ in 0..MAX_REPEATS {
            self.plan(request.boxes);
            self.params = self.forecast.params(&mut self.storage, boxes, request.filters.is_some())?;
            let counts = self.check().await?;
            if self.accepts(&counts)? {
                return Ok(counts);
            }
            self.found.report.repeats += 1;
        }
        Err(GpuError::Refused("counts that contradict each other".into()))
    }

    /// Makes a plan if the boxes need another one than that of the last call.
    fn plan(&mut self, boxes: &[Aabb]) {
        let count = boxes.len() as u32;
        if self.forecast.needs_plan(&self.storage.options, count) {
            let mut clock = Clock::start();
            self.forecast.make_plan(&Summary::of(boxes), count, &self.storage);
            self.found.report.plan += clock.lap();
        }
    }

    /// Sorts the boxes into cells, and checks their work items, a chunk in each submission. Returns the counts. The host learns with
    /// them how many chunks there are: before, it submits some more than the last call had.
    async fn check(&mut self) -> Result<Counts> {
        if self.params.levels == 0 {
            self.found.report.chunks = 1;
            self.submit(Chunk::default(), &passes::check_all(&self.params))?;
            return self.counts().await;
        }
        self.submit(self.chunk(0), &passes::map_and_check(&self.params))?;
        let last = self.chunks(&self.forecast.lists);
        let mut next = 1..last.saturating_add(last / 4);
        loop {
            for i in next.clone() {
                self.submit(self.chunk(i), &passes::check())?;
            }
            let counts = self.counts().await?;
            let (params, counters) = (&self.params, &counts.counters);
            let fits = passes::lists_fit(params, counters) && passes::tests_fit(params, counters);
            next = next.end..self.chunks(counters);
            self.found.report.chunks = next.end;
            if !fits || next.is_empty() {
                return Ok(counts);
            }
        }
    }

    fn chunk(&self, i: u32) -> Chunk {
        let [small_items, large_items] = self.chunk_items();
        let [first_small, first_large] = [small_items, large_items].map(|items| i.saturating_mul(items));
        Chunk { first_small, small_items, first_large, large_items, ..Chunk::default() }
    }

    fn chunks(&self, lists: &Counters) -> u32 {
        let [small, large] = self.chunk_items();
        lists.small_items.div_ceil(small).max(lists.large_items.div_ceil(large)).max(1)
    }

    /// Returns the numbers of small and of large work items of a chunk. A software adapter gets fewer, so that it answers in time.
    fn chunk_items(&self) -> [u32; 2] {
        let share = if self.storage.device.is_software { 4 } else { 1 };
        self.storage.options.chunk.map(|items| (items / share).max(1))
    }

    /// Learns from the counts of a check. Returns true if it is complete.
    ///
    /// # Errors
    /// If there are more pairs than the caller allows, or if a plan of finer cells makes too many tests, too.
    fn accepts(&mut self, Counts { counters, totals }: &Counts) -> Result<bool> {
        let was_finer = self.forecast.is_finer;
        if !self.forecast.learn(&self.params, counters) {
            let is_hopeless = was_finer && !passes::tests_fit(&self.params, counters);
            return if is_hopeless { Err(self.too_many_tests(counters)) } else { Ok(false) };
        }
        let words = wide(totals.words);
        if words / 2 > self.max_pairs {
            return Err(GpuError::TooManyPairs);
        }
        self.forecast.words = words;
        let has_fit = words <= self.storage.size(Buffer::Out) / 4;
        // A repeat keeps the plan, and learns again that the boxes have outgrown it.
        self.forecast.is_outdated &= has_fit;
        Ok(has_fit)
    }

    fn too_many_tests(&self, counters: &Counters) -> GpuError {
        let Params { boxes, most_tests, .. } = self.params;
        let [tests, most] = [counters.tests, most_tests].map(|tests| u64::from(LANES) * u64::from(tests));
        // The number wraps around beyond 32 bits of workgroups.
        let tests = if counters.too_many_tests > 0 { "over 2^40".to_owned() } else { tests.to_string() };
        GpuError::Declined(format!("{tests} tests of {boxes} boxes are more than {most}"))
    }

    /// Notes the grid, the tests and the memory of the call.
    fn note(&mut self, request: &SearchRequest<'_>, counts: &Counts) {
        self.found.report.device_bytes = self.storage.bytes();
        if self.params.levels > 0 {
            self.note_grid(&counts.counters);
        } else {
            self.found.valid = count_valid(request.boxes);
            self.found.checks.made = pair_count(self.params.boxes);
        }
        if self.storage.options.count_tests {
            let Totals { made, redundant, overlaps, .. } = counts.totals;
            let checks = &mut self.found.checks;
            (checks.made, checks.redundant) = (wide(made), wide(redundant));
            checks.unnecessary = checks.made.saturating_sub(checks.redundant + wide(overlaps));
        }
    }

    fn note_grid(&mut self, counters: &Counters) {
        let Some(plan) = self.forecast.plan() else { return };
        let found = &mut self.found;
        (found.valid, found.plan) = (counters.valid, Some(plan.to_string()));
        found.checks.made = u64::from(LANES) * u64::from(counters.tests);
        (found.report.cell, found.report.cells) = (plan.cell, plan.params.cells.into());
        found.report.entries = counters.entries.into();
    }

    /// Takes the pairs of this number of words, in order if the caller wants it and the device can sort so many.
    async fn take_pairs(&mut self, words: u64, is_sorted: bool) -> Result<()> {
        if words <= self.prefetched.len() as u64 {
            let mut pairs: Vec<Pair> = bytemuck::cast_slice(&self.prefetched[..words as usize]).to_vec();
            pairs.sort_unstable();
            return self.append(&pairs);
        }
        // First: the sort gets the room that is left.
        self.make_staging(4 * words)?;
        let is_sorted = is_sorted && self.params.levels > 0 && self.sort(words)?;
        self.read_pairs(words).await?;
        let is_out_of_order = is_sorted && !self.found.pairs.is_in_order();
        if is_out_of_order { Err(GpuError::BadPairs("out of order".into())) } else { Ok(()) }
    }

    /// Sorts the pairs of this number of words, a part of them in each submission. Returns false if there is no room for that.
    fn sort(&mut self, words: u64) -> Result<bool> {
        let pairs = u32::try_from(words / 2).unwrap_or(u32::MAX);
        match passes::make_sort_buffers(&mut self.storage, self.params.boxes, pairs) {
            Err(GpuError::Declined(_)) => return Ok(false),
            made => made?,
        }
        self.submit(Chunk::default(), &passes::group(self.params.boxes, pairs))?;
        // A few steps for each pair take no patience of their own.
        self.submissions = 0;
        for first_pair in (0..pairs).step_by(MOST_RANKED as usize) {
            let left = pairs - first_pair;
            self.submit(Chunk { first_pair, ..Chunk::default() }, &passes::rank(left))?;
        }
        Ok(true)
    }

    /// Returns the most bytes of pairs that come at a time.
    fn piece_bytes(&self) -> u64 {
        let most = if self.storage.options.pipelining { PIECE_BYTES } else { u64::MAX };
        self.storage.max_buffer_bytes.min(most) / 8 * 8
    }

    /// Makes the buffers through which pairs of this number of bytes come.
    fn make_staging(&mut self, bytes: u64) -> Result<()> {
        let piece = self.piece_bytes();
        self.storage.ensure(BufferId::Staging(0), bytes.min(piece))?;
        let second = bytes.saturating_sub(piece).min(piece);
        if second > 0 { self.storage.ensure(BufferId::Staging(1), second) } else { Ok(()) }
    }

    /// Reads pairs of this number of words. With pipelining a piece comes while the one before is taken.
    async fn read_pairs(&mut self, words: u64) -> Result<()> {
        let piece = self.piece_bytes();
        let mut next = Some(self.fetch_pairs(0..(4 * words).min(piece), 0)?);
        let mut from = piece;
        while let Some(fetch) = next {
            let range = from..(4 * words).min(from + piece);
            let which = (from / piece) as usize % 2;
            next = if range.is_empty() { None } else { Some(self.fetch_pairs(range, which)?) };
            from += piece;
            self.receive(fetch, |session, bytes| session.append(bytemuck::cast_slice(bytes))).await?;
        }
        Ok(())
    }

    /// Copies pairs, and checks them on the way: the output of a device is untrusted input. Threads share the work.
    fn append(&mut self, pairs: &[Pair]) -> Result<()> {
        let mut clock = Clock::start();
        let boxes = self.params.boxes;
        let fault = |i| GpuError::BadPairs(format!("pair {i} of a piece is not a < b < {boxes}"));
        self.found.pairs.append_checked(pairs, boxes).map_err(fault)?;
        self.found.report.decode += clock.lap();
        Ok(())
    }
}

fn count_valid(boxes: &[Aabb]) -> u32 {
    boxes.iter().filter(|one| one.is_valid()).count() as u32
}
