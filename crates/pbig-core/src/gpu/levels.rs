//! Levels: the split of boxes by size, so that each size has cells of its own (contract 4).
//!
//! Each split has a cost by the counts of boxes. The cheapest split is found by dynamic programming over the size
//! classes. Boxes of the largest classes may be left without a level: they go into the last level's single cell.

use crate::pbig::{OVERSIZE_CLASS, SizeClass, Summary};

/// Cost of a test of two boxes in the last level's single cell. All costs here are ratios; they are not fitted to a
/// device.
const OVERSIZE_TEST: f64 = 1.8;
/// Cost of sorting a box into the cells of its level.
const PLACE: f64 = 65.0;
/// Cost of testing a box against another one.
const CANDIDATE: f64 = 0.7;
/// Cost of sorting a box into the cells of a coarser level.
const VISIT: f64 = 85.0;
/// Cost of one more level, however small.
const LEVEL: f64 = 2000.0;

/// Boxes per cell that the costs assume.
const BOXES_PER_CELL: f64 = 0.5;
/// Smallest cell, 2^-100: the inverse of a smaller one would leave the normal range of f32.
const SMALLEST_CELL: f32 = 7.888_609e-31;
/// Cell size against the largest box of its level, with room for rounding.
const CELL_PER_EXTENT: f32 = 64.0 / 62.0;
/// Allowance for boxes that turn, or that are rounded differently elsewhere.
const EXTENT_ALLOWANCE: f32 = 1.0 + 1.0 / 128.0;
/// Largest number of groups. The time of a split is cubic in it, and sets of any floats use up to 227 classes.
const MAX_GROUPS: usize = 24;

/// The boxes of neighbouring size classes.
#[derive(Clone, Copy, Debug)]
pub(super) struct SizeRange {
    /// First and last size class ([`Summary::classes`]).
    pub(super) classes: (usize, usize),
    pub(super) boxes: u32,
    /// Largest extent on each axis, rounded up.
    pub(super) max_extent: [f32; 3],
}

impl SizeRange {
    fn of(ranges: &[Self]) -> Self {
        let extent = |k: usize| ranges.iter().map(|range| range.max_extent[k]).fold(0.0, f32::max);
        Self {
            classes: (ranges[0].classes.0, ranges[ranges.len() - 1].classes.1),
            boxes: count(ranges),
            max_extent: std::array::from_fn(extent),
        }
    }
}

/// Returns the cheapest levels, finest first. Boxes larger than those of the last level have none.
pub(super) fn levels(summary: &Summary) -> Vec<SizeRange> {
    let groups = groups(summary);
    let length = |(low, high): (f32, f32)| (high - low).clamp(0.0, f32::MAX);
    let space = Space { lengths: std::array::from_fn(|k| length(summary.range(k))) };
    let steps = space.cheapest(&groups);
    let (mut levels, mut end) = (Vec::new(), groups.len());
    while end > 0 {
        let step = steps[end - 1];
        if !step.is_oversize {
            levels.push(SizeRange::of(&groups[step.first..end]));
        }
        end = step.first;
    }
    levels.reverse();
    levels
}

/// Returns the classes in use, neighbours joined so that at most [`MAX_GROUPS`] are left.
fn groups(summary: &Summary) -> Vec<SizeRange> {
    let used = summary.classes[..OVERSIZE_CLASS].iter().enumerate().filter(|(_, class)| class.boxes > 0);
    let one = |(i, class): (usize, &SizeClass)| SizeRange {
        classes: (i, i),
        boxes: class.boxes,
        max_extent: class.max_extent.map(|extent| (extent * EXTENT_ALLOWANCE).next_up().min(f32::MAX)),
    };
    let used: Vec<SizeRange> = used.map(one).collect();
    let per_group = used.len().div_ceil(MAX_GROUPS).max(1);
    used.chunks(per_group).map(SizeRange::of).collect()
}

fn count(ranges: &[SizeRange]) -> u32 {
    ranges.iter().map(|range| range.boxes).sum()
}

/// The last step of a split of some first groups: its first group, and the cost of all steps so far.
#[derive(Clone, Copy)]
struct Step {
    first: usize,
    /// The step's boxes have no level.
    is_oversize: bool,
    cost: f64,
}

/// The space in which the boxes lie.
struct Space {
    lengths: [f32; 3],
}

impl Space {
    /// Returns the cheapest last step for each number of first groups.
    fn cheapest(&self, groups: &[SizeRange]) -> Vec<Step> {
        let mut steps: Vec<Step> = Vec::new();
        for last in 0..groups.len() {
            let before = |first: usize| if first == 0 { 0.0 } else { steps[first - 1].cost };
            let levels = (0..=last).map(|first| {
                let cost = before(first) + self.level_cost(&groups[first..=last], &groups[..first]);
                Step { first, is_oversize: false, cost }
            });
            // Only the largest boxes can be left without a level.
            let at_end = last + 1 == groups.len();
            let oversize = (1..if at_end { last + 1 } else { 0 }).map(|first| {
                let cost = before(first) + oversize_cost(&groups[first..=last], &groups[..first]);
                Step { first, is_oversize: true, cost }
            });
            let best = levels.chain(oversize).min_by(|a, b| a.cost.total_cmp(&b.cost));
            steps.extend(best);
        }
        steps
    }

    fn level_cost(&self, level: &[SizeRange], smaller: &[SizeRange]) -> f64 {
        let own = PLACE + CANDIDATE * 0.5 * self.candidates(level, level);
        let visit = VISIT + CANDIDATE * self.candidates(smaller, level);
        LEVEL + f64::from(count(level)) * own + f64::from(count(smaller)) * visit
    }

    /// Returns the number of boxes of `level` that an average box of `ranges` is tested against, in an even spread.
    fn candidates(&self, ranges: &[SizeRange], level: &[SizeRange]) -> f64 {
        let all = SizeRange::of(level);
        let spacing = spacing(self.lengths, all.boxes) as f32;
        // A cell holds the largest box.
        let cell = all.max_extent.map(|x| (x * CELL_PER_EXTENT).max(spacing).max(SMALLEST_CELL));
        let share = |own: &[f32; 3], k: usize| {
            let window = own[k] + all.max_extent[k] + cell[k];
            f64::from(window) / f64::from(self.lengths[k].max(window))
        };
        let weighted = |range: &SizeRange| {
            let share: f64 = (0..3).map(|k| share(&range.max_extent, k)).product();
            f64::from(range.boxes) * share
        };
        let sum: f64 = ranges.iter().map(weighted).sum();
        f64::from(all.boxes) * sum / f64::from(count(ranges).max(1))
    }
}

/// Returns the cost of testing boxes against every smaller one, and against each other.
fn oversize_cost(oversize: &[SizeRange], smaller: &[SizeRange]) -> f64 {
    let (n, others) = (f64::from(count(oversize)), f64::from(count(smaller)));
    OVERSIZE_TEST * n * (others + 0.5 * n)
}

/// Returns the edge of a cube that holds [`BOXES_PER_CELL`] of `n` boxes.
///
/// An axis shorter than the edge has one layer of cells and does not count: a flat world is divided as a plane, a row
/// of boxes as a line.
fn spacing(lengths: [f32; 3], n: u32) -> f64 {
    let cells = (f64::from(n) / BOXES_PER_CELL).max(1.0);
    let mut lengths = lengths.map(f64::from);
    lengths.sort_unstable_by(|a, b| b.total_cmp(a));
    let (mut volume, mut edge) = (1.0, 0.0f64);
    for (axes, length) in lengths.into_iter().enumerate() {
        if axes > 0 && length <= edge {
            break;
        }
        volume *= length;
        edge = (volume / cells).powf(1.0 / (axes as f64 + 1.0));
    }
    edge
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Aabb;

    #[test]
    fn spacing_gives_the_wanted_boxes_per_cell_in_one_two_and_three_dimensions() {
        assert!((spacing([100.0; 3], 500_000) - 1.0).abs() < 1e-6);
        assert!((spacing([100.0; 3], 62_500) - 2.0).abs() < 1e-6);
        assert!((spacing([100.0, 0.001, 100.0], 5_000) - 1.0).abs() < 1e-6);
        assert!((spacing([0.0, 100.0, 0.0], 50) - 1.0).abs() < 1e-6);
        assert_eq!(spacing([0.0; 3], 100), 0.0);
    }

    fn lattice(n: u32, step: f32, half: f32) -> Vec<Aabb> {
        let at = |i: u32, d: u32| (i / d % n) as f32 * step;
        (0..n * n * n).map(|i| Aabb::from_center([at(i, 1), at(i, n), at(i, n * n)], [half; 3])).collect()
    }

    fn boxes_of_levels(boxes: &[Aabb]) -> Vec<u32> {
        levels(&Summary::of(boxes)).iter().map(|level| level.boxes).collect()
    }

    #[test]
    fn boxes_of_one_size_share_a_level_and_few_huge_ones_have_none() {
        let mut boxes = lattice(20, 1.0, 0.4);
        assert_eq!(boxes_of_levels(&boxes), [8000]);
        boxes.push(Aabb::new([-1e4; 3], [1e4; 3]));
        assert_eq!(boxes_of_levels(&boxes), [8000], "the large box has no level");
    }

    #[test]
    fn many_boxes_of_two_sizes_get_two_levels() {
        let mut boxes = lattice(40, 1.0, 0.0005);
        boxes.extend(lattice(20, 4.0, 2.0));
        assert_eq!(boxes_of_levels(&boxes), [64_000, 8000]);
    }

    #[test]
    fn no_boxes_have_no_levels() {
        assert!(boxes_of_levels(&[]).is_empty());
        assert!(boxes_of_levels(&[Aabb::new([f32::NEG_INFINITY; 3], [f32::INFINITY; 3]); 3]).is_empty());
    }
}
