//! The first submission of a search.

use super::GpuError;
use super::chunk::PendingChunk;
use super::commands::Groups;
use super::map;
use super::session::{Job, Session};
use super::storage::Side;
use crate::config::Coding;
use crate::layout::{BITS, Chunk, LANES, PACKED, Params};
use crate::pair_index::pair_count;
use crate::report::{Clock, GpuReport};
use pbig_shaders as shaders;

/// Most boxes of one cell that records can name: 2^16 segments.
const MAX_PACKED_BOXES: usize = 1 << 24;

/// The first submission of a search, in progress.
#[derive(Debug)]
pub(super) struct FirstSubmission {
    pub(super) params: Params,
    pub(super) chunk: PendingChunk,
}

impl Session {
    /// Uploads the boxes, and submits the first chunk: the whole search if it fits.
    pub(super) fn start(
        &mut self,
        job: &Job<'_>,
        left: u64,
        report: &mut GpuReport,
    ) -> Result<FirstSubmission, GpuError> {
        self.table = None;
        self.expected_words = std::mem::take(&mut self.max_words);
        self.word_capacity = self.expected_words;
        let mut clock = Clock::start();
        self.upload(job)?;
        report.uploaded += self.uploaded.bytes_sent;
        report.upload += clock.lap();
        let mut params = self.params(job);
        params.flags |= self.coded(job, &params);
        let chunk = match job.plan {
            Some(_) => self.submit_grid(&mut params, left)?,
            None => self.submit_all(&params, left)?,
        };
        Ok(FirstSubmission { params, chunk })
    }

    /// Returns the flag of the coding that the options ask for, or that is expected to be the smallest.
    fn coded(&self, job: &Job<'_>, params: &Params) -> u32 {
        if job.plan.is_some() {
            let packed = self.coding.packed(self.coding()) && job.input.len() < MAX_PACKED_BOXES;
            return if packed { PACKED } else { 0 };
        }
        let bits = match self.coding() {
            Coding::Auto => bit_words(params) <= 2 * self.coding.pairs,
            coding => coding == Coding::Packed,
        };
        if bits { BITS } else { 0 }
    }

    /// Submits the test of every pair.
    pub(super) fn submit_all(&mut self, params: &Params, left: u64) -> Result<PendingChunk, GpuError> {
        let all = pair_count(u64::from(params.boxes));
        let bits = params.flags & BITS != 0;
        // The last workgroup writes all of its eight words.
        let words = if bits { bit_words(params).next_multiple_of(8) } else { self.word_capacity };
        let chunk = Chunk { small_items: all.div_ceil(u64::from(LANES)) as u32, ..Chunk::default() };
        self.submit_chunk(params, chunk, Side::First, words, left, &mut |commands| {
            commands.run(&shaders::CHECK_ALL, Groups::Direct(chunk.small_items))
        })
    }

    /// Submits map, schedule and the first chunk.
    pub(super) fn submit_grid(&mut self, params: &mut Params, left: u64) -> Result<PendingChunk, GpuError> {
        self.capacities.make_buffers(&self.device, &mut self.storage, params, self.options.first_bytes)?;
        let params = &*params;
        self.submit_chunk(
            params,
            self.first_chunk(),
            Side::First,
            self.word_capacity,
            left,
            &mut |commands| {
                map::record(commands, params)?;
                commands.run(&shaders::CHECK_SMALL, Groups::Indirect(0))?;
                commands.run(&shaders::CHECK_LARGE, Groups::Indirect(12))
            },
        )
    }

    /// Returns the range of the first work items.
    pub(super) fn first_chunk(&self) -> Chunk {
        let [small_items, large_items] = self.chunk_items();
        Chunk { small_items, large_items, ..Chunk::default() }
    }
}

/// Returns the words of output with one bit a pair.
pub(super) fn bit_words(params: &Params) -> u64 {
    pair_count(u64::from(params.boxes)).div_ceil(32)
}
