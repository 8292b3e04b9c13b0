//! What the plan looks at: exact counts by size, and a sample of positions.

use crate::Aabb;
use arrayvec::ArrayVec;
use std::cell::{Cell, OnceCell};

/// Boxes whose largest extent lies within one power of two.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SizeClass {
    /// How many.
    pub boxes: u32,
    /// The largest extent on each axis.
    pub max_extent: [f32; 3],
}

/// Size classes beyond this power of two (2^100) are swept: a cell of that size, or its inverse,
/// would leave the normal range of f32. Where such boxes lie says nothing about the others.
pub(super) const LARGEST_CLASS: usize = 227;

/// One pass over the boxes: counts by size class, invalid boxes, and a sample of the valid ones.
///
/// Sizes are counted rather than sampled: a thousand large boxes among a million small ones are
/// easily missed by a sample, and would cost a thousand sweeps. One pass is 1.2 ns a box.
#[derive(Clone, Debug)]
pub struct Summary {
    /// Valid boxes.
    pub valid: u32,
    /// By the exponent of the largest extent, from 0 (denormal) to 255 (infinite).
    pub classes: Box<[SizeClass; 256]>,
    /// At most [`Summary::SAMPLE`] valid boxes, spread evenly over the list, without infinite ones and half-spaces.
    pub sample: Vec<Aabb>,
}

impl Default for Summary {
    /// Of no boxes.
    fn default() -> Self {
        Self { valid: 0, classes: Box::new([SizeClass::default(); 256]), sample: Vec::new() }
    }
}

impl Summary {
    /// Sample size; PBIG's section 4.1 takes a simple random sample of 1000.
    pub const SAMPLE: usize = 1000;

    /// Summarises all `boxes`, or those with the given ids.
    ///
    /// # Panics
    /// If an id is not below the number of boxes.
    pub fn of(boxes: &[Aabb], ids: Option<&[u32]>) -> Self {
        Self::default().refilled(boxes, ids)
    }

    /// The same in the memory of another summary.
    fn refilled(mut self, boxes: &[Aabb], ids: Option<&[u32]>) -> Self {
        self.valid = 0;
        self.classes.fill(SizeClass::default());
        self.sample.clear();
        match ids {
            Some(ids) => ids.iter().for_each(|&id| self.count(&boxes[id as usize])),
            None => boxes.iter().for_each(|b| self.count(b)),
        }
        self.draw_sample(boxes, ids);
        self
    }

    fn count(&mut self, one: &Aabb) {
        if !one.is_valid() {
            return;
        }
        self.valid += 1;
        let extents = one.extents();
        let class = &mut self.classes[size_class_of(extents)];
        class.boxes += 1;
        for (max, extent) in class.max_extent.iter_mut().zip(extents) {
            *max = max.max(extent);
        }
    }

    fn draw_sample(&mut self, boxes: &[Aabb], ids: Option<&[u32]>) {
        for step in spread_evenly(ids.map_or(boxes.len(), <[u32]>::len), Self::SAMPLE) {
            let one = boxes[ids.map_or(step, |ids| ids[step] as usize)];
            if one.is_valid() && size_class_of(one.extents()) < LARGEST_CLASS {
                self.sample.push(one);
            }
        }
    }

    /// Where most lower corners lie on axis `k`: from a low to a high quantile of the sample,
    /// widened by a quarter. A few far boxes do not stretch it (contract 4).
    pub(super) fn range(&self, k: usize) -> (f32, f32) {
        // 250 corners place a 4% quantile well enough, at a quarter of the cost of 1000.
        const CORNERS: usize = Summary::SAMPLE.div_ceil(4);
        let corners = self.sample.iter().step_by(4).map(|b| b.min[k]);
        let mut corners: ArrayVec<f32, CORNERS> = corners.take(CORNERS).collect();
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

/// A summary that is made when somebody asks for it.
pub(crate) struct LazySummary<'a> {
    boxes: &'a [Aabb],
    made: OnceCell<Summary>,
    spare: Cell<Option<Summary>>,
}

impl<'a> LazySummary<'a> {
    /// `spare`: one whose memory may be used.
    pub(crate) fn new(boxes: &'a [Aabb], spare: Option<Summary>) -> Self {
        Self { boxes, made: OnceCell::new(), spare: Cell::new(spare) }
    }

    pub(crate) fn get(&self) -> &Summary {
        self.made.get_or_init(|| self.spare.take().unwrap_or_default().refilled(self.boxes, None))
    }

    /// One whose memory may be used for the next.
    pub(crate) fn into_spare(self) -> Option<Summary> {
        self.made.into_inner().or(self.spare.into_inner())
    }
}

/// At most `most` of the numbers below `len`, by a golden-ratio walk: a pattern in the order of the boxes cannot
/// bias a sample, and it is the same for the same number of boxes.
pub(crate) fn spread_evenly(len: usize, most: usize) -> impl Iterator<Item = usize> {
    const GOLDEN: u64 = 0x9E37_79B9_7F4A_7C15;
    let walk = move |i: u64| ((i.wrapping_mul(GOLDEN) >> 32) * len as u64) >> 32;
    (0..len.min(most) as u64).map(move |i| if len <= most { i } else { walk(i) } as usize)
}

/// The exponent of the largest extent; NaN (a point at infinity on every axis) counts as infinite.
#[inline]
pub(crate) fn size_class_of(extents: [f32; 3]) -> usize {
    let largest = extents[0].max(extents[1]).max(extents[2]);
    (largest.to_bits() >> 23 & 0xFF) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invalid_boxes_are_not_counted_and_infinite_ones_are_a_class_of_their_own() {
        let boxes = [
            Aabb::NOWHERE,
            Aabb::new([1.0; 3], [0.0; 3]),
            Aabb::new([0.0; 3], [1.5, 0.5, 0.25]),
            Aabb::new([0.0; 3], [f32::INFINITY; 3]),
            Aabb::new([f32::INFINITY; 3], [f32::INFINITY; 3]),
            Aabb::new([f32::MIN; 3], [f32::MAX; 3]),
        ];
        let summary = Summary::of(&boxes, None);
        assert_eq!((summary.valid, summary.classes[255].boxes), (4, 3));
        assert_eq!(summary.classes[127].max_extent, [1.5, 0.5, 0.25]);
        assert_eq!(summary.sample.len(), 1);
    }

    #[test]
    fn the_range_ignores_a_far_box() {
        let mut boxes: Vec<_> = (0..2000).map(|i| Aabb::from_center([i as f32; 3], [1.0; 3])).collect();
        boxes.push(Aabb::from_center([1e30; 3], [1.0; 3]));
        let (low, high) = Summary::of(&boxes, None).range(0);
        assert!((-300.0..200.0).contains(&low) && (1800.0..2300.0).contains(&high), "{low} {high}");
    }

    #[test]
    fn the_range_of_a_few_boxes_on_a_half_space_is_theirs() {
        let mut boxes: Vec<_> = (0..60).map(|i| Aabb::from_center([i as f32; 3], [1.0; 3])).collect();
        boxes.insert(0, Aabb::new([-0.5 * f32::MAX; 3], [0.5 * f32::MAX; 3]));
        let (low, high) = Summary::of(&boxes, None).range(1);
        assert!((-20.0..0.0).contains(&low) && (50.0..80.0).contains(&high), "{low} {high}");
    }

    #[test]
    fn a_subset_is_summarised_by_its_ids() {
        let boxes: Vec<_> = (0..10).map(|i| Aabb::from_center([i as f32; 3], [1.0; 3])).collect();
        assert_eq!(Summary::of(&boxes, Some(&[3, 5])).valid, 2);
    }
}
