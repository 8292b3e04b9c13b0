//! Records or plain pairs, whichever are smaller (PBIG equation 9).

use crate::config::Coding;

/// Whether records would be smaller than plain pairs, by what the calls before have shown.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct CodingChoice {
    /// Pairs of the last chunk.
    pub(super) pairs: u64,
    packed: bool,
    /// Calls until records are tried again after they turned out larger.
    wait: u32,
}

impl CodingChoice {
    pub(super) fn packed(&self, wanted: Coding) -> bool {
        match wanted {
            Coding::Auto => self.packed,
            coding => coding == Coding::Packed,
        }
    }

    /// Records need the entries for decoding, 4 bytes each, and take a quarter of 8 bytes a pair where
    /// pairs share rows, up to half of it where they do not.
    pub(super) fn learn(&mut self, packed: bool, pairs: u64, words: u64, entries: u32) {
        let (plain, table) = (8 * pairs, 4 * u64::from(entries));
        self.wait = self.wait.saturating_sub(1);
        if packed {
            self.packed = 4 * words + table < plain;
            self.wait = if self.packed { 0 } else { 64 };
        } else {
            self.packed = self.wait == 0 && plain / 2 + table < plain;
        }
    }
}
