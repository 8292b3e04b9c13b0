//! The first submission of a search.

use super::GpuError;
use super::commands::Groups;
use super::flight::Flight;
use super::map;
use super::session::{Job, Session};
use crate::config::Coding;
use crate::layout::{BITS, Chunk, LANES, PACKED, Params};
use crate::pair_index::pair_count;
use crate::report::{GpuReport, lap};
use pbig_shaders as shaders;
use std::time::Instant;

/// Boxes of one cell that records can name: 2^16 segments.
const MOST_PACKED: usize = 1 << 24;

/// The first submission of a search, on its way.
#[derive(Debug)]
pub(super) struct First {
    pub(super) params: Params,
    pub(super) flight: Flight,
}

impl Session {
    /// Sends what the device does not have, and submits the first chunk: all of it where it fits.
    pub(super) fn start(
        &mut self,
        job: &Job<'_>,
        left: u64,
        report: &mut GpuReport,
    ) -> Result<First, GpuError> {
        self.table = None;
        self.words = std::mem::take(&mut self.most_words);
        self.word_room = self.words;
        let mut clock = Instant::now();
        self.upload(job)?;
        report.uploaded += self.mirror.sent;
        report.upload += lap(&mut clock);
        let mut params = self.params(job);
        params.flags |= self.coded(job, &params);
        let flight = match job.plan {
            Some(_) => self.launch_grid(&mut params, left)?,
            None => self.launch_all(&params, left)?,
        };
        Ok(First { params, flight })
    }

    /// The flag of the output that is expected to be smallest, or is asked for.
    fn coded(&self, job: &Job<'_>, params: &Params) -> u32 {
        if job.plan.is_some() {
            let packed = self.coding.packed(self.coding()) && job.input.len() < MOST_PACKED;
            return if packed { PACKED } else { 0 };
        }
        let bits = match self.coding() {
            Coding::Auto => bit_words(params) <= 2 * self.coding.pairs,
            coding => coding == Coding::Packed,
        };
        if bits { BITS } else { 0 }
    }

    /// Every pair is tested.
    pub(super) fn launch_all(&mut self, params: &Params, left: u64) -> Result<Flight, GpuError> {
        let all = pair_count(u64::from(params.boxes));
        let bits = params.flags & BITS != 0;
        // The last workgroup writes all its words.
        let words = if bits { bit_words(params).next_multiple_of(8) } else { self.word_room };
        let chunk = Chunk { small_items: all.div_ceil(u64::from(LANES)) as u32, ..Chunk::default() };
        self.launch(params, chunk, 0, words, left, &mut |commands| {
            commands.run(&shaders::CHECK_ALL, Groups::Direct(chunk.small_items))
        })
    }

    /// Map, schedule and the first chunk.
    pub(super) fn launch_grid(&mut self, params: &mut Params, left: u64) -> Result<Flight, GpuError> {
        self.room.make(&self.engine, &mut self.storage, params, self.options.first_bytes)?;
        let params = &*params;
        self.launch(params, self.first_chunk(), 0, self.word_room, left, &mut |commands| {
            map::record(commands, params)?;
            commands.run(&shaders::CHECK_SMALL, Groups::Indirect(0))?;
            commands.run(&shaders::CHECK_LARGE, Groups::Indirect(12))
        })
    }

    pub(super) fn first_chunk(&self) -> Chunk {
        let [small_items, large_items] = self.chunk();
        Chunk { small_items, large_items, ..Chunk::default() }
    }
}

/// Words of output with one bit a pair.
pub(super) fn bit_words(params: &Params) -> u64 {
    pair_count(u64::from(params.boxes)).div_ceil(32)
}
