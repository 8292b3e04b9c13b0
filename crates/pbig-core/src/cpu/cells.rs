//! Cells: from coordinates to integers, once (contract 3), and from those to keys.
//!
//! The grid has no bounds (contract 4). A cell is three integers `x, y, z`; its *key* is
//! `(x + y * dims.x + z * dims.x * dims.y) mod M`, `M` a power of two. Neighbours in x are
//! neighbours in memory, a row of a window is one run of entries, and what lies outside the planned
//! range wraps onto other cells, which costs tests but never a pair:
//!
//! * A box is stored once, so no pair is found in two cells.
//! * Two cells of a window never share a key: `dims.x >= 8`, `dims.y >= 8`, `M >= 8 dims.x dims.y`,
//!   and windows reach at most 3 cells to each side (or are checked against `dims`). So a pair is
//!   met at most once from each of its boxes, and from exactly one of them, because the half
//!   neighbourhood and its mirror image share no key either.
//! * Cells are computed by a monotone function of the coordinate, and a window is computed from
//!   coordinates that bound those of every overlapping box: whatever the rounding, it is inside.

use crate::Aabb;
use crate::plan::LevelPlan;

/// From coordinates to cells, four lanes at a time (the last one idle).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cells {
    origin: [f32; 4],
    inverse: [f32; 4],
    max_extent: [f32; 4],
    pub(crate) dims: [u32; 3],
    pub(crate) stride_y: u32,
    pub(crate) stride_z: u32,
    mask: u32,
}

/// Cells beyond this distance from the origin share the last one. Up to here rounding moves a
/// coordinate by less than a fifth of a cell, which keeps windows within 3 cells.
const FARTHEST: f32 = (1 << 20) as f32;

fn four(v: &[f32; 3]) -> [f32; 4] {
    [v[0], v[1], v[2], 0.0]
}

impl Cells {
    pub(crate) fn new(level: &LevelPlan) -> Self {
        let [x, y, _] = level.dims;
        Self {
            origin: four(&level.origin),
            inverse: four(&level.cell.map(|c| 1.0 / c)),
            max_extent: four(&level.max_extent),
            dims: level.dims,
            stride_y: x,
            stride_z: x * y,
            mask: level.cells - 1,
        }
    }

    /// The cell of a point: monotone on each axis, all that correctness asks of it.
    #[inline(always)]
    fn cell(&self, point: &[f32; 4]) -> [i32; 4] {
        std::array::from_fn(|k| {
            let scaled = (point[k] - self.origin[k]) * self.inverse[k];
            // Comparisons that a NaN fails, unlike `clamp`, are one instruction each.
            let below = if scaled < FARTHEST { scaled } else { FARTHEST };
            let within = if below > -FARTHEST { below } else { -FARTHEST };
            // SAFETY: `within` is at least -2^20 and at most 2^20, and no NaN, by the lines above.
            unsafe { within.to_int_unchecked::<i32>() }
        })
    }

    /// The cells in which the lower corner of a box that overlaps `one` can lie: from where the
    /// largest box of the level would begin, to the cell of the upper corner.
    #[inline(always)]
    pub(crate) fn window(&self, one: &Aabb) -> ([i32; 4], [i32; 4]) {
        (self.cell(&self.lowest(one)), self.cell(&four(&one.max)))
    }

    #[inline(always)]
    fn lowest(&self, one: &Aabb) -> [f32; 4] {
        let min = four(&one.min);
        std::array::from_fn(|k| min[k] - self.max_extent[k])
    }

    /// Where a box of the level is stored, and its window.
    #[inline(always)]
    pub(crate) fn place(&self, one: &Aabb) -> (u32, Span) {
        let cell = self.cell(&four(&one.min));
        let (low, high) = self.window(one);
        (self.key(cell), Span::new(low, cell, high))
    }

    #[inline(always)]
    pub(crate) fn key(&self, cell: [i32; 4]) -> u32 {
        let y = (cell[1] as u32).wrapping_mul(self.stride_y);
        let z = (cell[2] as u32).wrapping_mul(self.stride_z);
        self.wrap((cell[0] as u32).wrapping_add(y).wrapping_add(z))
    }

    #[inline(always)]
    pub(crate) fn wrap(&self, key: u32) -> u32 {
        key & self.mask
    }
}

/// How far a box's window reaches from the cell of its lower corner, in cells, 0 to 3 each. The half
/// neighbourhood needs no lower z.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Span(u16);

impl Span {
    #[inline(always)]
    fn new(low: [i32; 4], cell: [i32; 4], high: [i32; 4]) -> Self {
        let [down_x, down_y] = [cell[0] - low[0], cell[1] - low[1]];
        let up: [i32; 3] = std::array::from_fn(|k| high[k] - cell[k]);
        let fields = [down_x, down_y, up[0], up[1], up[2]];
        debug_assert!(fields.iter().all(|f| (0..=Self::WIDEST).contains(f)), "window too wide");
        Self(fields.iter().enumerate().fold(0, |bits, (i, &f)| bits | ((f & 3) as u16) << (2 * i)))
    }

    /// Cells that a window reaches to each side at most: `max_extent` is below a cell, rounding adds
    /// less than two (see `FARTHEST`; subtracting an extent near an ulp can double it).
    pub(crate) const WIDEST: i32 = 3;

    /// Whether no side reaches further than one cell, as nearly always.
    #[inline(always)]
    pub(crate) fn is_narrow(self) -> bool {
        self.0 & 0b10_1010_1010 == 0
    }

    #[inline(always)]
    fn field(self, i: u32) -> u32 {
        u32::from(self.0 >> (2 * i) & 3)
    }

    pub(crate) fn down_x(self) -> u32 {
        self.field(0)
    }

    pub(crate) fn down_y(self) -> u32 {
        self.field(1)
    }

    pub(crate) fn up_x(self) -> u32 {
        self.field(2)
    }

    pub(crate) fn up_y(self) -> u32 {
        self.field(3)
    }

    pub(crate) fn up_z(self) -> u32 {
        self.field(4)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cells(cell: f32, origin: f32) -> Cells {
        Cells::new(&LevelPlan {
            boxes: 1,
            classes: (0, 0),
            max_extent: [cell / 1.001; 3],
            cell: [cell; 3],
            origin: [origin; 3],
            dims: [8; 3],
            cells: 512,
        })
    }

    #[test]
    fn cells_are_monotone_and_finite_for_every_float() {
        let cells = cells(0.3, -7.0);
        let mut floats: Vec<f32> =
            (0..=u16::MAX).map(|high| f32::from_bits(u32::from(high) << 16 | 0x1234)).collect();
        floats.retain(|x| !x.is_nan());
        floats.sort_unstable_by(f32::total_cmp);
        let found: Vec<i32> = floats.iter().map(|&x| cells.cell(&[x; 4])[0]).collect();
        assert!(found.is_sorted());
        assert_eq!((found[0], found[found.len() - 1]), (-(1 << 20), 1 << 20));
        assert_eq!(cells.cell(&[f32::NAN; 4])[0], 1 << 20);
    }

    #[test]
    fn windows_reach_at_most_three_cells_wherever_and_however_small_the_cells() {
        for cell in [1e-20f32, 1e-3, 0.3, 1.0, 777.0, 1e20] {
            for scale in [0.0f32, 1.0, 1e3, 1e6, 1e9, 1e30] {
                let cells = cells(cell, 0.1 * scale * cell);
                for i in 0..2000 {
                    let min = (i as f32 * 0.377 - 300.0) * scale * cell;
                    let one = Aabb::new([min; 3], [min + cell / 1.0011 * (i % 7) as f32 / 6.0; 3]);
                    if one.extents()[0] <= cell / 1.001 {
                        let (low, high) = cells.window(&one);
                        let own = cells.cell(&[min; 4]);
                        let reach = (own[0] - low[0]).max(high[0] - own[0]);
                        assert!((0..=Span::WIDEST).contains(&reach), "{reach}: cell {cell}, box {one:?}");
                    }
                }
            }
        }
    }
}
