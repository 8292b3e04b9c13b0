//! The GPU's grid: PBIG's cells (section 4.1), one size for each level of boxes.
//!
//! A level's cells are a power of two times those of the finest level. So a device computes the cells of a box once and
//! shifts integers to get those of every level (contract 3). The last level has a single cell: there the boxes without
//! a level of their own are tested against all others, once (contract 4).

use super::levels::{SizeRange, levels};
use super::ticks::Ticks;
use crate::layout::{FEWEST_CELLS, Level, MAX_LEVELS, MAX_SPAN, Params};
use crate::pbig::{Summary, density_cell, ordinary, pbig_cell, space_of};
use pbig_core::{Aabb, internal::size_class_of};
use std::fmt;

/// Maximum number of cells of a level per box. With more cells, the scan costs more than full cells do.
const CELLS_PER_BOX: f64 = 4.0;
/// Number of cells that every level may have, however few its boxes.
const MIN_CELLS_PER_LEVEL: f64 = 4096.0;
/// Largest mean number of other boxes in a box's cell, as a multiple of the wanted boxes per cell. Above it the cell is
/// halved.
const OCCUPANCY_LIMIT: f64 = 4.0;
/// Fewest pairs of sampled boxes in one cell that count: a single coincidence would stand for many boxes.
const FEWEST_SAMPLED_PAIRS: usize = 16;
/// Maximum number of doublings from the finest cells to those of a level.
const MAX_SHIFT: u32 = 28;

/// The levels and cells of a search on a GPU.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct GpuPlan {
    /// Edge of the cells of the finest level, in the boxes' length unit.
    pub(super) cell: f32,
    /// The kernels' parameters of the grid; others are 0. Levels, finest first: the last has one cell.
    pub(super) params: Params,
}

/// `4097 cells, 16 x 16 x 16 of 1.5`.
impl fmt::Display for GpuPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Params { cells, levels, level, .. } = &self.params;
        write!(f, "{cells} cells")?;
        for level in &level[..*levels as usize - 1] {
            let [x, y, z] = level.dims;
            write!(f, ", {x} x {y} x {z} of {}", f64::from(self.cell) * f64::from(level.shift).exp2())?;
        }
        Ok(())
    }
}

impl GpuPlan {
    /// Plans the grid for the boxes behind `summary`, with at most `max_cells` cells.
    ///
    /// A cell has about `wanted` boxes. `cell_factor` scales the cells: 1, or less where earlier cells held too many boxes.
    pub(super) fn new(summary: &Summary, wanted: f32, cell_factor: f32, max_cells: u32) -> Self {
        let split = levels(summary);
        // The coarsest levels are kept if there are too many: finer boxes then share the first of these.
        let split = &split[split.len().saturating_sub(MAX_LEVELS - 1)..];
        let (space, low) = space_of(summary, &ordinary(summary));
        let edges = split.iter().map(|level| edge(level, summary, space, wanted.max(1.0), cell_factor));
        let edges: Vec<f64> = edges.collect();
        let finest = edges.first().copied().unwrap_or(1.0);
        let Ticks { exponent, cells_per_tick, cell } = Ticks::new(finest, reach(space, low));
        let params = Params { tick_exponent: exponent, cells_per_tick, ..Params::default() };
        let mut plan = Self { cell: cell as f32, params };
        for (shift, level) in shifts(&edges, split, cell) {
            let share = max_cells.saturating_sub(1) / split.len().max(1) as u32;
            let most =
                (f64::from(level.all.boxes) * CELLS_PER_BOX).max(MIN_CELLS_PER_LEVEL).min(f64::from(share));
            plan.push(dims(space, cell * f64::from(shift).exp2(), most), shift);
        }
        plan.push([1; 3], 0);
        plan
    }

    fn push(&mut self, dims: [u32; 3], shift: u32) {
        let params = &mut self.params;
        let level = Level { dims, shift, first_cell: params.cells, unused: [0; 3] };
        params.level[params.levels as usize] = level;
        params.levels += 1;
        params.cells += dims.iter().product::<u32>();
    }

    /// Returns true if these parameters have this grid.
    pub(super) fn is_in(&self, params: &Params) -> bool {
        let of = |it: &Params| (it.tick_exponent, it.cells_per_tick, it.level);
        of(params) == of(&self.params)
    }
}

/// Returns the cell size of a level: by equation 6 on its boxes alone, but such that its largest box touches few
/// cells on each axis.
fn edge(level: &SizeRange, summary: &Summary, space: [f32; 3], wanted: f32, cell_factor: f32) -> f64 {
    let of_level = |b: &&Aabb| (level.classes.0..=level.classes.1).contains(&size_class_of(b.extents()));
    let sample: Vec<Aabb> = summary.sample.iter().filter(of_level).copied().collect();
    let cell = if sample.is_empty() {
        density_cell(level.all.boxes, space, wanted)
    } else {
        // A quarter of the sample is enough: equation 6 is evaluated on it 24 times.
        let quarter: Vec<Aabb> = sample.iter().step_by(4).copied().collect();
        pbig_cell(&quarter, level.all.boxes, space, wanted)
    };
    let largest = level.all.extent.into_iter().fold(0.0, f32::max);
    // A box crosses at most one border more than it has cell lengths, and one more by rounding.
    let smallest = f64::from(largest) * 1.001 / f64::from(MAX_SPAN - 2);
    let most = OCCUPANCY_LIMIT * f64::from(wanted);
    let even = f64::from(cell) * f64::from(cell_factor);
    with_limited_occupancy(&sample, level.all.boxes, even, smallest, most).max(smallest)
}

/// Returns a cell size at which a box has at most `most` other boxes in its cell, as the sample tells.
///
/// Equation 6 knows the average cell only. If boxes lie in clusters far apart, most cells are empty and the others hold
/// a cluster each; so the cell is halved. It stops where the smallest cell would hold hardly fewer boxes: no cell
/// separates identical boxes.
fn with_limited_occupancy(sample: &[Aabb], boxes: u32, even: f64, smallest: f64, most: f64) -> f64 {
    let mut cell = even;
    let (now, sampled_pairs) = occupancy(sample, boxes, cell);
    if now <= most || sampled_pairs < FEWEST_SAMPLED_PAIRS {
        return cell;
    }
    let smallest = smallest.max(even * 2f64.powi(-30));
    let goal = most.max(1.25 * occupancy(sample, boxes, smallest).0);
    while cell > smallest && occupancy(sample, boxes, cell).0 > goal {
        cell /= 2.0;
    }
    cell
}

/// Returns an estimate of the mean number of other boxes in the cell of a box's lower corner, and the number of pairs
/// of sampled boxes that share a cell.
fn occupancy(sample: &[Aabb], boxes: u32, cell: f64) -> (f64, usize) {
    let of = |b: &Aabb| b.min.map(|x| (f64::from(x) / cell).floor() as i64);
    let mut cells: Vec<[i64; 3]> = sample.iter().map(of).collect();
    cells.sort_unstable();
    let others = cells.chunk_by(|a, b| a == b).map(|same| same.len() * (same.len() - 1)).sum::<usize>();
    let n = sample.len().max(1) as f64;
    (others as f64 / n * (f64::from(boxes) / n), others)
}

/// Returns the largest distance from zero, on an axis, of most boxes.
fn reach(space: [f32; 3], low: [f32; 3]) -> f64 {
    let ends = low.into_iter().zip(space).flat_map(|(low, length)| [low, low + length]);
    ends.map(|x| f64::from(x).abs()).fold(0.0, f64::max)
}

/// Returns for each level the number of doublings from the finest cell to its cells. Levels of equal cells are joined. Levels so
/// coarse that the finest cells would not span the space are left out.
fn shifts<'a>(edges: &[f64], levels: &'a [SizeRange], finest: f64) -> Vec<(u32, &'a SizeRange)> {
    let mut shifts: Vec<(u32, &SizeRange)> = Vec::new();
    for (edge, level) in edges.iter().zip(levels) {
        let shift = (edge / finest).log2().ceil().max(0.0) as u32;
        match shifts.last() {
            _ if shift > MAX_SHIFT => break,
            Some((last, _)) if shift <= *last => {}
            _ => shifts.push((shift, level)),
        }
    }
    shifts
}

/// Returns the number of cells on each axis: enough for the space, but at most `most` in all. Boxes beyond wrap around.
/// An axis shorter than a cell is not divided.
fn dims(space: [f32; 3], cell: f64, most: f64) -> [u32; 3] {
    let along = |length: f32| match f64::from(length) / cell {
        cells if cells < 1.0 => 1,
        cells => (cells.min(1e6).ceil() as u32 + 1).max(FEWEST_CELLS),
    };
    let mut dims = space.map(along);
    while dims.iter().map(|&d| f64::from(d)).product::<f64>() > most {
        let longest = dims.iter_mut().max().expect("three axes");
        if *longest <= FEWEST_CELLS {
            break;
        }
        *longest = (*longest * 3 / 4).max(FEWEST_CELLS);
    }
    dims
}

#[cfg(test)]
mod tests {
    use super::*;

    const WANTED: f32 = crate::GpuOptions::DEFAULT.boxes_per_cell;

    /// Returns boxes of nine sizes on a line: of each size twenty times as many as there is room for side by side.
    fn sizes_on_a_line() -> Vec<Aabb> {
        let row = |size: u32| (0..20 << size).map(move |i| (i as f32 * 50.0, 1000.0, (1 << size) as f32));
        let boxes = (1..10).flat_map(row);
        boxes.map(|(x, length, n)| Aabb::new([x / n, 0.0, 0.0], [(x + length) / n, 0.0, 0.0])).collect()
    }

    /// The cells may be full, or small after plans that made too many tests.
    #[test]
    fn a_cell_is_at_least_half_as_long_as_the_largest_box_of_its_level() {
        let summary = Summary::of(&sizes_on_a_line());
        let (space, _) = space_of(&summary, &ordinary(&summary));
        let sizes = levels(&summary);
        assert!(sizes.len() > MAX_LEVELS, "{} levels", sizes.len());
        for (level, factor) in sizes.iter().flat_map(|level| [1.0, 1e-6].map(|factor| (level, factor))) {
            let largest = level.all.extent.into_iter().fold(0.0, f32::max);
            let cell = edge(level, &summary, space, WANTED, factor);
            assert!(
                cell * f64::from(MAX_SPAN - 2) > largest.into(),
                "{cell}, box {largest}, factor {factor}"
            );
        }
    }

    #[test]
    fn every_world_has_a_plan_of_finite_cells() {
        let point = Aabb::new([3.0; 3], [3.0; 3]);
        let ends = [f32::MIN, 0.0, f32::MAX].map(|x| Aabb::new([x; 3], [x; 3]));
        let worlds = [
            ("none", vec![], 1),
            ("one box", vec![Aabb::new([0.0; 3], [1.0; 3])], 2),
            ("equal points", vec![point; 5000], 2),
            ("points at both ends of the numbers", ends.repeat(300), 2),
            ("all numbers", vec![Aabb::new([f32::MIN; 3], [f32::MAX; 3]); 50], 1),
            ("nine sizes", sizes_on_a_line(), MAX_LEVELS),
        ];
        for ((name, boxes, most), factor) in worlds.iter().flat_map(|world| [1.0, 1e-6].map(|f| (world, f))) {
            let plan = GpuPlan::new(&Summary::of(boxes), WANTED, factor, 1 << 16);
            let Params { tick_exponent, cells_per_tick, levels, cells, .. } = plan.params;
            assert!((1..=248).contains(&tick_exponent), "{name}: {plan:?}");
            assert!((1..=1 << 16).contains(&cells_per_tick), "{name}: {plan:?}");
            assert!(levels as usize <= *most && cells <= 1 << 16, "{name}: {plan}");
        }
    }
}
