//! Cell sizes: PBIG's equations 2 to 6 (Lo et al. 2013, section 4.1) and Avril's density rule
//! (Avril et al. 2012, section 4.1).

use super::Summary;
use crate::Aabb;
use crate::config::CellRule;

/// Returns the edge of the cubic cells for `n` boxes in a space, so that a cell holds `wanted` boxes by the rule.
pub(crate) fn cell_size(rule: CellRule, sample: &[Aabb], n: u32, space: [f32; 3], wanted: f32) -> f32 {
    match rule {
        CellRule::Objective => pbig_cell(sample, n, space, wanted),
        CellRule::Density => density_cell(n, space, wanted),
    }
}

/// Returns the number of cells along a length.
pub(crate) fn cells_along(length: f32, cell: f32) -> f64 {
    f64::from((length / cell).ceil().max(1.0))
}

/// Returns the number of cells of edge `cell` in a space, or under a box, of the given lengths (equations 3 and 4).
pub(crate) fn cells_in(lengths: [f32; 3], cell: f32) -> f64 {
    lengths.into_iter().map(|length| cells_along(length, cell)).product()
}

/// Returns the sample without boxes as wide as the range of all boxes, such as a ground or a half-space.
///
/// These boxes touch so many cells that they are tested against all others instead. They would also stretch the space.
pub(crate) fn ordinary(summary: &Summary) -> Vec<Aabb> {
    let widths: [f32; 3] = std::array::from_fn(|k| summary.range(k).1 - summary.range(k).0);
    let largest = widths.into_iter().fold(0.0, f32::max);
    let fits = |b: &&Aabb| b.extents().into_iter().all(|extent| extent < largest);
    let ordinary: Vec<Aabb> = summary.sample.iter().filter(fits).copied().collect();
    if ordinary.is_empty() { summary.sample.clone() } else { ordinary }
}

/// Returns the lengths and the lowest corner of the paper's space, for most of the sample.
pub(crate) fn space_of(summary: &Summary, sample: &[Aabb]) -> ([f32; 3], [f32; 3]) {
    let ranges: [(f32, f32); 3] = std::array::from_fn(|k| summary.range(k));
    let largest = |k: usize| sample.iter().map(|b| b.extents()[k]).fold(0.0, f32::max);
    let length = |k: usize| (ranges[k].1 - ranges[k].0 + largest(k)).clamp(1e-30, 1e30);
    (std::array::from_fn(length), ranges.map(|r| r.0.clamp(-1e30, 1e30)))
}

/// Returns `f = N alpha / M`, the average number of entries per cell, for cubic cells of edge `cell`
/// (equations 2 to 5). The sample gives an estimate of `alpha`, the cells that a box touches.
pub fn pbig_objective(sample: &[Aabb], n: u32, space: [f32; 3], cell: f32) -> f32 {
    let alpha = sample.iter().map(|b| cells_in(b.extents(), cell)).sum::<f64>() / sample.len().max(1) as f64;
    (f64::from(n) * alpha / cells_in(space, cell)) as f32
}

/// Returns the smallest cell with `f >= wanted` (equation 6).
///
/// As in the paper this is a binary search on the edge: `f` grows with the cell, because more boxes meet in it. With
/// fewer boxes than `wanted` the whole space is one cell.
pub fn pbig_cell(sample: &[Aabb], n: u32, space: [f32; 3], wanted: f32) -> f32 {
    let whole = space.into_iter().fold(f32::MIN_POSITIVE, f32::max);
    // The plan offers at most 1024 cells along an axis.
    let (mut low, mut high) = (whole / 1024.0, whole);
    for _ in 0..24 {
        let middle = 0.5 * (low + high);
        if pbig_objective(sample, n, space, middle) >= wanted { high = middle } else { low = middle }
    }
    high
}

/// Returns Avril's cell: a cube that holds `wanted` boxes at the density of the space. The longest axis is a whole
/// number of cells.
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
    fn density_rule_puts_the_wanted_boxes_into_a_cell_that_fits() {
        let cell = density_cell(1_000_000, [1000.0; 3], 8.0);
        assert!((cell - 20.0).abs() < 1e-3, "{cell}");
        assert_eq!(density_cell(1, [10.0, 5.0, 5.0], 1e9), 10.0);
    }
}
