//! Cells: from coordinates to integers, once (contract 3), and from those to keys.
//!
//! The grid has no bounds (contract 4). A cell is three integers `x, y, z`; its *key* is
//! `(x + y * dims.x + z * dims.x * dims.y) mod M`, `M` a power of two. Neighbours in x are
//! neighbours in memory, a row of a window is one run of entries, and what lies outside the planned
//! range wraps onto other cells, which costs tests but never a pair:
//!
//! * A box is stored once, so no pair is found in two cells.
//! * Two cells of a window never share a key: `dims.x >= 8`, `dims.y >= 8`, `M >= 8 dims.x dims.y`,
//!   and windows reach one cell to each side (or are checked against `dims`). So a pair is
//!   met at most once from each of its boxes, and from exactly one of them, because the half
//!   neighbourhood and its mirror image share no key either.
//! * Cells are computed by a monotone function of the coordinate, and a window is computed from
//!   coordinates that bound those of every overlapping box: whatever the rounding, it is inside.

use crate::Aabb;
use crate::plan::LevelPlan;

/// From coordinates to cells, in f64: no rounding within the reach of f32 is large enough to widen a
/// window, and cells far from the origin stay apart.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cells {
    origin: [f64; 3],
    inverse: [f64; 3],
    max_extent: [f64; 3],
    pub(crate) dims: [u32; 3],
    pub(crate) stride_y: u32,
    pub(crate) stride_z: u32,
    mask: u32,
}

/// Cells beyond this distance from the origin share the last one. Up to here rounding moves a
/// coordinate by less than half a thousandth of a cell, and two of them stay within the spare room of
/// [`LevelPlan::cell`].
const FARTHEST: f64 = (1u64 << 40) as f64;

impl Cells {
    pub(crate) fn new(level: &LevelPlan) -> Self {
        let [x, y, _] = level.dims;
        Self {
            origin: level.origin.map(f64::from),
            inverse: level.cell.map(|c| 1.0 / f64::from(c)),
            max_extent: level.max_extent.map(f64::from),
            dims: level.dims,
            stride_y: x,
            stride_z: x * y,
            mask: level.cells - 1,
        }
    }

    /// The cell of coordinate `x` on axis `k`: monotone in `x`, all that correctness asks of it.
    #[inline(always)]
    fn coordinate(&self, k: usize, x: f64) -> i64 {
        let scaled = (x - self.origin[k]) * self.inverse[k];
        // Comparisons that a NaN fails, unlike `clamp`, are one instruction each.
        let below = if scaled < FARTHEST { scaled } else { FARTHEST };
        let within = if below > -FARTHEST { below } else { -FARTHEST };
        // SAFETY: `within` is at least -2^40 and at most 2^40, and no NaN, by the lines above.
        unsafe { within.to_int_unchecked::<i64>() }
    }

    #[inline(always)]
    fn cell(&self, point: &[f32; 3]) -> [i64; 3] {
        std::array::from_fn(|k| self.coordinate(k, f64::from(point[k])))
    }

    /// The cell of a box, and where that cell is.
    pub(crate) fn bounds(&self, one: &Aabb) -> ([i64; 3], Aabb) {
        let cell = self.cell(&one.min);
        let corner = |i: i64, k: usize| (self.origin[k] + i as f64 / self.inverse[k]) as f32;
        let low = std::array::from_fn(|k| corner(cell[k], k));
        (cell, Aabb::new(low, std::array::from_fn(|k| corner(cell[k] + 1, k))))
    }

    /// The cells in which the lower corner of a box that overlaps `one` can lie: from where the
    /// largest box of the level would begin, to the cell of the upper corner.
    #[inline(always)]
    pub(crate) fn window(&self, one: &Aabb) -> ([i64; 3], [i64; 3]) {
        let lowest = |k: usize| f64::from(one.min[k]) - self.max_extent[k];
        (std::array::from_fn(|k| self.coordinate(k, lowest(k))), self.cell(&one.max))
    }

    /// Where a box of the level is stored, and its window.
    #[inline(always)]
    pub(crate) fn place(&self, one: &Aabb) -> (u32, Span) {
        let cell = self.cell(&one.min);
        let (low, high) = self.window(one);
        (self.key(cell), Span::new(low, cell, high))
    }

    #[inline(always)]
    pub(crate) fn key(&self, cell: [i64; 3]) -> u32 {
        // Truncation to 32 bits is a remainder too, by a multiple of M.
        let y = (cell[1] as u32).wrapping_mul(self.stride_y);
        let z = (cell[2] as u32).wrapping_mul(self.stride_z);
        self.wrap((cell[0] as u32).wrapping_add(y).wrapping_add(z))
    }

    #[inline(always)]
    pub(crate) fn wrap(&self, key: u32) -> u32 {
        key & self.mask
    }
}

/// Whether a box's window reaches into the next cell, down and up, a bit each: it never reaches
/// further, because no box of the level is as large as a cell. The half neighbourhood needs no
/// lower z.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Span(u8);

impl Span {
    #[inline(always)]
    fn new(low: [i64; 3], cell: [i64; 3], high: [i64; 3]) -> Self {
        let [down_x, down_y] = [cell[0] - low[0], cell[1] - low[1]];
        let [up_x, up_y, up_z] = [high[0] - cell[0], high[1] - cell[1], high[2] - cell[2]];
        let fields = [down_x, down_y, up_x, up_y, up_z];
        debug_assert!(fields.iter().all(|f| (0..=1).contains(f)), "window too wide: {fields:?}");
        Self(fields.iter().enumerate().fold(0, |bits, (i, &f)| bits | (f as u8) << i))
    }

    #[inline(always)]
    fn field(self, i: u32) -> u32 {
        u32::from(self.0 >> i & 1)
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
            camp: 0,
        })
    }

    #[test]
    fn cells_are_monotone_and_finite_for_every_float() {
        let cells = cells(0.3, -7.0);
        let mut floats: Vec<f32> =
            (0..=u16::MAX).map(|high| f32::from_bits(u32::from(high) << 16 | 0x1234)).collect();
        floats.retain(|x| !x.is_nan());
        floats.sort_unstable_by(f32::total_cmp);
        let found: Vec<i64> = floats.iter().map(|&x| cells.cell(&[x; 3])[0]).collect();
        assert!(found.is_sorted());
        assert_eq!((found[0], found[found.len() - 1]), (-(1 << 40), 1 << 40));
        assert_eq!(cells.cell(&[f32::NAN; 3])[0], 1 << 40);
    }

    #[test]
    fn windows_reach_one_cell_at_most_wherever_and_however_small_the_cells() {
        for cell in [1e-20f32, 1e-3, 0.3, 1.0, 777.0, 1e20] {
            for scale in [0.0f32, 1.0, 1e3, 1e6, 1e9, 1e12] {
                let cells = cells(cell, 0.1 * scale * cell);
                for i in 0..2000 {
                    let min = (i as f32 * 0.377 - 300.0) * scale * cell;
                    let one = Aabb::new([min; 3], [min + cell / 1.0011 * (i % 7) as f32 / 6.0; 3]);
                    if one.extents()[0] <= cell / 1.001 {
                        let ((low, high), own) = (cells.window(&one), cells.cell(&one.min));
                        let reach = (own[0] - low[0]).max(high[0] - own[0]);
                        assert!((0..=1).contains(&reach), "{reach}: cell {cell}, box {one:?}");
                    }
                }
            }
        }
    }
}
