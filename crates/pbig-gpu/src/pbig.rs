//! Planning of PBIG's grid: statistics of the boxes, and cell sizes by PBIG's equations 2 to 6 (Lo et al. 2013, section
//! 4.1) or by Avril's density rule (Avril et al. 2012, section 4.1).

use crate::layout::CLASS_WORDS;
use pbig_core::Aabb;
use pbig_core::internal::{SizeClass, SizeClasses, size_class_of, size_classes, spread_evenly, threads_for};

/// First size class that belongs to no level (2^100). A cell of that size, or its inverse, would leave the normal range
/// of f32.
pub const OVERSIZE_CLASS: usize = 227;

/// Fewest boxes for a thread: 20 us of work.
const PIECE: usize = 1 << 14;

/// Counts of boxes by size class, and a sample of valid boxes.
#[derive(Clone, Debug)]
pub struct Summary {
    /// Number of valid boxes.
    pub valid: u32,
    /// Size classes of the valid boxes.
    pub classes: SizeClasses,
    /// At most [`Summary::SAMPLE`] valid boxes, spread evenly over the list. Oversize boxes are left out.
    pub sample: Vec<Aabb>,
}

impl Summary {
    /// Sample size. PBIG's section 4.1 takes a simple random sample of 1000.
    pub const SAMPLE: usize = 1000;

    /// Returns the summary of the boxes. It takes 1.2 ns a box.
    pub fn of(boxes: &[Aabb]) -> Self {
        let classes = size_classes(boxes, threads_for(boxes.len() / PIECE));
        Self::with(classes, spread_evenly(boxes.len(), Self::SAMPLE).map(|i| boxes[i]))
    }

    /// Returns the summary that the kernel `measure` has made of this number of boxes: see [`crate::layout::SUMMARY_WORDS`].
    pub fn of_device(words: &[u32], count: u32) -> Self {
        let (of_classes, sample) = words.split_at(CLASS_WORDS as usize);
        let of_classes = of_classes.as_chunks::<4>().0;
        let classes: SizeClasses = std::array::from_fn(|i| {
            let [boxes, x, y, z] = of_classes[i];
            SizeClass { boxes, extent: [x, y, z].map(f32::from_bits) }
        });
        let boxes: &[Aabb] = bytemuck::cast_slice(sample);
        Self::with(classes, boxes.iter().take(Self::SAMPLE.min(count as usize)).copied())
    }

    fn with(classes: SizeClasses, sampled: impl Iterator<Item = Aabb>) -> Self {
        let is_ordinary = |b: &Aabb| b.is_valid() && size_class_of(b.extents()) < OVERSIZE_CLASS;
        let valid = classes.iter().map(|class| class.boxes).sum();
        Self { valid, classes, sample: sampled.filter(is_ordinary).collect() }
    }

    /// Returns about the number of overlapping pairs, as the sample tells; 0 if too few of its boxes overlap to tell.
    pub fn pairs(&self) -> u64 {
        // A sample with 1.5 on average has six in one of 220 cases: the number is rarely more than four times too high.
        const FEWEST: usize = 6;
        let sample = &self.sample;
        let partners =
            |(i, one): (usize, &Aabb)| sample[..i].iter().filter(|other| one.overlaps(other)).count();
        let found: usize = sample.iter().enumerate().map(partners).sum();
        let share = f64::from(self.valid) / sample.len().max(1) as f64;
        if found < FEWEST { 0 } else { (found as f64 * share * share) as u64 }
    }

    /// Returns the range of most lower corners on axis `k`: from the 4% to the 96% quantile of the sample, widened by a
    /// quarter. A few far boxes do not stretch it (contract 4).
    pub fn range(&self, k: usize) -> (f32, f32) {
        // A quarter of the sample places a 4% quantile well enough.
        let mut corners: Vec<f32> = self.sample.iter().step_by(4).map(|b| b.min[k]).collect();
        if corners.is_empty() {
            return (0.0, 0.0);
        }
        let (low, high) = (corners.len() / 25, corners.len() - 1 - corners.len() / 25);
        let low = *corners.select_nth_unstable_by(low, f32::total_cmp).1;
        let high = *corners.select_nth_unstable_by(high, f32::total_cmp).1;
        let widening = (high - low) * 0.125;
        (low - widening, high + widening)
    }
}

/// Returns the number of cells along a length.
pub fn cells_along(length: f32, cell: f32) -> f64 {
    f64::from((length / cell).ceil().max(1.0))
}

/// Returns the number of cells of edge `cell` in a space, or under a box, of the given lengths (equations 3 and 4).
pub fn cells_in(lengths: [f32; 3], cell: f32) -> f64 {
    lengths.into_iter().map(|length| cells_along(length, cell)).product()
}

/// Returns the sample without boxes wider than half the range of all boxes, such as a ground, a cover or a half-space.
///
/// Such a box touches too many cells, so it is tested against all others instead. It would also stretch the space.
pub fn ordinary(summary: &Summary) -> Vec<Aabb> {
    let widths = [0, 1, 2].map(|k| summary.range(k)).map(|(low, high)| high - low);
    let largest = 0.5 * widths.into_iter().fold(0.0, f32::max);
    let fits = |b: &&Aabb| b.extents().into_iter().all(|extent| extent < largest);
    let ordinary: Vec<Aabb> = summary.sample.iter().filter(fits).copied().collect();
    if ordinary.is_empty() { summary.sample.clone() } else { ordinary }
}

/// Returns the lengths and the lowest corner of the paper's space, for most of the sample.
pub fn space_of(summary: &Summary, sample: &[Aabb]) -> ([f32; 3], [f32; 3]) {
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

    #[test]
    fn the_range_is_that_of_most_boxes_beside_a_far_one_or_a_half_space() {
        let far = Aabb::from_center([1e30; 3], [1.0; 3]);
        let half_space = Aabb::new([-0.5 * f32::MAX; 3], [0.5 * f32::MAX; 3]);
        for (count, other) in [(2000, far), (60, half_space)] {
            let mut boxes: Vec<_> = (0..count).map(|i| Aabb::from_center([i as f32; 3], [1.0; 3])).collect();
            boxes.insert(0, other);
            let (low, high) = Summary::of(&boxes).range(1);
            let n = count as f32;
            assert!(
                (-0.3 * n..0.1 * n).contains(&low) && (0.8 * n..1.35 * n).contains(&high),
                "{low} {high}"
            );
        }
    }
}
