//! The work that a way to find pairs may take before another one takes over.

use std::sync::atomic::{AtomicU64, Ordering};

/// A limit, and what all threads have spent.
#[derive(Debug)]
pub(crate) struct Budget {
    limit: u64,
    spent: AtomicU64,
}

impl Budget {
    pub(crate) fn new(limit: u64) -> Self {
        Self { limit, spent: AtomicU64::new(0) }
    }

    pub(crate) fn charge(&self, work: u64) {
        self.spent.fetch_add(work, Ordering::Relaxed);
    }

    /// Returns true if more than the limit was spent. Amounts that do not depend on threads or their order make an answer at the end
    /// that does not either: threads that stop early leave a sum above the limit.
    pub(crate) fn is_over(&self) -> bool {
        self.spent.load(Ordering::Relaxed) > self.limit
    }
}
