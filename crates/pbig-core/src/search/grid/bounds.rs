//! Bounds and sizes of a set of boxes, from which the plan of a grid follows.

use crate::Aabb;
use crate::aabb::one_box;
use crate::parallel::{map, piece_range};

/// Maximum coordinate. Larger ones count as this one, so that a width never overflows.
const FARTHEST: f32 = 1e37;

/// Number of boxes in a sample.
pub(super) const SAMPLE_SIZE: usize = 128;

/// Maximum number of boxes looked at for a sample: some may be invalid.
const SAMPLE_TRIES: usize = 1024;

/// Size classes: one for each power of two of the largest extent.
const CLASSES: usize = 256;

/// Smallest and largest corners, and the largest extents, of the valid boxes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    pub(super) low: [f32; 4],
    pub(super) high: [f32; 4],
    pub(super) extent: [f32; 4],
}

impl Bounds {
    const EMPTY: Self = Self { low: [f32::INFINITY; 4], high: [f32::NEG_INFINITY; 4], extent: [0.0; 4] };

    pub(super) fn of_both([first, second]: [&[Aabb]; 2], workers: usize) -> Self {
        let bounds = Self::of(first, workers);
        if second.is_empty() { bounds } else { bounds.merged(&Self::of(second, workers)) }
    }

    fn of(boxes: &[Aabb], workers: usize) -> Self {
        if workers <= 1 {
            return Self::EMPTY.widened(boxes).limited();
        }
        let part = |piece| Self::EMPTY.widened(&boxes[piece_range(boxes.len(), piece, workers)]);
        map(workers, part).into_iter().fold(Self::EMPTY, |all, part| all.merged(&part)).limited()
    }

    /// Returns the bounds of some boxes and of these.
    fn widened<'a>(self, boxes: impl IntoIterator<Item = &'a Aabb>) -> Self {
        let [low, high, extent] = one_box::widened([self.low, self.high, self.extent], boxes);
        Self { low, high, extent }
    }

    fn merged(self, other: &Self) -> Self {
        Self {
            low: std::array::from_fn(|k| other.low[k].min(self.low[k])),
            high: std::array::from_fn(|k| other.high[k].max(self.high[k])),
            extent: std::array::from_fn(|k| other.extent[k].max(self.extent[k])),
        }
    }

    fn limited(mut self) -> Self {
        self.low = self.low.map(|x| x.clamp(-FARTHEST, FARTHEST));
        self.high = self.high.map(|x| x.clamp(-FARTHEST, FARTHEST));
        self
    }

    pub(super) fn largest(&self) -> f32 {
        largest(&self.extent)
    }

    /// Shrinks the bounds to where most of the sample lies, on axes where few boxes stretch them (contract 4).
    pub(super) fn trimmed(mut self, sample: &Sample) -> Self {
        for k in 0..3 {
            let (low, high) = sample.range(k);
            let margin = 0.125 * (high - low);
            let wide = high - low + 2.0 * margin;
            if self.high[k] - self.low[k] > 2.0 * wide {
                self.low[k] = self.low[k].max(low - margin);
                self.high[k] = self.high[k].min(high + margin);
            }
        }
        self
    }

    /// Returns the width of an axis; more than 0.
    pub(super) fn width(&self, k: usize) -> f64 {
        (f64::from(self.high[k]) - f64::from(self.low[k])).max(1e-30)
    }
}

/// Returns a box around boxes that are valid or [`Aabb::NOWHERE`], which it is without a valid one.
pub(crate) fn bounds_of<'a>(boxes: impl IntoIterator<Item = &'a Aabb>) -> Aabb {
    let Bounds { low: [x, y, z, _], high: [right, top, back, _], .. } = Bounds::EMPTY.widened(boxes);
    let bounds = Aabb::new([x, y, z], [right, top, back]);
    if bounds.is_valid() { bounds } else { Aabb::NOWHERE }
}

fn largest(extent: &[f32]) -> f32 {
    extent[0].max(extent[1]).max(extent[2])
}

/// A few valid boxes, spread evenly over two lists.
#[derive(Clone, Debug)]
pub(super) struct Sample {
    boxes: [Aabb; SAMPLE_SIZE],
    len: usize,
}

impl Sample {
    pub(super) fn of_both([first, second]: [&[Aabb]; 2]) -> Self {
        let mut sample = Self { boxes: [Aabb::NOWHERE; SAMPLE_SIZE], len: 0 };
        let at = |i: usize| if i < first.len() { first[i] } else { second[i - first.len()] };
        let tries = spread_evenly(first.len() + second.len(), SAMPLE_TRIES).map(at);
        for aabb in tries.filter(Aabb::is_valid).take(SAMPLE_SIZE) {
            sample.boxes[sample.len] = aabb;
            sample.len += 1;
        }
        sample
    }

    pub(super) fn boxes(&self) -> &[Aabb] {
        &self.boxes[..self.len]
    }

    /// Returns a low and a high quantile (4%) of the lower corners on an axis.
    fn range(&self, k: usize) -> (f32, f32) {
        let lowest = self.len / 25;
        let corner = |aabb: &Aabb| aabb.min[k].clamp(-FARTHEST, FARTHEST);
        (self.nth(lowest, corner), self.nth(self.len.saturating_sub(1 + lowest), corner))
    }

    /// Returns the median of the lower corners, axis by axis: a few far boxes do not move it.
    pub(super) fn middle(&self) -> [f64; 3] {
        std::array::from_fn(|k| {
            f64::from(self.nth(self.len / 2, |aabb| aabb.min[k].clamp(-FARTHEST, FARTHEST)))
        })
    }

    pub(super) fn median_extent(&self) -> f32 {
        self.nth(self.len / 2, |aabb| largest(&aabb.extents()))
    }

    /// Returns the value that has `n` lesser ones; 0 where there is none.
    fn nth(&self, n: usize, value: impl Fn(&Aabb) -> f32) -> f32 {
        let mut values = [0.0; SAMPLE_SIZE];
        values.iter_mut().zip(self.boxes()).for_each(|(to, aabb)| *to = value(aabb));
        let values = &mut values[..self.len];
        if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(n, f32::total_cmp).1 }
    }
}

/// Yields at most `most` of the numbers below `len` by a golden-ratio walk: a pattern in the order of the boxes cannot
/// bias the sample.
pub fn spread_evenly(len: usize, most: usize) -> impl Iterator<Item = usize> {
    const GOLDEN: u64 = 0x9E37_79B9_7F4A_7C15;
    let walk = move |i: u64| ((i.wrapping_mul(GOLDEN) >> 32) * len as u64) >> 32;
    (0..len.min(most) as u64).map(move |i| if len <= most { i } else { walk(i) } as usize)
}

/// Boxes whose largest extent lies within one power of two.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SizeClass {
    /// Number of boxes.
    pub boxes: u32,
    /// Largest extent, by axis.
    pub extent: [f32; 3],
}

pub(super) fn size_classes_of_both([first, second]: [&[Aabb]; 2], workers: usize) -> SizeClasses {
    let mut all = size_classes(first, workers);
    if !second.is_empty() {
        all.iter_mut().zip(&size_classes(second, workers)).for_each(|(all, part)| all.add(part));
    }
    all
}

/// Counts valid boxes by size class. Counted rather than sampled: a sample misses a thousand large boxes among a million
/// small ones.
pub fn size_classes(boxes: &[Aabb], workers: usize) -> SizeClasses {
    if workers <= 1 {
        return classes_of(boxes);
    }
    // Each piece has counts of 256 classes.
    let pieces = workers.min(16);
    let parts = map(pieces, |piece| classes_of(&boxes[piece_range(boxes.len(), piece, pieces)]));
    let mut all = NO_CLASSES;
    for part in &parts {
        all.iter_mut().zip(part).for_each(|(all, part)| all.add(part));
    }
    all
}

fn classes_of(boxes: &[Aabb]) -> SizeClasses {
    let mut classes = NO_CLASSES;
    boxes.iter().for_each(|aabb| count(&mut classes, aabb));
    classes
}

/// The size classes, by the exponent of the largest extent, from 0 (denormal) to 255 (infinite).
pub type SizeClasses = [SizeClass; CLASSES];

const NO_CLASSES: SizeClasses = [SizeClass { boxes: 0, extent: [0.0; 3] }; CLASSES];

impl SizeClass {
    /// Adds the boxes of another class.
    #[inline(always)]
    pub fn add(&mut self, more: &Self) {
        self.boxes += more.boxes;
        self.extent = std::array::from_fn(|k| self.extent[k].max(more.extent[k]));
    }
}

#[inline(always)]
fn count(classes: &mut SizeClasses, aabb: &Aabb) {
    if aabb.is_valid() {
        let extent = aabb.extents();
        classes[size_class_of(extent)].add(&SizeClass { boxes: 1, extent });
    }
}

/// Returns the exponent of the largest extent. A NaN, of a point at infinity, counts as infinite.
#[inline(always)]
pub fn size_class_of(extent: [f32; 3]) -> usize {
    (largest(&extent).to_bits() >> 23 & 255) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(n: usize) -> Vec<Aabb> {
        (0..n).map(|i| Aabb::from_center([i as f32, 0.0, 0.0], [0.5; 3])).collect()
    }

    #[test]
    fn bounds_ignore_absent_boxes_and_are_finite() {
        let mut boxes = row(100);
        boxes.insert(50, Aabb::NOWHERE);
        for workers in [1, 2, 5] {
            let bounds = Bounds::of(&boxes, workers);
            assert_eq!((bounds.low[0], bounds.high[0], bounds.largest()), (-0.5, 99.5, 1.0));
        }
        boxes.push(Aabb::new([f32::NEG_INFINITY; 3], [f32::INFINITY; 3]));
        let bounds = Bounds::of(&boxes, 1);
        assert!(bounds.width(0).is_finite() && bounds.largest() == f32::INFINITY);
    }

    #[test]
    fn size_classes_count_valid_boxes_by_power_of_two() {
        let boxes = [
            Aabb::NOWHERE,
            Aabb::new([1.0; 3], [0.0; 3]),
            Aabb::new([0.0; 3], [1.5, 0.5, 0.25]),
            Aabb::new([f32::INFINITY; 3], [f32::INFINITY; 3]),
        ];
        let classes = size_classes(&boxes, 2);
        assert_eq!((classes[127].boxes, classes[127].extent), (1, [1.5, 0.5, 0.25]));
        assert_eq!(classes[255].boxes, 1);
        assert_eq!(classes.iter().map(|class| class.boxes).sum::<u32>(), 2);
    }
}
