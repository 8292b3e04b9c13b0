//! The choice between records or bits and plain pairs.

use super::job::Job;
use super::session::Session;
use crate::decode::pair_count;
use crate::layout::{BITS, PACKED, Params, SORTED};
use crate::{Coding, GpuOptions};

/// Maximum number of boxes of which a bit for each pair is sent, 64 kB, however few pairs there are.
const FEW_BOXES: u32 = GpuOptions::DEFAULT.all_pairs_up_to;

/// Maximum number of boxes of one cell that records can name: 2^16 segments.
const MAX_PACKED_BOXES: u32 = 1 << 24;

impl Session {
    /// Returns the flag of the coding.
    pub(super) fn coding_flag(&self, job: &Job<'_>) -> u32 {
        let (sizes, has_grid) = (&self.sizes, self.params.levels > 0);
        let is_packed = match self.options.coding {
            // One bit a pair fits the smallest buffer.
            _ if !has_grid && sizes.word_capacity > self.storage.max_buffer_bytes / 4 => true,
            // Records save transfers, and cost the host more: on an H100 115 ms became 352 for 115 million pairs.
            // The order of bits is that of the pairs, and those of few boxes are few.
            Coding::Auto => !has_grid && (job.is_sorted || self.params.boxes <= FEW_BOXES),
            wanted => wanted == Coding::Packed,
        };
        match (is_packed, has_grid) {
            (true, false) => BITS,
            (true, true) if self.params.boxes < MAX_PACKED_BOXES => PACKED,
            (_, true) if job.is_sorted => SORTED,
            _ => 0,
        }
    }
}

/// Returns the words of output with one bit a pair.
pub(super) fn bit_words(params: &Params) -> u64 {
    pair_count(params.boxes).div_ceil(32)
}
