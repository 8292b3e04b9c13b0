//! Sorting boxes so that eight in a row are near each other, and so are eight such eights, and so on.

use super::node::LANES;
use crate::Aabb;
use crate::parallel::{SharedSlice, available_threads, both, run};
use crate::policy::PARALLEL_FROM_BOXES;
use std::ops::Range;

/// Bits of an exponent within a class. Boxes of one class differ in size by less than 16 times, and the same axes are long,
/// within 16 times of the longest: a large or long box among others would make their node large.
const CLASS_BITS: u32 = 2;

/// A box as the sort reads it: 20 bytes, as it is moved once for each level of the tree.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    center: [f32; 3],
    /// The exponents of its extents, and of the largest one (the highest byte).
    exponents: [u8; 4],
    pub(super) id: u32,
}

impl Entry {
    pub(super) fn new(id: u32, aabb: &Aabb) -> Self {
        let end = |x: f32| x.clamp(f32::MIN / 4.0, f32::MAX / 4.0);
        let [x, y, z] = std::array::from_fn(|k| exponent(aabb.max[k] - aabb.min[k]));
        let center = std::array::from_fn(|k| end(aabb.min[k]) + end(aabb.max[k]));
        Self { center, exponents: [x, y, z, x.max(y).max(z)], id }
    }

    /// Returns the class of the box; boxes with ids from `split` on are in classes of their own, the higher ones.
    fn class(&self, split: u32) -> u32 {
        let [x, y, z, largest] = self.exponents;
        let is_long = |exponent: u8| u32::from(largest - exponent < 1 << CLASS_BITS);
        let class = u32::from(largest >> CLASS_BITS) << 3 | is_long(x) << 2 | is_long(y) << 1 | is_long(z);
        u32::from(self.id >= split) << 31 | class
    }
}

/// Returns the exponent's bits of a number that is not negative; those of infinity for a NaN.
fn exponent(x: f32) -> u8 {
    (x.to_bits() >> 23) as u8
}

/// Returns a number with such an exponent.
fn with_exponent(exponent: u8) -> f64 {
    f64::from(f32::from_bits(u32::from(exponent.min(254)) << 23))
}

/// Sorts boxes by class, and within a class by place. Returns the classes. Boxes with ids from `split` on are another set: no class
/// has boxes of both. But both are cut alike, because boxes that are long in one set keep those of the other from being cut across.
pub(super) fn sort(entries: &mut [Entry], split: u32) -> Vec<Range<usize>> {
    let are_alike = |a: &Entry, b: &Entry| a.class(split) == b.class(split);
    if entries.windows(2).any(|two| !are_alike(&two[0], &two[1])) {
        entries.sort_unstable_by_key(|entry| entry.class(split));
    }
    let all: Vec<Measure> = entries.chunk_by(are_alike).map(Measure::of).collect();
    let (mut classes, mut first): (Vec<Range<usize>>, _) = (Vec::new(), 0);
    for class in entries.chunk_by(are_alike) {
        classes.push(first..first + class.len());
        first += class.len();
    }
    let workers = if entries.len() < PARALLEL_FROM_BOXES { 1 } else { available_threads() };
    let shared = SharedSlice::new(entries);
    run(workers, classes.len(), |_, class| {
        // SAFETY: classes have different boxes.
        sort_by_place(unsafe { shared.part(classes[class].clone()) }, &all);
    });
    classes
}

/// Halves a list again and again at the median of its best axis. Medians are ranks, so that a box far away costs the others
/// nothing. The cuts lie between whole nodes of the level in question.
fn sort_by_place(mut entries: &mut [Entry], all: &[Measure]) {
    while entries.len() > LANES {
        let (axis, middle) = (best_axis(entries, all), cut(entries.len()));
        let is_few = entries.len() < PARALLEL_FROM_BOXES;
        entries.select_nth_unstable_by(middle, |a, b| a.center[axis].total_cmp(&b.center[axis]));
        let (first, rest) = entries.split_at_mut(middle);
        if is_few {
            sort_by_place(first, all);
            entries = rest;
        } else {
            return both(|| sort_by_place(first, all), || sort_by_place(rest, all));
        }
    }
}

/// Returns a multiple of the boxes in a child, about half of all.
fn cut(len: usize) -> usize {
    let mut child = LANES;
    while child * LANES < len {
        child *= LANES;
    }
    child * (len.div_ceil(child) / 2).max(1)
}

/// Maximum difference, as a share, at which two axes count as equal. A part that is smaller than the boxes around it has equal
/// axes, and rounding would choose one of them again and again.
const TIE: f64 = 0.01;

/// Returns the axis along which the boxes lie apart most: the spread of their centers is longest, compared with their own
/// extents and the mean extents of the boxes of `all` classes. (Compared with their own alone, thin tiles would be cut into slabs
/// as wide as the world, and slabs of tiles that stand in two directions all meet.)
fn best_axis(entries: &[Entry], all: &[Measure]) -> usize {
    let Measure { spread, extents, .. } = Measure::of(entries);
    let extents: [f64; 3] = std::array::from_fn(|k| extents[k] + mean_within(all, k, spread[k]));
    let compare = |a: usize, b: usize| {
        let (one, other) = (spread[a] * extents[b], spread[b] * extents[a]);
        let is_tie = (one - other).abs() <= TIE * one.max(other);
        if is_tie { spread[a].total_cmp(&spread[b]) } else { one.total_cmp(&other) }
    };
    (0..3).max_by(|a, b| compare(*a, *b)).unwrap_or(0)
}

/// Returns the mean extent of all boxes on an axis. A box that is longer than `spread` meets both halves of a cut, and counts as
/// that long: so a few infinite boxes do not keep others from being cut.
fn mean_within(all: &[Measure], axis: usize, spread: f64) -> f64 {
    let (mut sum, mut boxes) = (0.0, 0.0);
    for class in all {
        sum += class.boxes * class.extents[axis].min(spread);
        boxes += class.boxes;
    }
    sum / boxes
}

/// Some boxes: their number, the spread of their centers and their mean extents, by axis.
#[derive(Clone, Copy, Debug)]
struct Measure {
    boxes: f64,
    spread: [f64; 3],
    extents: [f64; 3],
}

impl Measure {
    fn of(entries: &[Entry]) -> Self {
        let (mut low, mut high, mut extents) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3], [0.0; 3]);
        for entry in entries {
            for k in 0..3 {
                low[k] = low[k].min(entry.center[k]);
                high[k] = high[k].max(entry.center[k]);
                extents[k] += with_exponent(entry.exponents[k]);
            }
        }
        let boxes = entries.len().max(1) as f64;
        let spread = std::array::from_fn(|k| (f64::from(high[k]) - f64::from(low[k])).max(0.0));
        Self { boxes, spread, extents: extents.map(|sum: f64| sum / boxes) }
    }
}
