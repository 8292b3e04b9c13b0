//! Sorting boxes so that eight in a row are near each other, and so are eight such eights, and so on.

use super::node::LANES;
use crate::Aabb;
use std::ops::Range;

/// Bits of a size's exponent within a class: boxes of one class differ in size by less than 16 times. A large box among small
/// ones would make their node large.
const CLASS_BITS: u32 = 2;

/// A box as the sort reads it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    center: [f32; 3],
    class: u32,
    pub(super) id: u32,
}

impl Entry {
    pub(super) fn new(id: u32, aabb: &Aabb) -> Self {
        let end = |x: f32| x.clamp(f32::MIN / 4.0, f32::MAX / 4.0);
        let extent = (0..3).map(|k| aabb.max[k] - aabb.min[k]).fold(0.0, f32::max);
        let center = std::array::from_fn(|k| end(aabb.min[k]) + end(aabb.max[k]));
        Self { center, class: extent.to_bits() >> (23 + CLASS_BITS), id }
    }
}

/// Sorts boxes by class, and within a class by place. Returns the classes.
pub(super) fn sort(entries: &mut [Entry]) -> Vec<Range<usize>> {
    if entries.windows(2).any(|two| two[0].class != two[1].class) {
        entries.sort_unstable_by_key(|entry| entry.class);
    }
    let (mut classes, mut first) = (Vec::new(), 0);
    for class in entries.chunk_by_mut(|a, b| a.class == b.class) {
        sort_by_place(class);
        classes.push(first..first + class.len());
        first += class.len();
    }
    classes
}

/// Halves a list again and again at the median of its longest axis. Medians are ranks, so that a box far away costs the others
/// nothing. The cuts lie between whole nodes of the level in question.
fn sort_by_place(mut entries: &mut [Entry]) {
    while entries.len() > LANES {
        let axis = longest_axis(entries);
        let middle = cut(entries.len());
        entries.select_nth_unstable_by(middle, |a, b| a.center[axis].total_cmp(&b.center[axis]));
        let (first, rest) = entries.split_at_mut(middle);
        sort_by_place(first);
        entries = rest;
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

fn longest_axis(entries: &[Entry]) -> usize {
    let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for entry in entries {
        for k in 0..3 {
            low[k] = low[k].min(entry.center[k]);
            high[k] = high[k].max(entry.center[k]);
        }
    }
    let spread = |k: &usize| high[*k] - low[*k];
    (0..3).max_by(|a, b| spread(a).total_cmp(&spread(b))).unwrap_or(0)
}
