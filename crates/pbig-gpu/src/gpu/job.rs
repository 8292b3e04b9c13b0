//! A job: a search of the boxes of a call, or of a part of them that fits the device.

use crate::GpuOptions;
use pbig_core::{Aabb, ProxyFilter, SearchRequest};

/// A search for all pairs.
#[derive(Clone, Copy)]
pub(super) struct Job<'a> {
    pub(super) boxes: &'a [Aabb],
    pub(super) filters: Option<&'a [ProxyFilter]>,
    /// Set in a part of a call. If not 0: only pairs of a box below this index and a box from it on are wanted.
    pub(super) split: Option<u32>,
    /// The caller wants the pairs in order.
    pub(super) is_sorted: bool,
    /// Maximum number of pairs.
    pub(super) max_pairs: u64,
}

impl<'a> Job<'a> {
    pub(super) fn all(request: &SearchRequest<'a>) -> Self {
        let &SearchRequest { boxes, filters, is_sorted, max_pairs } = request;
        Self { boxes, filters, split: None, is_sorted, max_pairs }
    }

    /// Returns true if not every pair is tested: without a grid the kernels do not know parts.
    pub(super) fn needs_grid(&self, options: &GpuOptions) -> bool {
        self.split.is_some() || self.boxes.len() > options.all_pairs_up_to as usize
    }

    /// Returns the number of valid boxes.
    pub(super) fn valid(&self) -> u32 {
        self.boxes.iter().filter(|one| one.is_valid()).count() as u32
    }
}
