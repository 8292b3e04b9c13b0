//! Cells, steps and codes: the place of a box in integers.
//!
//! An axis is divided into *steps*, a few dozen to a cell. Every coordinate is rounded to a step once, in f64; cells and
//! codes come from that integer alone (contract 3). Rounding is monotone, so boxes that overlap also overlap in steps.

use crate::simd::{Simd, Steps};
use crate::{Aabb, NeighbourScan};

/// Maximum extent in steps of a box in the grid. With one step of rounding at each end two such boxes
/// that overlap differ by at most 2 * (62 + 2) < 256 steps, which the nine bits of a code can tell from "apart".
pub(crate) const MAX_STEPS_PER_BOX: f64 = 62.0;

/// The cells of a uniform grid.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Cells {
    /// The coordinates of step 0.
    pub(super) origin: [f64; 4],
    /// Steps in a length unit.
    pub(super) scale: [f64; 4],
    /// Extent of the largest box that the grid takes, by axis; larger ones are oversize.
    pub(super) max_extent: [f32; 3],
    /// `max_extent` in steps, rounded up.
    pub(super) reach: Steps,
    /// log2 of the steps in a cell.
    pub(super) shift: u32,
    /// Cells by axis; powers of two if they wrap.
    pub(super) dims: [i32; 3],
    /// True if the cells wrap around: the first cell follows the last. Otherwise boxes beyond the border lie in the border cells.
    pub(super) wraps: bool,
    pub(super) scan: NeighbourScan,
}

impl Cells {
    pub(crate) fn count(&self) -> usize {
        self.dims.iter().map(|&dim| dim as usize).product()
    }

    /// Returns the edges of a cell, in the boxes' unit.
    pub(crate) fn edges(&self) -> [f32; 3] {
        std::array::from_fn(|k| (f64::from(1u32 << self.shift) / self.scale[k]) as f32)
    }

    #[inline(always)]
    pub(super) fn steps(&self, simd: impl Simd, aabb: &Aabb) -> (Steps, Steps) {
        simd.steps(&self.origin, &self.scale, aabb)
    }

    /// Returns the key of a cell: its number, row by row.
    #[inline(always)]
    pub(super) fn key(&self, cell: [i32; 3]) -> u32 {
        ((cell[2] * self.dims[1] + cell[1]) * self.dims[0] + cell[0]) as u32
    }

    /// Returns the cells in which the lower corner of an overlapping box can lie. Not wrapped yet; the upper end included.
    #[inline(always)]
    pub(super) fn window(&self, low: Steps, high: Steps) -> Window {
        let bound = |k: usize, step: i32| {
            let cell = step >> self.shift;
            if self.wraps { cell } else { cell.clamp(1, self.dims[k] - 2) }
        };
        Window {
            low: std::array::from_fn(|k| bound(k, low[k] - self.reach[k])),
            high: std::array::from_fn(|k| bound(k, high[k])),
        }
    }
}

/// A range of cells by axis, both ends included.
#[derive(Clone, Copy, Debug)]
pub(super) struct Window {
    pub(super) low: [i32; 3],
    pub(super) high: [i32; 3],
}

impl Window {
    /// Shortens the window to the grid's own cells, so that a wrapped one visits no cell twice.
    pub(super) fn clipped(mut self, cells: &Cells) -> Self {
        for k in 0..3 {
            if self.high[k] - self.low[k] >= cells.dims[k] {
                (self.low[k], self.high[k]) = (0, cells.dims[k] - 1);
            }
        }
        self
    }
}
