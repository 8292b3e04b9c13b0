//! From a box to its near pairs.

use super::GONE;
use crate::Pair;
use std::ops::Range;

/// The near pairs of each box.
#[derive(Clone, Debug, Default)]
pub(super) struct Index {
    /// By id: where its entries start; one more at the end.
    pub(super) starts: Vec<u32>,
    pub(super) entries: Vec<u32>,
    /// Near pairs that it knows; later ones are walked.
    pub(super) known: usize,
}

impl Index {
    pub(super) fn range(&self, id: u32) -> Range<usize> {
        // Boxes that came later have none.
        match self.starts.get(id as usize..id as usize + 2) {
            Some(&[start, end]) if self.known > 0 => start as usize..end as usize,
            _ => 0..0,
        }
    }

    pub(super) fn of(&self, id: u32) -> &[u32] {
        &self.entries[self.range(id)]
    }

    /// Of all pairs that are not gone, by counting.
    pub(super) fn make(&mut self, pairs: &[Pair], states: &[u8], ids: usize) {
        self.known = pairs.len();
        self.starts.clear();
        self.starts.resize(ids + 1, 0);
        let near = || (0..).zip(pairs).zip(states).filter(|(_, state)| **state != GONE).map(|(pair, _)| pair);
        for (_, pair) in near() {
            self.starts[pair.a as usize] += 1;
            self.starts[pair.b as usize] += 1;
        }
        let mut sum = 0;
        for start in &mut self.starts {
            sum += *start;
            *start = sum;
        }
        let sum = sum as usize;
        if self.entries.capacity() < sum {
            self.entries = Vec::new();
            self.entries.reserve_exact(sum + sum / 8);
        }
        self.entries.resize(sum, 0);
        for (i, pair) in near() {
            for id in [pair.a, pair.b] {
                let end = &mut self.starts[id as usize];
                *end -= 1;
                self.entries[*end as usize] = i;
            }
        }
    }
}
