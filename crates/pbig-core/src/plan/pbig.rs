//! PBIG's cell size (Lo et al. 2013, section 4.1, equations 2 to 6) and Avril's density rule
//! (Avril et al. 2012, section 4.1).

use super::Summary;
use crate::Aabb;
use crate::config::{CellRule, Config};
use std::fmt;

/// The grid of [`crate::Strategy::Pbig`]: one entry for each cell that a box touches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PbigPlan {
    /// Edge of the cubic cells, in the boxes' length unit.
    pub cell: f32,
    /// Where cell 0 begins, in the boxes' length unit.
    pub origin: [f32; 3],
    /// Cells on each axis; boxes beyond are clamped into the border cells.
    pub dims: [u32; 3],
    /// Cells that a box may touch before it is tested against all instead.
    pub max_cells_per_box: u32,
    /// `f` of equation 2 at this cell size: average entries per cell.
    pub objective: f32,
}

impl fmt::Display for PbigPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y, z] = self.dims;
        write!(f, "{x} x {y} x {z} cells of {}, f = {} entries a cell", self.cell, self.objective)
    }
}

impl PbigPlan {
    /// Solves equation 6 on the summary's sample, or applies the density rule.
    pub fn new(summary: &Summary, config: &Config) -> Self {
        let sample = ordinary(summary);
        let (space, origin) = space_of(summary, &sample);
        let wanted = config.gpu.boxes_per_cell.max(1.0);
        let n = summary.valid;
        let mut cell = match config.gpu.cell_rule {
            CellRule::Objective => pbig_cell(&sample, n, space, wanted),
            CellRule::Density => density_cell(n, space, wanted),
        };
        // Oversize boxes in the sample raise alpha, and with it f, whatever the cell: the search
        // would end at a billion cells for a handful of boxes.
        while cells_in(space, cell) > f64::from(n.max(64)) * MAX_CELLS_PER_BOX {
            cell *= 1.25;
        }
        let dims = space.map(|length| cells_along(length, cell) as u32);
        let objective = pbig_objective(&sample, n, space, cell);
        Self { cell, origin, dims, max_cells_per_box: 512, objective }
    }
}

/// Cells in all, per box: beyond, empty cells cost more than full ones.
const MAX_CELLS_PER_BOX: f64 = 4.0;

fn cells_along(length: f32, cell: f32) -> f64 {
    f64::from((length / cell).ceil().max(1.0))
}

/// Equations 3 and 4: cells of edge `cell` in a space, or under a box, of the given lengths.
fn cells_in(lengths: [f32; 3], cell: f32) -> f64 {
    lengths.into_iter().map(|length| cells_along(length, cell)).product()
}

/// The sample without boxes as wide as the range of all of them, a ground or a half-space: they touch
/// so many cells that they are tested against all instead, and would stretch the space and its cells.
pub(super) fn ordinary(summary: &Summary) -> Vec<Aabb> {
    let widths: [f32; 3] = std::array::from_fn(|k| summary.range(k).1 - summary.range(k).0);
    let largest = widths.into_iter().fold(0.0, f32::max);
    let fits = |b: &&Aabb| b.extents().into_iter().all(|extent| extent < largest);
    let ordinary: Vec<Aabb> = summary.sample.iter().filter(fits).copied().collect();
    if ordinary.is_empty() { summary.sample.clone() } else { ordinary }
}

/// The space of the paper: from the lowest corner to the highest, of most of the sample.
pub(super) fn space_of(summary: &Summary, sample: &[Aabb]) -> ([f32; 3], [f32; 3]) {
    let ranges: [(f32, f32); 3] = std::array::from_fn(|k| summary.range(k));
    let largest = |k: usize| sample.iter().map(|b| b.extents()[k]).fold(0.0, f32::max);
    let length = |k: usize| (ranges[k].1 - ranges[k].0 + largest(k)).clamp(1e-30, 1e30);
    (std::array::from_fn(length), ranges.map(|r| r.0.clamp(-1e30, 1e30)))
}

/// `f = N alpha / M`, the average number of entries per cell, for cubic cells of edge `cell`
/// (equations 2 to 5, `alpha` estimated from the sample).
pub fn pbig_objective(sample: &[Aabb], n: u32, space: [f32; 3], cell: f32) -> f32 {
    let alpha = sample.iter().map(|b| cells_in(b.extents(), cell)).sum::<f64>() / sample.len().max(1) as f64;
    (f64::from(n) * alpha / cells_in(space, cell)) as f32
}

/// The smallest cell with `f >= wanted` (equation 6), by a binary search on its edge as the paper
/// does: `f` grows with the cell, because more boxes meet in it. With fewer boxes than `wanted`,
/// one cell for the whole space.
pub fn pbig_cell(sample: &[Aabb], n: u32, space: [f32; 3], wanted: f32) -> f32 {
    let whole = space.into_iter().fold(f32::MIN_POSITIVE, f32::max);
    // Smallest cell worth trying: 1024 to an axis, the most that the plan offers.
    let (mut low, mut high) = (whole / 1024.0, whole);
    for _ in 0..24 {
        let middle = 0.5 * (low + high);
        if pbig_objective(sample, n, space, middle) >= wanted { high = middle } else { low = middle }
    }
    high
}

/// Avril's rule: the cubic cell in which `wanted` objects are expected at the density of the
/// environment, refined so that cells fit it exactly on its longest axis.
pub fn density_cell(n: u32, space: [f32; 3], wanted: f32) -> f32 {
    let volume: f64 = space.into_iter().map(f64::from).product();
    let ideal = (f64::from(wanted) * volume / f64::from(n.max(1))).cbrt();
    let longest = f64::from(space.into_iter().fold(0.0, f32::max));
    let count = (longest / ideal).floor().max(1.0);
    (longest / count) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cubes(n: usize, edge: f32) -> Vec<Aabb> {
        vec![Aabb::new([0.0; 3], [edge; 3]); n]
    }

    #[test]
    fn objective_by_hand() {
        // 10^3 boxes of edge 15 in 100^3, cells of 10: M = 1000, alpha = 2^3, f = 8.
        assert_eq!(pbig_objective(&cubes(10, 15.0), 1000, [100.0; 3], 10.0), 8.0);
    }

    #[test]
    fn the_constraint_holds_and_a_smaller_cell_would_break_it() {
        let (sample, space) = (cubes(1000, 50.0), [1e4; 3]);
        for wanted in [2.0, 8.0, 32.0] {
            let cell = pbig_cell(&sample, 1_000_000, space, wanted);
            let f = |cell| pbig_objective(&sample, 1_000_000, space, cell);
            assert!(f(cell) >= wanted && f(cell * 0.98) < wanted, "W = {wanted}: cell {cell}");
        }
    }

    #[test]
    fn too_few_boxes_for_the_constraint_get_one_cell() {
        let cell = pbig_cell(&cubes(5, 1.0), 5, [100.0; 3], 32.0);
        assert!((cell - 100.0).abs() < 1e-3, "{cell}");
    }

    #[test]
    fn a_ground_under_a_pile_does_not_enlarge_the_cells() {
        let at = |i: u32| [i % 10, i / 10 % 10, i / 100].map(|c| c as f32 * 2.0);
        let mut boxes: Vec<Aabb> = (0..999).map(|i| Aabb::from_center(at(i), [0.5; 3])).collect();
        for half in [1e3, 1e6, 0.5 * f32::MAX] {
            boxes.push(Aabb::from_center([0.0; 3], [half; 3]));
            let plan = PbigPlan::new(&Summary::of(&boxes, None), &Config::DEFAULT);
            assert!(plan.cell < 10.0, "ground of {half}: {plan}");
        }
    }

    #[test]
    fn density_rule_puts_the_wanted_objects_into_a_cell_that_fits() {
        let cell = density_cell(1_000_000, [1000.0; 3], 8.0);
        assert!((cell - 20.0).abs() < 1e-3, "{cell}");
        assert_eq!(density_cell(1, [10.0, 5.0, 5.0], 1e9), 10.0);
    }
}
