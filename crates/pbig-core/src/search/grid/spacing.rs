//! The plan: the size of a grid's cells, the boxes that it takes, and the neighbouring cells that a search visits.

use super::bounds::{Bounds, SAMPLE_SIZE, Sample, SizeClass, size_classes_of_both};
use super::cells::{Cells, MAX_STEPS_PER_BOX};
use crate::policy;
use crate::{Aabb, Algorithm, NeighbourScan, Plan};

impl Cells {
    /// Describes a search of one grid of these cells, or of two.
    pub(crate) fn told(&self, boxes: usize, oversize: usize) -> Plan {
        Plan {
            algorithm: Algorithm::Grid,
            boxes: boxes as u32,
            origin: std::array::from_fn(|k| self.origin[k]),
            cell: self.edges(),
            dims: self.dims.map(|dim| dim as u32),
            scan: self.scan,
            oversize: oversize as u32,
            ..Plan::default()
        }
    }

    /// Plans a grid for the valid ones of some boxes, or two grids for those of two sets.
    pub(crate) fn new(boxes: &[Aabb], others: Option<&[Aabb]>, workers: usize) -> Self {
        let both = [boxes, others.unwrap_or(&[])];
        let sample = Sample::of_both(both);
        let all = Bounds::of_both(both, workers);
        let space = all.trimmed(&sample);
        let is_mixed = all.largest() > policy::MIXED_SIZE_RATIO * sample.median_extent();
        let extent = if is_mixed {
            cheapest_extent(&size_classes_of_both(both, workers)[..], &space)
        } else {
            std::array::from_fn(|k| all.extent[k])
        };
        let count = both[0].len() + both[1].len();
        Spacing::new(count, space, extent).uncrowded(&sample).plan(others.is_some(), &sample)
    }
}

/// Returns the extent of the largest boxes that the grid should take: the larger it is, the more boxes share a cell; the
/// smaller, the more boxes are oversize. The costs are those of a test, in ns.
fn cheapest_extent(classes: &[SizeClass], space: &Bounds) -> [f32; 3] {
    const LARGEST_CLASS: usize = 227; // 2^100: the inverse of a cell of that size is still a normal f32
    let classes = &classes[..classes.iter().rposition(|class| class.boxes > 0).map_or(0, |last| last + 1)];
    let (mut best, mut cheapest) = ([0.0; 3], f64::MAX);
    let (mut taken, mut extent) = (0, [0.0f32; 3]);
    for (i, class) in classes.iter().enumerate().take(LARGEST_CLASS).filter(|(_, class)| class.boxes > 0) {
        taken += class.boxes;
        extent = std::array::from_fn(|k| extent[k].max(class.extent[k]));
        let candidates = f64::from(taken) * share(space, extent.map(|x| 2.5 * x)) * 0.5;
        let cost = f64::from(taken) * (policy::NS_PER_BOX + candidates * policy::NS_PER_CANDIDATE)
            + oversize_cost(&classes[i + 1..], f64::from(taken), extent, space);
        if cost < cheapest {
            (cheapest, best) = (cost, extent);
        }
    }
    best
}

/// Returns the time to test oversize boxes against those in the grid and each other, in ns.
fn oversize_cost(classes: &[SizeClass], in_grid: f64, cell: [f32; 3], space: &Bounds) -> f64 {
    let oversize = classes.iter().map(|class| f64::from(class.boxes)).sum::<f64>();
    let against_grid = |class: &SizeClass| {
        let reached = std::array::from_fn(|k| class.extent[k] + 2.0 * cell[k]);
        f64::from(class.boxes) * (in_grid * share(space, reached) * policy::NS_PER_OVERSIZE_TEST)
    };
    let grid = classes.iter().filter(|class| class.boxes > 0).map(against_grid).sum::<f64>();
    grid + oversize * oversize * 0.5 * policy::NS_PER_OVERSIZE_TEST
}

/// Returns the part of the space that a box covers.
fn share(space: &Bounds, extent: [f32; 3]) -> f64 {
    (0..3).map(|k| (f64::from(extent[k]) / space.width(k)).min(1.0)).product()
}

/// Step lengths, and the quantities that they follow from.
struct Spacing {
    boxes: usize,
    space: Bounds,
    extent: [f32; 3],
    /// The edge of a cell that holds the wanted number of boxes.
    edge: f64,
    /// Lower corner of the cells, by axis.
    origin: [f64; 3],
    wraps: bool,
}

impl Spacing {
    fn new(boxes: usize, space: Bounds, extent: [f32; 3]) -> Self {
        let volume: f64 = (0..3).map(|k| space.width(k)).product();
        let edge = (policy::BOXES_PER_CELL * volume / boxes.max(1) as f64).cbrt();
        let origin = std::array::from_fn(|k| f64::from(space.low[k]));
        let mut spacing = Self { boxes, space, extent, edge, origin, wraps: false };
        while spacing.count() > spacing.most_cells() {
            spacing.edge *= 1.5;
        }
        spacing
    }

    fn most_cells(&self) -> f64 {
        (policy::MAX_CELLS_PER_BOX * self.boxes as f64 + policy::MIN_CELLS).min(f64::from(1 << 30))
    }

    /// Returns the length of a step on an axis, for cells of 64 steps.
    fn step(&self, k: usize) -> f64 {
        (f64::from(self.extent[k]) / (MAX_STEPS_PER_BOX - 1.0)).max(self.edge / 64.0).max(1e-36)
    }

    /// Returns the extent of the largest box that the grid takes on an axis: larger than any now, so that a box that turns or
    /// is rounded elsewhere is not oversize at once. A larger one makes windows larger.
    fn extent_with_slack(&self, k: usize) -> f32 {
        let most = ((MAX_STEPS_PER_BOX - 0.5) * self.step(k)) as f32;
        // Finite, so that no infinite box is taken where the largest is huge.
        self.extent[k].max(most.min(policy::MAX_SLACK * self.extent[k]).min(f32::MAX))
    }

    /// Returns true if the edge decides about the step on an axis; otherwise the largest box does.
    fn decides(&self) -> bool {
        (0..3).any(|k| self.edge / 64.0 > f64::from(self.extent[k]) / (MAX_STEPS_PER_BOX - 1.0))
    }

    fn cells_along(&self, k: usize) -> f64 {
        self.space.width(k) / (64.0 * self.step(k)) + 1.0
    }

    fn count(&self) -> f64 {
        (0..3).map(|k| (self.cells_along(k) + 4.0).floor()).product()
    }

    /// Makes cells smaller if the sample says that boxes lie in a few clusters far apart. The cells wrap around if a grid of the
    /// whole space would have too many.
    fn uncrowded(mut self, sample: &Sample) -> Self {
        if self.crowd(sample) <= policy::MAX_CROWD {
            return self;
        }
        let smallest = self.edge * 1e-12;
        while self.edge > smallest && self.decides() && self.crowd(sample) > policy::WANTED_CROWD {
            self.edge *= 0.5;
        }
        self.wraps = self.count() > self.most_cells();
        if self.wraps {
            self.origin = sample.middle();
        }
        self
    }

    /// Estimates how many others a box has in its cell; 0 where the sample is too small to tell.
    fn crowd(&self, sample: &Sample) -> f64 {
        let cell =
            |k: usize, x: f32| ((f64::from(x) - f64::from(self.space.low[k])) / (64.0 * self.step(k))) as i64;
        let (mut cells, boxes) = ([0; SAMPLE_SIZE], sample.boxes());
        for (to, aabb) in cells.iter_mut().zip(boxes) {
            // A number for each cell; two that share one by chance are too few to matter.
            *to = (0..3).fold(0, |cells: i64, k| cells.wrapping_mul(0x0010_0000_01B3) ^ cell(k, aabb.min[k]));
        }
        let cells = &mut cells[..boxes.len()];
        cells.sort_unstable();
        let others: usize = cells.chunk_by(|a, b| a == b).map(|same| same.len() * (same.len() - 1)).sum();
        let n = boxes.len().max(1) as f64;
        if others < policy::MIN_COINCIDENCES { 0.0 } else { others as f64 / n * (self.boxes as f64 / n) }
    }

    fn plan(&self, is_of_two_sets: bool, sample: &Sample) -> Cells {
        let per_cell = self.boxes as f64 / (0..3).map(|k| self.cells_along(k)).product::<f64>();
        let is_crowded = self.wraps || per_cell > policy::RUNS_UP_TO_PER_CELL;
        let is_sparse = per_cell <= policy::LONG_CELLS_UP_TO_PER_CELL && self.crowd(sample) == 0.0;
        let shift = self.shift(is_of_two_sets && is_sparse);
        let (cell, border) = (f64::from(1u32 << shift), f64::from(64u32.max(1 << shift)));
        let mut cells = Cells { shift, wraps: self.wraps, ..Cells::default() };
        for k in 0..3 {
            let step = self.step(k);
            cells.origin[k] = self.origin[k] - border * step;
            cells.scale[k] = 1.0 / step;
            cells.max_extent[k] = self.extent_with_slack(k);
            cells.reach[k] = (f64::from(cells.max_extent[k]) / step).ceil() as i32 + 2;
            let needed = (self.space.width(k) / step + 2.0 * border) / cell;
            cells.dims[k] = needed.min(f64::from(1 << 24)) as i32 + 3;
        }
        if self.wraps {
            cells.dims = wrapped_dims(cells.dims, self.most_cells());
        }
        if is_crowded || is_of_two_sets {
            cells.scan = NeighbourScan::Windows;
        }
        cells
    }

    fn shift(&self, has_long_cells: bool) -> u32 {
        if self.wraps {
            // Cells that fold onto one place hold fewer boxes.
            5
        } else if has_long_cells {
            // A box of 62 steps and its reach lie in two cells on an axis. Candidates are fewer than 256 steps away, as codes need.
            7
        } else {
            6
        }
    }
}

/// Returns powers of two, at most as many cells as allowed, and no more on an axis than the space needs.
fn wrapped_dims(needed: [i32; 3], most: f64) -> [i32; 3] {
    let mut dims = needed.map(|dim| (dim.clamp(8, 1 << 24) as u32).next_power_of_two() as i32);
    while dims.iter().map(|&dim| f64::from(dim)).product::<f64>() > most {
        let longest = dims.iter_mut().max().expect("three axes");
        if *longest <= 8 {
            break;
        }
        *longest /= 2;
    }
    dims
}
