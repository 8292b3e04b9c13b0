//! Sorting boxes so that eight in a row are near each other, and so are eight such eights, and so on.

use super::node::LANES;
use crate::Aabb;
use crate::aabb::ordered;
use crate::parallel::{available_threads, both, run_parts, split_into};
use crate::policy::PARALLEL_FROM_BOXES;
use crate::simd::{Simd, dispatch};
use arrayvec::ArrayVec;
use std::ops::Range;

/// Bits of an exponent within a class. Boxes of one class differ in size by less than 16 times, and the same axes are long,
/// within 16 times of the longest: a large or long box among others would make their node large.
const CLASS_BITS: u32 = 2;

/// Maximum number of sampled boxes of a class, and of all other classes that a class is sorted beside.
const MAX_SAMPLED: usize = 64;

/// Approximate maximum number of sampled boxes of all classes: each class looks at all of them, and there may be hundreds of classes.
const MAX_SAMPLED_IN_ALL: usize = 2048;

/// Minimum number of sampled boxes around a part that tell which are around its halves.
const MIN_SAMPLED: usize = 16;

/// Maximum number of boxes that are parted by sorting words, which takes no branch for each comparison.
const MAX_SORTED: usize = 64;

#[derive(Clone, Copy, Debug)]
pub(super) struct Order {
    /// The first id of the second of two sets: no leaf has boxes of both. Above all ids if there is one set.
    pub(super) split: u32,
    /// Boxes in a leaf.
    pub(super) leaf: usize,
}

impl Order {
    /// One set in full leaves.
    pub(super) const SORTED: Self = Self { split: u32::MAX, leaf: LANES };
    /// One set, and in each leaf room for a box that comes.
    pub(super) const ROOMY: Self = Self { leaf: LANES - 1, ..Self::SORTED };
}

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

    /// Returns true if the classes of these boxes differ and a join meets both. Between two sets, split by id, it meets classes
    /// of different sets only.
    fn may_meet(&self, other: &Self, split: u32) -> bool {
        let (one, other) = (self.class(split), other.class(split));
        let has_sets = split != u32::MAX;
        one != other && (!has_sets || (one ^ other) >> 31 == 1)
    }
}

/// Returns the exponent's bits of a number that is not negative; those of the largest numbers for infinity and a NaN.
fn exponent(x: f32) -> u8 {
    ((x.to_bits() >> 23) as u8).min(254)
}

/// Returns the number with this exponent, a power of two.
#[inline(always)]
fn with_exponent(exponent: u8) -> f64 {
    f64::from(f32::from_bits(u32::from(exponent) << 23))
}

/// Sorts boxes by class, and within a class by place. Returns the classes. Two sets have
/// classes of their own. But the cuts of a set take the boxes of the other set into account, so that few of these lie across a
/// cut.
pub(super) fn sort(entries: &mut [Entry], Order { split, leaf }: Order) -> Vec<Range<usize>> {
    let classes = sort_by_class(entries, split);
    let samples = sampled(entries, &classes);
    let workers = if entries.len() < PARALLEL_FROM_BOXES { 1 } else { available_threads() };
    run_parts(workers, split_into(entries, classes.iter().map(Range::len)), |_, class| {
        if class.len() <= leaf {
            return;
        }
        let may_meet = |sample: &Sampled| sample.entry.may_meet(&class[0], split);
        let samples = samples.iter().copied().filter(may_meet).collect();
        sort_by_place(class, leaf, &Others { samples, is_few: false });
    });
    classes
}

/// Sorts boxes by class. Returns the classes.
fn sort_by_class(entries: &mut [Entry], split: u32) -> Vec<Range<usize>> {
    let Some(class) = entries.first().map(|entry| entry.class(split)) else { return Vec::new() };
    if entries.iter().all(|entry| entry.class(split) == class) {
        return std::iter::once(0..entries.len()).collect();
    }
    entries.sort_unstable_by_key(|entry| entry.class(split));
    let mut end = 0;
    let classes = entries.chunk_by(|a, b| a.class(split) == b.class(split)).map(|class| {
        end += class.len();
        end - class.len()..end
    });
    classes.collect()
}

/// Returns boxes that stand for those of each class: the fewer of one, the more classes there are.
fn sampled(entries: &[Entry], classes: &[Range<usize>]) -> Vec<Sampled> {
    let most = (MAX_SAMPLED_IN_ALL / classes.len().max(1)).clamp(1, MAX_SAMPLED);
    classes.iter().flat_map(|class| Sampled::of(&entries[class.clone()], most)).collect()
}

/// Halves a list again and again at the median of its best axis. Medians are ranks, so that a box far away costs the others
/// nothing. The cuts lie between whole nodes of the level in question. `others` stand for boxes of other classes around these.
fn sort_by_place(entries: &mut [Entry], leaf: usize, others: &Others) {
    if entries.len() <= leaf {
        return;
    }
    let part = dispatch!(Measure::of, entries);
    let mut near = others.near(&part);
    let (axis, middle) = (best_axis(&part, &near.samples), cut(entries.len(), leaf));
    near.halve(&part, axis);
    let is_few = entries.len() < PARALLEL_FROM_BOXES;
    part_at(entries, middle, axis);
    let (first, rest) = entries.split_at_mut(middle);
    if is_few {
        sort_by_place(first, leaf, &near);
        sort_by_place(rest, leaf, &near);
    } else {
        both(|| sort_by_place(first, leaf, &near), || sort_by_place(rest, leaf, &near));
    }
}

/// Moves the boxes with the least centers on an axis before the middle.
fn part_at(entries: &mut [Entry], middle: usize, axis: usize) {
    let Ok(all) = ArrayVec::<Entry, MAX_SORTED>::try_from(&*entries) else {
        entries.select_nth_unstable_by(middle, |a, b| a.center[axis].total_cmp(&b.center[axis]));
        return;
    };
    let word = |(i, entry): (u64, &Entry)| u64::from(ordered(entry.center[axis])) << 32 | i;
    let mut words: ArrayVec<u64, MAX_SORTED> = (0..).zip(&all).map(word).collect();
    words.sort_unstable();
    for (entry, word) in entries.iter_mut().zip(words) {
        *entry = all[word as u32 as usize];
    }
}

/// Returns a multiple of the boxes in a child, about half of all.
fn cut(len: usize, leaf: usize) -> usize {
    let mut child = leaf;
    while child * LANES < len {
        child *= LANES;
    }
    child * (len.div_ceil(child) / 2).max(1)
}

/// Maximum difference, as a share, at which two axes count as equal. A part that is smaller than the boxes around it has equal
/// axes, and rounding would choose one of them again and again.
const TIE: f64 = 0.01;

/// Minimum own extent that counts, as a share of the middle one of three.
const LEAST_EXTENT: f64 = 1.0 / 16.0;

/// Minimum number of extents that flat boxes lie apart for the least extent to count: sheets in a thin stack are cut across it.
const LEAST_APART: f64 = 4.0;

/// Returns the axis along which the boxes lie apart most: the spread of their centers is longest, compared with their own extents
/// and the mean extents of all boxes in the same place. (If only their own extents counted, thin tiles would be cut into slabs as
/// wide as the world. Slabs of tiles that stand in two directions all meet each other, and a ray across them meets all. Flat boxes at
/// many heights would be cut so, too: hence the least extent.)
fn best_axis(part: &Measure, others: &[Sampled]) -> usize {
    let Measure { spread, extents, .. } = part;
    let mut sorted = *extents;
    sorted.sort_unstable_by(f64::total_cmp);
    let least = LEAST_EXTENT * sorted[1];
    let own = |k: usize| extents[k].max(least.min(spread[k] / LEAST_APART));
    let extents: [f64; 3] = std::array::from_fn(|k| own(k) + part.mean_within(others, k));
    let compare = |a: usize, b: usize| {
        let (one, other) = (spread[a] * extents[b], spread[b] * extents[a]);
        let is_tie = (one - other).abs() <= TIE * one.max(other);
        if is_tie { spread[a].total_cmp(&spread[b]) } else { one.total_cmp(&other) }
    };
    (0..3).max_by(|a, b| compare(*a, *b)).unwrap_or(0)
}

/// A box that stands for others of its class.
#[derive(Clone, Copy, Debug)]
struct Sampled {
    entry: Entry,
    /// The number of boxes.
    boxes: f64,
}

impl Sampled {
    /// Yields some boxes of a class, about `most`.
    fn of(class: &[Entry], most: usize) -> impl Iterator<Item = Self> {
        let step = class.len().div_ceil(most);
        let boxes = class.len() as f64 / class.len().div_ceil(step) as f64;
        scattered(class.len(), step).map(move |i| Self { entry: class[i], boxes })
    }
}

/// Yields a number of every `step` below an end, each somewhere else in its part: a pattern in the order of the boxes cannot bias a
/// sample.
fn scattered(end: usize, step: usize) -> impl Iterator<Item = usize> {
    const GOLDEN: u64 = 0x9E37_79B9_7F4A_7C15;
    let at = move |first: usize| {
        let hash = (first as u64).wrapping_mul(GOLDEN) >> 32;
        first + ((hash * step as u64) >> 32) as usize
    };
    (0..end).step_by(step).map(at).filter(move |at| *at < end)
}

/// Boxes of other classes that may meet those of a part.
#[derive(Clone, Debug)]
struct Others {
    samples: Vec<Sampled>,
    /// True if the samples are too few to tell which of them are near half of the part. Their expected number is used instead.
    is_few: bool,
}

impl Others {
    /// Returns the boxes that may overlap a part, or a sample of them if they are many.
    fn near(&self, part: &Measure) -> Self {
        if self.is_few {
            return self.clone();
        }
        let near = || self.samples.iter().filter(|sample| part.reaches(sample));
        let count = near().count();
        let step = count.div_ceil(MAX_SAMPLED).max(1);
        let boxes = |sample: &Sampled| sample.boxes * step as f64;
        let samples = near().step_by(step).map(|sample| Sampled { boxes: boxes(sample), ..*sample });
        Self { samples: samples.collect(), is_few: count < MIN_SAMPLED }
    }

    /// Reduces the number of boxes to those expected near one half of a part, if the samples are too few.
    fn halve(&mut self, part: &Measure, axis: usize) {
        if self.is_few {
            let width = part.spread[axis] + part.extents[axis];
            for sample in &mut self.samples {
                let extent = with_exponent(sample.entry.exponents[axis]);
                sample.boxes *= (0.5 * width + extent) / (width + extent);
            }
        }
    }
}

/// Some boxes: their number, the range and the spread of their centers, their mean and largest extents, by axis.
#[derive(Clone, Copy, Debug)]
struct Measure {
    boxes: f64,
    low: [f32; 3],
    high: [f32; 3],
    spread: [f64; 3],
    extents: [f64; 3],
    largest: [u8; 3],
}

impl Measure {
    /// The fourth lane is no axis: four become a vector.
    #[inline(always)]
    fn of(_: impl Simd, entries: &[Entry]) -> Self {
        let (mut low, mut high) = ([f32::INFINITY; 4], [f32::NEG_INFINITY; 4]);
        let (mut sums, mut largest) = ([0.0f64; 4], [0; 4]);
        for Entry { center: [x, y, z], exponents, .. } in entries {
            let center = [*x, *y, *z, *z];
            for k in 0..4 {
                low[k] = if center[k] < low[k] { center[k] } else { low[k] };
                high[k] = if center[k] > high[k] { center[k] } else { high[k] };
                sums[k] += with_exponent(exponents[k]);
                largest[k] = exponents[k].max(largest[k]);
            }
        }
        let boxes = entries.len().max(1) as f64;
        let spread = std::array::from_fn(|k| (f64::from(high[k]) - f64::from(low[k])).max(0.0));
        let three = |[x, y, z, _]: [f32; 4]| [x, y, z];
        let extents = std::array::from_fn(|k| sums[k] / boxes);
        let [x, y, z, _] = largest;
        Self { boxes, low: three(low), high: three(high), spread, extents, largest: [x, y, z] }
    }

    /// Returns true if a box may overlap the bounds of these boxes. Centers are sums of two corners, so that two whole extents, each
    /// below two powers of two, keep them apart.
    fn reaches(&self, other: &Sampled) -> bool {
        (0..3).all(|k| {
            let reach = 2.0 * (with_exponent(self.largest[k]) + with_exponent(other.entry.exponents[k]));
            let center = f64::from(other.entry.center[k]);
            f64::from(self.low[k]) - reach <= center && center <= f64::from(self.high[k]) + reach
        })
    }

    /// Returns the mean extent of these and others on an axis. A box that is longer than the spread meets both halves of a cut, and
    /// counts as that long: so a few infinite boxes do not keep others from being cut.
    fn mean_within(&self, others: &[Sampled], axis: usize) -> f64 {
        let (spread, own) = (self.spread[axis], self.extents[axis]);
        let (mut sum, mut boxes) = (self.boxes * own.min(spread), self.boxes);
        for other in others {
            sum += other.boxes * with_exponent(other.entry.exponents[axis]).min(spread);
            boxes += other.boxes;
        }
        sum / boxes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each class looks at the samples of all.
    #[test]
    fn many_classes_have_few_samples_each() {
        let entries: Vec<Entry> =
            (0..30_000).map(|id| Entry::new(id, &Aabb::new([0.0; 3], [1.0; 3]))).collect();
        for (classes, most) in [(1, 64), (32, 2048), (33, 2046), (500, 2000), (3000, 3000)] {
            let len = entries.len() / classes;
            let ranges: Vec<_> = (0..classes).map(|class| class * len..(class + 1) * len).collect();
            let samples = sampled(&entries, &ranges);
            assert!((most / 2..=most).contains(&samples.len()), "{classes}: {}", samples.len());
        }
    }

    #[test]
    fn parts_have_the_lesser_centers_whether_words_are_sorted_or_not() {
        for len in [2, 8, MAX_SORTED - 1, MAX_SORTED, MAX_SORTED + 1, 500] {
            let x = |i: usize| [-0.0, 0.0, (i * 7919 % len) as f32 - 20.0, f32::MAX / 8.0][i % 4];
            let at = |i: usize| Aabb::from_center([0.0, x(i), 0.0], [0.5; 3]);
            let mut entries: Vec<Entry> = (0..len).map(|i| Entry::new(i as u32, &at(i))).collect();
            for place in [1, len / 2, len - 1] {
                part_at(&mut entries, place, 1);
                let (first, rest) = entries.split_at(place);
                let most = first.iter().map(|entry| entry.center[1]).fold(f32::MIN, f32::max);
                assert!(rest.iter().all(|entry| most <= entry.center[1]), "{len} at {place}");
                let mut ids: Vec<u32> = entries.iter().map(|entry| entry.id).collect();
                ids.sort_unstable();
                assert!(ids.into_iter().eq(0..len as u32));
            }
        }
    }
}
