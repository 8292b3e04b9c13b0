//! The choice between records or bits and plain pairs by their size (PBIG equation 9).

use super::session::Sizes;
use crate::Coding;
use crate::decode::pair_count;
use crate::layout::{BITS, PACKED, Params};

/// Maximum number of boxes of one cell that records can name: 2^16 segments.
const MAX_PACKED_BOXES: u32 = 1 << 24;

/// Returns the flag of the coding that is wanted, or of the one that would have been smaller in the last search.
pub(super) fn coding_flag(wanted: Coding, params: &Params, &Sizes { lists, pairs, .. }: &Sizes) -> u32 {
    let has_grid = params.levels > 0;
    // Plain pairs take 8 bytes. Records took 4 to 7 a pair in the sets of `BoxSet`, and 4 an entry, which the host reads.
    let is_smaller =
        if has_grid { 2 * u64::from(lists.entries) < pairs } else { bit_words(params) <= 2 * pairs };
    let is_packed = if wanted == Coding::Auto { is_smaller } else { wanted == Coding::Packed };
    match (is_packed, has_grid) {
        (true, false) => BITS,
        (true, true) if params.boxes < MAX_PACKED_BOXES => PACKED,
        _ => 0,
    }
}

/// Returns the words of output with one bit a pair.
pub(super) fn bit_words(params: &Params) -> u64 {
    pair_count(params.boxes).div_ceil(32)
}
