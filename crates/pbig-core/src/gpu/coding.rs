//! The choice between records or bits and plain pairs by their size (PBIG equation 9).

use crate::config::Coding;
use crate::decode::pair_count;
use crate::layout::{BITS, PACKED, Params};

/// Most boxes of one cell that records can name: 2^16 segments.
const MAX_PACKED_BOXES: u32 = 1 << 24;

/// Chooses the smaller coding of the output by the sizes in earlier calls.
#[derive(Debug, Default)]
pub(super) struct CodingChoice {
    /// Number of pairs of the last chunk.
    pub(super) pairs: u64,
    is_packed: bool,
    /// Number of calls until records are tried again, after they were larger.
    wait: u32,
}

impl CodingChoice {
    /// Returns the flag of the coding that is wanted, or that is expected to be the smallest.
    pub(super) fn flag(&self, wanted: Coding, params: &Params) -> u32 {
        let has_grid = params.levels > 0;
        let is_smaller = if has_grid { self.is_packed } else { bit_words(params) <= 2 * self.pairs };
        let is_packed = if wanted == Coding::Auto { is_smaller } else { wanted == Coding::Packed };
        match (is_packed, has_grid) {
            (true, false) => BITS,
            (true, true) if params.boxes < MAX_PACKED_BOXES => PACKED,
            _ => 0,
        }
    }

    /// Notes the sizes of a call with a grid.
    ///
    /// Decoding records needs the entries, 4 bytes each. Records take 2 bytes a pair if pairs share rows, and up to 4
    /// if they do not; plain pairs take 8.
    pub(super) fn learn(&mut self, was_packed: bool, pairs: u64, words: u64, entries: u32) {
        let (plain, table) = (8 * pairs, 4 * u64::from(entries));
        self.wait = self.wait.saturating_sub(1);
        if was_packed {
            self.is_packed = 4 * words + table < plain;
            self.wait = if self.is_packed { 0 } else { 64 };
        } else {
            self.is_packed = self.wait == 0 && plain / 2 + table < plain;
        }
    }
}

/// Returns the flag of one bit a pair if all fit a buffer of so many bytes. The order of bits is that of the pairs.
pub(super) fn bits_that_fit(params: &Params, max_bytes: u64) -> u32 {
    if 4 * bit_words(params) <= max_bytes { BITS } else { 0 }
}

/// Returns the words of output with one bit a pair.
pub(super) fn bit_words(params: &Params) -> u64 {
    pair_count(params.boxes).div_ceil(32)
}
