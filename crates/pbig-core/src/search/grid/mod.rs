//! The grid: boxes sorted by the cell of their lower corner, one entry a box.
//!
//! ```text
//! bounds ─► plan ─► build (keys, two counting sorts, codes) ─► search ─► hits (exact test) ─► pairs
//! ```
//!
//! A search visits half of each box's neighbouring cells as contiguous runs of slots, tests 64-bit codes (`cells`), and
//! tests exactly what these leave over.

pub(crate) mod bounds;
mod build;
mod cells;
mod count;
mod occupied;
mod scan;
mod spacing;
#[cfg(test)]
mod tests;

pub(super) use build::TwoGrids;
pub(crate) use cells::Cells;
pub(crate) use occupied::occupied_cells;

use super::hits::Record;
use crate::memory::{Scratch, ShrinkingVec};
use crate::simd::BLOCK;
use build::BucketCounts;

/// A grid with its buffers.
#[derive(Clone, Debug, Default)]
pub(crate) struct Grid {
    pub(crate) cells: Cells,
    /// By slot, sorted by cell; where boxes stay in buckets, by bucket. Longer than `len`.
    records: ShrinkingVec<Record>,
    /// By slot; tombstones beyond `len`, so that a block can be read anywhere. While the
    /// grid is built, and where boxes stay in buckets, the keys of the boxes.
    codes: ShrinkingVec<u64>,
    /// By cell: its first slot. Out of date where boxes stay in buckets.
    starts: ShrinkingVec<u32>,
    /// Slots in use.
    pub(crate) len: usize,
    /// Boxes of the last build, if it was since the last update.
    room: usize,
    /// Boxes too large for the cells.
    pub(crate) oversize: Vec<Record>,
    /// The records by bucket, of the last build.
    coarse: Scratch<ShrinkingVec<Record>>,
    counts: Scratch<Vec<BucketCounts>>,
    bucket_starts: Vec<u32>,
}

impl Grid {
    pub(crate) fn settle(&mut self) {
        let room = std::mem::take(&mut self.room);
        let cells = if room > 0 { self.starts.len().min(self.cells.count() + 4) } else { 0 };
        self.records.settle(room);
        self.coarse.settle(room);
        self.codes.settle(room + 2 * BLOCK);
        self.starts.settle(cells);
    }
}
