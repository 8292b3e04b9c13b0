//! The GPU's grid: PBIG's cells (section 4.1), one size for each level of boxes.
//!
//! A level's cells are a power of two times those of the finest, so that a device computes the cells
//! of a box once and gets those of every level by shifting integers (contract 3). The last level has a
//! single cell: boxes too large for the others are tested there against everything, once (contract 4).

use super::pbig::{density_cell, ordinary, pbig_cell, space_of};
use super::{LevelPlan, Summary, levels, size_class_of};
use crate::Aabb;
use crate::config::{CellRule, Config};
use crate::layout::{FEWEST_CELLS, Level, MOST_LEVELS, MOST_SPAN, Params, ordered};
use std::fmt;

/// Cells of a level for each of its boxes, at most: beyond, the scan costs more than full cells do.
const CELLS_PER_BOX: f64 = 4.0;
/// Cells that every level may have, however few its boxes.
const CELLS_ANYWAY: f64 = 4096.0;
/// Others in the cell of a box, against the wanted boxes per cell, from which a finer cell is looked for.
const CROWDED: f64 = 4.0;
/// Others in a cell that a sample must show before they count: one coincidence stands for many boxes.
const MEANINGFUL: usize = 16;
/// Finest cells from the middle of the world to its end, at most: they must fit an `i32` with room.
const REACH: f64 = 1073741824.0;

/// Levels and cells for a device.
#[derive(Clone, Debug, PartialEq)]
pub struct GpuPlan {
    /// Edge of the cells of the finest level, in the boxes' length unit.
    pub cell: f32,
    /// Where cell 0 begins: the middle of most boxes.
    pub origin: [f32; 3],
    /// Finest first; the last has one cell.
    pub levels: Vec<Level>,
    /// Cells in all.
    pub cells: u32,
}

impl fmt::Display for GpuPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} cells", self.cells)?;
        for level in &self.levels[..self.levels.len() - 1] {
            let [x, y, z] = level.dims;
            write!(f, ", {x} x {y} x {z} of {}", f64::from(self.cell) * f64::from(level.shift).exp2())?;
        }
        Ok(())
    }
}

impl GpuPlan {
    /// The grid for the boxes behind `summary`, with at most `most_cells` cells. `crowding` is a factor
    /// on the cell size: 1, or less where cells turned out to be too full.
    pub fn new(summary: &Summary, config: &Config, crowding: f32, most_cells: u32) -> Self {
        let split = levels::for_device(summary);
        // The coarsest levels, if there are too many: finer boxes then share the first of them.
        let split = &split[split.len().saturating_sub(MOST_LEVELS - 1)..];
        let (space, low) = space_of(summary, &ordinary(summary));
        let edges = split.iter().map(|level| edge(level, summary, space, config, crowding));
        let (cell, shifts) = powers_of_two(&edges.collect::<Vec<_>>(), split, space);
        let mut plan = Self {
            cell: cell as f32,
            origin: std::array::from_fn(|k| low[k] + 0.5 * space[k]),
            levels: Vec::new(),
            cells: 0,
        };
        for (shift, level) in shifts {
            let share = most_cells.saturating_sub(1) / split.len().max(1) as u32;
            let most = (f64::from(level.boxes) * CELLS_PER_BOX).max(CELLS_ANYWAY).min(f64::from(share));
            plan.push(dims(space, cell * f64::from(shift).exp2(), most), shift);
        }
        plan.push([1; 3], 0);
        plan
    }

    fn push(&mut self, dims: [u32; 3], shift: u32) {
        self.levels.push(Level { dims, shift, first_cell: self.cells, unused: [0; 3] });
        self.cells += dims.iter().product::<u32>();
    }

    /// The part of the kernels' parameters that the plan decides; the rest is 0.
    pub fn params(&self) -> Params {
        let scale = (1.0 / f64::from(self.cell)) as f32;
        let reach = 0.99 * REACH / f64::from(scale);
        let bound = |k: usize, sign: f64| {
            let x =
                (f64::from(self.origin[k]) + sign * reach).clamp(-f64::from(f32::MAX), f64::from(f32::MAX));
            ordered(x as f32)
        };
        let mut params = Params {
            origin: self.origin,
            scale,
            reach_low: std::array::from_fn(|k| bound(k, -1.0)),
            reach_high: std::array::from_fn(|k| bound(k, 1.0)),
            levels: self.levels.len() as u32,
            cells: self.cells,
            ..Params::default()
        };
        params.level[..self.levels.len()].copy_from_slice(&self.levels);
        params
    }
}

/// The cell size of a level: equation 6 or the density rule on its boxes alone, but such that its
/// largest box touches few cells on each axis.
fn edge(level: &LevelPlan, summary: &Summary, space: [f32; 3], config: &Config, crowding: f32) -> f64 {
    let of_level =
        |b: &&Aabb| (level.classes.0..=level.classes.1).contains(&(size_class_of(b.extents()) as u8));
    let sample: Vec<Aabb> = summary.sample.iter().filter(of_level).copied().collect();
    let wanted = config.pbig_boxes_per_cell.max(1.0);
    let cell = match config.cell_rule {
        CellRule::Objective if !sample.is_empty() => {
            // A quarter of the sample will do: the search evaluates it 24 times.
            let quarter: Vec<Aabb> = sample.iter().step_by(4).copied().collect();
            pbig_cell(&quarter, level.boxes, space, wanted)
        }
        _ => density_cell(level.boxes, space, wanted),
    };
    let largest = level.max_extent.into_iter().fold(0.0, f32::max);
    // A box reaches over at most one border more than it has cell lengths, and one more by rounding.
    let smallest = f64::from(largest) * 1.001 / f64::from(MOST_SPAN - 2);
    let even = f64::from(cell) * f64::from(crowding);
    uncrowded(&sample, level.boxes, even, smallest, CROWDED * f64::from(wanted)).max(smallest)
}

/// Equation 6 knows the average cell only: of boxes in clusters far apart most cells are empty and the
/// others hold a cluster each. So the cell is halved until a box has at most `most` others in its cell,
/// as the sample tells, or hardly more than in the smallest cell: identical boxes no cell can part.
fn uncrowded(sample: &[Aabb], boxes: u32, even: f64, smallest: f64, most: f64) -> f64 {
    let mut cell = even;
    let (now, seen) = crowding(sample, boxes, cell);
    if now <= most || seen < MEANINGFUL {
        return cell;
    }
    let smallest = smallest.max(even * 2f64.powi(-30));
    let goal = most.max(1.25 * crowd(sample, boxes, smallest));
    while cell > smallest && crowd(sample, boxes, cell) > goal {
        cell /= 2.0;
    }
    cell
}

fn crowd(sample: &[Aabb], boxes: u32, cell: f64) -> f64 {
    crowding(sample, boxes, cell).0
}

/// Other boxes in the cell of a box's lower corner, on average over boxes, estimated from a sample; and
/// how many the sample itself has.
fn crowding(sample: &[Aabb], boxes: u32, cell: f64) -> (f64, usize) {
    let of = |b: &Aabb| b.min.map(|x| (f64::from(x) / cell).floor() as i64);
    let mut cells: Vec<[i64; 3]> = sample.iter().map(of).collect();
    cells.sort_unstable();
    let others = cells.chunk_by(|a, b| a == b).map(|same| same.len() * (same.len() - 1)).sum::<usize>();
    let n = sample.len().max(1) as f64;
    (others as f64 / n * (f64::from(boxes) / n), others)
}

/// The finest cell, and by how many doublings each level's cells are larger; no level twice, and none
/// so coarse that the finest would not reach across the space.
fn powers_of_two<'a>(
    edges: &[f64],
    levels: &'a [LevelPlan],
    space: [f32; 3],
) -> (f64, Vec<(u32, &'a LevelPlan)>) {
    let widest = f64::from(space.into_iter().fold(0.0, f32::max));
    let finest = edges.first().copied().unwrap_or(1.0).max(4.0 * widest / REACH).clamp(1e-30, 1e30);
    let mut shifts: Vec<(u32, &LevelPlan)> = Vec::new();
    for (edge, level) in edges.iter().zip(levels) {
        let shift = (edge / finest).log2().ceil().max(0.0) as u32;
        match shifts.last() {
            _ if shift > 28 => break,
            Some((last, _)) if shift <= *last => {}
            _ => shifts.push((shift, level)),
        }
    }
    (finest, shifts)
}

/// Cells on each axis: enough for the space, but at most `most` in all, beyond which they wrap around.
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

    fn plan(boxes: &[Aabb]) -> GpuPlan {
        let plan = GpuPlan::new(&Summary::of(boxes, None), &Config::DEFAULT, 1.0, 1 << 24);
        validate(&plan);
        plan
    }

    /// What the kernels rely on.
    fn validate(plan: &GpuPlan) {
        let mut first = 0;
        for level in &plan.levels {
            assert_eq!(level.first_cell, first, "{plan}");
            assert!(level.dims.iter().all(|&d| d == 1 || d >= FEWEST_CELLS), "{plan}");
            first += level.dims.iter().product::<u32>();
        }
        assert_eq!(plan.cells, first);
        assert!(plan.levels.len() <= MOST_LEVELS);
        let (last, finer) = plan.levels.split_last().expect("at least one level");
        assert_eq!(last.dims, [1; 3]);
        assert!(finer.windows(2).all(|two| two[0].shift < two[1].shift), "{plan}");
        for k in 0..3 {
            // Undivided once, undivided in every coarser level: a box never spans more cells there.
            assert!(plan.levels.windows(2).all(|two| two[0].dims[k] > 1 || two[1].dims[k] == 1), "{plan}");
        }
    }

    fn lattice(n: u32, step: f32, half: f32) -> Vec<Aabb> {
        let at = |i: u32, d: u32| (i / d % n) as f32 * step;
        (0..n * n * n).map(|i| Aabb::from_center([at(i, 1), at(i, n), at(i, n * n)], [half; 3])).collect()
    }

    #[test]
    fn one_size_has_one_level_beside_the_cell_for_everything() {
        let plan = plan(&lattice(20, 1.0, 0.4));
        assert_eq!(plan.levels.len(), 2, "{plan}");
        assert!((0.4..4.0).contains(&plan.cell), "{plan}");
    }

    #[test]
    fn clusters_far_apart_do_not_share_a_cell_each() {
        let mut boxes = lattice(12, 1.0, 0.4);
        for apart in [1e4f32, 1e7] {
            boxes.truncate(1728);
            let away = |b: &Aabb| Aabb::new(b.min.map(|x| x + apart), b.max.map(|x| x + apart));
            boxes.extend(lattice(12, 1.0, 0.4).iter().map(away));
            let plan = plan(&boxes);
            assert!(plan.cell < 4.0, "{apart} apart: {plan}");
        }
        // No cell parts identical boxes, so none is looked for.
        let plan = plan(&[lattice(12, 1.0, 0.4), vec![Aabb::new([3.0; 3], [3.8; 3]); 3000]].concat());
        assert!(plan.cell > 0.2, "{plan}");
    }

    #[test]
    fn twelve_decades_fit_the_integers() {
        let boxes: Vec<_> = (0..600)
            .map(|i| Aabb::from_center([(i % 7) as f32; 3], [10f32.powf((i % 121) as f32 / 10.0 - 6.0); 3]))
            .collect();
        plan(&boxes);
    }

    #[test]
    fn extreme_sets_have_a_plan() {
        plan(&[]);
        plan(&[Aabb::NOWHERE; 5]);
        plan(&[Aabb::new([f32::NEG_INFINITY; 3], [f32::INFINITY; 3]); 5]);
        plan(&vec![Aabb::new([f32::MAX; 3], [f32::MAX; 3]); 500]);
        plan(&vec![Aabb::new([1e-42; 3], [2e-42; 3]); 500]);
        let flat: Vec<_> =
            (0..900).map(|i| Aabb::from_center([(i % 30) as f32, 0.0, 0.0], [0.5; 3])).collect();
        plan(&flat);
    }
}
