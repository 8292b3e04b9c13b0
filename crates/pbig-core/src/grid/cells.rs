//! Cells, steps and codes: the place of a box in integers.
//!
//! An axis is divided into *steps*, a few dozen to a cell. Every coordinate is rounded to a step once, in f64; cells and
//! codes come from that integer alone (contract 3). Rounding is monotone, so boxes that overlap also overlap in steps.

use crate::Aabb;

/// Coordinates in steps, an axis a lane; the fourth lane is unused.
pub(crate) type Steps = [i32; 4];

/// Maximum extent in steps of a box in the grid. With one step of rounding at each end two such boxes
/// that overlap differ by at most 2 * (62 + 2) < 256 steps, which the nine bits of a code can tell from "apart".
pub(crate) const MAX_STEPS_PER_BOX: f64 = 62.0;

/// Coordinates beyond these steps are clamped: steps must fit an `i32` with room for a window. Both ends lie in different
/// cells of a grid that wraps, so that boxes far away on different sides do not meet there.
pub(super) const MIN_STEP: f64 = -((1u32 << 29) as f64);
pub(super) const MAX_STEP: f64 = ((1u32 << 29) + 21 * 64) as f64;

/// The sign bits of a code's six fields.
pub(super) const APART: u64 = 0x1004_0100_1004_0100;

/// A code that matches no query, for slots whose box has moved away. Its two bits are never set otherwise.
pub(super) const TOMBSTONE: u64 = 1 << 30 | 1 << 62;

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
}

impl Cells {
    /// Returns the number of cells.
    pub(crate) fn count(&self) -> usize {
        self.dims.iter().map(|&dim| dim as usize).product()
    }

    /// Returns the cells by axis.
    pub(crate) fn dims(&self) -> [u32; 3] {
        self.dims.map(|dim| dim as u32)
    }

    /// Returns the lower corner of the first cell.
    pub(crate) fn origin(&self) -> [f64; 3] {
        [self.origin[0], self.origin[1], self.origin[2]]
    }

    /// Returns the edges of a cell, in the boxes' unit.
    pub(crate) fn edges(&self) -> [f32; 3] {
        std::array::from_fn(|k| (f64::from(1u32 << self.shift) / self.scale[k]) as f32)
    }

    /// Returns true for a valid box that is not oversize.
    #[inline(always)]
    pub(super) fn takes(&self, aabb: &Aabb) -> bool {
        let fits = |k: usize| {
            let extent = aabb.max[k] - aabb.min[k];
            (extent >= 0.0) & (extent <= self.max_extent[k])
        };
        fits(0) & fits(1) & fits(2)
    }

    /// Returns the cell of a point, by axis: clamped into the grid, or wrapped around.
    #[inline(always)]
    pub(super) fn cell(&self, steps: Steps) -> [i32; 3] {
        std::array::from_fn(|k| {
            let cell = steps[k] >> self.shift;
            if self.wraps { cell & (self.dims[k] - 1) } else { cell.clamp(1, self.dims[k] - 2) }
        })
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

/// Returns both corners of a box in steps, on any processor.
#[inline(always)]
pub(super) fn steps_portable(cells: &Cells, aabb: &Aabb) -> (Steps, Steps) {
    let step = |k: usize, x: f32| {
        let x = (f64::from(x) - cells.origin[k]) * cells.scale[k];
        // Comparisons rather than `clamp`, which keeps a NaN.
        let x = if x < MAX_STEP { x } else { MAX_STEP };
        let x = if x > MIN_STEP { x } else { MIN_STEP };
        round_to_i32(x)
    };
    let corner = |corner: &[f32; 3]| [step(0, corner[0]), step(1, corner[1]), step(2, corner[2]), 0];
    (corner(&aabb.min), corner(&aabb.max))
}

/// Rounds to the nearest integer, ties to even, for |x| < 2^31: the sum's lowest bits are the integer.
#[inline(always)]
fn round_to_i32(x: f64) -> i32 {
    const SHIFT: f64 = 6_755_399_441_055_744.0; // 1.5 * 2^52
    (x + SHIFT).to_bits() as i32
}

/// Returns the code of a box: `-low` and `high` on each axis, modulo 512 steps, ten bits a field.
#[inline(always)]
pub(super) fn code_portable(low: Steps, high: Steps) -> u64 {
    let field = |step: i32, k: usize| u64::from(step as u32 & 511) << (10 * k);
    let half = |of: Steps, sign: i32| {
        field(sign.wrapping_mul(of[0]), 0)
            | field(sign.wrapping_mul(of[1]), 1)
            | field(sign.wrapping_mul(of[2]), 2)
    };
    half(low, -1) | half(high, 1) << 32
}

/// Returns the query that finds the codes of boxes which overlap the box of `code`.
#[inline(always)]
pub(super) fn query_of(code: u64) -> u64 {
    code.rotate_left(32)
}
