//! The choice between records and plain pairs by their size (PBIG equation 9).

use crate::config::Coding;

/// Chooses the smaller coding of the output by the sizes in earlier calls.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct CodingChoice {
    /// Number of pairs of the last chunk.
    pub(super) pairs: u64,
    is_packed: bool,
    /// Number of calls until records are tried again, after they were larger.
    wait: u32,
}

impl CodingChoice {
    /// Returns true if the next call should write records.
    pub(super) fn packed(&self, wanted: Coding) -> bool {
        match wanted {
            Coding::Auto => self.is_packed,
            coding => coding == Coding::Packed,
        }
    }

    /// Notes the sizes of a call.
    ///
    /// Decoding records needs the entries, 4 bytes each. Records take 2 bytes a pair if pairs share rows, and up to 4
    /// if they do not; plain pairs take 8.
    pub(super) fn learn(&mut self, packed: bool, pairs: u64, words: u64, entries: u32) {
        let (plain, table) = (8 * pairs, 4 * u64::from(entries));
        self.wait = self.wait.saturating_sub(1);
        if packed {
            self.is_packed = 4 * words + table < plain;
            self.wait = if self.is_packed { 0 } else { 64 };
        } else {
            self.is_packed = self.wait == 0 && plain / 2 + table < plain;
        }
    }
}
