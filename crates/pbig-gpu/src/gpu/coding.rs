//! The choice between records or bits and plain pairs by their size (PBIG equation 9).

use crate::Coding;
use crate::decode::pair_count;
use crate::layout::{BITS, PACKED, Params};

/// Maximum number of boxes of one cell that records can name: 2^16 segments.
const MAX_PACKED_BOXES: u32 = 1 << 24;

/// The counts of an earlier call, by which the smaller coding is chosen.
#[derive(Debug, Default)]
pub(super) struct Counted {
    /// Number of pairs.
    pub(super) pairs: u64,
    /// Number of entries in cells.
    pub(super) entries: u64,
}

impl Counted {
    /// Returns the flag of the coding that is wanted, or of the smaller one.
    pub(super) fn flag(&self, wanted: Coding, params: &Params) -> u32 {
        let has_grid = params.levels > 0;
        // Plain pairs take 8 bytes. Records took 4 to 7 a pair in the sets of `BoxSet`, and 4 an entry, which the host reads.
        let is_smaller =
            if has_grid { 2 * self.entries < self.pairs } else { bit_words(params) <= 2 * self.pairs };
        let is_packed = if wanted == Coding::Auto { is_smaller } else { wanted == Coding::Packed };
        match (is_packed, has_grid) {
            (true, false) => BITS,
            (true, true) if params.boxes < MAX_PACKED_BOXES => PACKED,
            _ => 0,
        }
    }
}

/// Returns the flag of one bit a pair if all fit a buffer of this size in bytes. The order of bits is that of the pairs.
pub(super) fn bits_that_fit(params: &Params, max_bytes: u64) -> u32 {
    if 4 * bit_words(params) <= max_bytes { BITS } else { 0 }
}

/// Returns the words of output with one bit a pair.
pub(super) fn bit_words(params: &Params) -> u64 {
    pair_count(params.boxes).div_ceil(32)
}
