//! What a search finds, and how much more it may.

use crate::{Error, Pair};
use std::sync::atomic::{AtomicU64, Ordering};

/// Pairs as found, a buffer for each chunk, kept from call to call.
#[derive(Clone, Debug, Default)]
pub(crate) struct Found {
    pub(crate) chunks: Vec<Vec<Pair>>,
    pub(crate) checks: u64,
    /// Overlapping pairs met, whether accepted or not.
    pub(crate) overlaps: u64,
}

impl Found {
    /// Accepted pairs.
    pub(crate) fn len(&self) -> usize {
        self.chunks.iter().map(Vec::len).sum()
    }

    pub(crate) fn clear(&mut self) {
        self.chunks.iter_mut().for_each(Vec::clear);
        (self.checks, self.overlaps) = (0, 0);
    }

    /// Makes `chunks` have at least `n` buffers, all empty, and returns the first `n`.
    pub(crate) fn buffers(&mut self, n: usize) -> &mut [Vec<Pair>] {
        self.clear();
        self.chunks.resize(n.max(self.chunks.len()), Vec::new());
        &mut self.chunks[..n]
    }
}

/// How many pairs may still be found, across threads: the limit is noticed while pairs are found,
/// before memory is exhausted.
pub(crate) struct Room {
    used: AtomicU64,
    limit: u64,
}

impl Room {
    /// Pairs that a buffer gathers before it accounts for them: the counter is shared by threads,
    /// and touching it for every box would cost more than the search.
    const BATCH: usize = 4096;

    pub(crate) fn new(limit: u64) -> Self {
        Self { used: AtomicU64::new(0), limit }
    }

    /// Pairs accounted for.
    pub(crate) fn used(&self) -> u64 {
        self.used.load(Ordering::Relaxed)
    }

    /// Accounts for a buffer that has grown from `taken` to `len`; false when the limit is passed.
    #[inline(always)]
    pub(crate) fn take(&self, len: usize, taken: &mut usize) -> bool {
        if len - *taken < Self::BATCH {
            return true;
        }
        let more = (len - *taken) as u64;
        *taken = len;
        self.used.fetch_add(more, Ordering::Relaxed) + more <= self.limit
    }

    /// Whether all that was found is within the limit.
    pub(crate) fn settle(&self, found: usize) -> Result<(), Error> {
        if found as u64 > self.limit { Err(Error::TooManyPairs { limit: self.limit }) } else { Ok(()) }
    }
}
