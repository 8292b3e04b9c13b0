//! The choice between records or bits and plain pairs by their size (PBIG equation 9).

use super::job::Job;
use super::session::Session;
use crate::Coding;
use crate::decode::pair_count;
use crate::layout::{BITS, PACKED, Params, SORTED};

/// Maximum number of boxes of one cell that records can name: 2^16 segments.
const MAX_PACKED_BOXES: u32 = 1 << 24;

impl Session {
    /// Returns the flag of the wanted coding, or of the one that would have been smaller in the last search.
    pub(super) fn coding_flag(&self, job: &Job<'_>) -> u32 {
        let (params, sizes, has_grid) = (&self.params, &self.sizes, self.params.levels > 0);
        // Plain pairs take 8 bytes. Records took 4 to 7 a pair in the sets of `BoxSet`, and 4 an entry, which the host reads.
        let is_smaller = || match has_grid {
            true => 2 * u64::from(sizes.lists.entries) < sizes.pairs,
            false => bit_words(params) <= 2 * sizes.pairs,
        };
        let is_packed = match self.options.coding {
            // Changes are rarely so many that records or bits are smaller, and need a mark.
            _ if self.finds_changes => false,
            // One bit a pair fits the smallest buffer.
            _ if !has_grid && sizes.word_capacity > self.storage.max_buffer_bytes / 4 => true,
            // The order of bits is that of the pairs. The device sorts plain pairs only.
            Coding::Auto if job.is_sorted => !has_grid,
            Coding::Auto => is_smaller(),
            wanted => wanted == Coding::Packed,
        };
        match (is_packed, has_grid) {
            (true, false) => BITS,
            (true, true) if params.boxes < MAX_PACKED_BOXES => PACKED,
            (_, true) if job.is_sorted => SORTED,
            _ => 0,
        }
    }
}

/// Returns the words of output with one bit a pair.
pub(super) fn bit_words(params: &Params) -> u64 {
    pair_count(params.boxes).div_ceil(32)
}
