//! Pairs as threads find them.

use super::Grouping;
use crate::Pair;
use crate::memory::ShrinkingVec;

/// The pairs that one thread has found, and how many of each group.
#[derive(Clone, Debug, Default)]
pub(crate) struct Found {
    /// In no particular order.
    pub(crate) pairs: ShrinkingVec<Pair>,
    /// By group of `a`: pairs found. Empty if pairs are not counted by group.
    pub(super) groups: Vec<u32>,
    shift: u32,
}

impl Found {
    /// Forgets the pairs; counts the next ones by group, if there is a grouping.
    pub(crate) fn begin(&mut self, grouping: Option<Grouping>) {
        let Grouping { count, shift, .. } = grouping.unwrap_or_default();
        self.pairs.clear();
        self.groups.clear();
        self.groups.resize(count, 0);
        self.shift = shift;
    }

    /// Counts the pairs from `from` on by group.
    #[inline(always)]
    pub(crate) fn count(&mut self, from: usize) {
        if !self.groups.is_empty() {
            for pair in &self.pairs[from..] {
                self.groups[(pair.a >> self.shift) as usize] += 1;
            }
        }
    }

    /// Takes pairs that were found elsewhere, and leaves other memory for them.
    pub(crate) fn take(&mut self, pairs: &mut Vec<Pair>) {
        self.pairs.swap_list(pairs);
        self.count(0);
    }

    /// Adds pairs that were found elsewhere.
    pub(crate) fn add(&mut self, pairs: &[Pair]) {
        let from = self.pairs.len();
        self.pairs.extend_from_slice(pairs);
        self.count(from);
    }

    /// Forgets the pairs, and gives back memory if as many as `needed` are expected.
    pub(crate) fn settle(&mut self, needed: usize) {
        let needed = needed.max(self.pairs.len());
        self.pairs.clear();
        self.pairs.settle(needed);
    }
}
