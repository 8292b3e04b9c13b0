//! Pairs by streamed segment trees, for boxes that cross and cannot be cut apart: work of n log^3 n and the pairs, whatever the boxes
//! (Zomorodian and Edelsbrunner, "Fast software for box intersections", 2002).
//!
//! On each axis the one of two boxes that begins later is a *point* in the other one's *interval*. Points are halved again and again.
//! An interval with all points of a part goes on to the next axis with them; one with some goes on to both halves. What is left on
//! the last axis overlaps, without a test.

use super::hits::{Hits, Rule};
use crate::aabb::ordered;
use crate::parallel::run_parts_with;
use crate::policy::PARALLEL_FROM_BOXES;
use crate::{Aabb, Pair};

/// Maximum number of intervals or points for a test of all of them.
const FEW: usize = 16;

/// Number of parts of many points that threads share. It does not follow the threads, because the work is counted.
const PARTS: usize = 16;

/// A box with integers for corners, in the order of its coordinates.
#[repr(align(32))]
#[derive(Clone, Copy, Debug, Default)]
struct Corners {
    begin: [u32; 3],
    end: [u32; 3],
    id: u32,
}

impl Corners {
    fn new(id: u32, aabb: &Aabb) -> Self {
        Self { begin: aabb.min.map(ordered), end: aabb.max.map(ordered), id }
    }

    /// Returns the place of the box among all as a point: of two boxes that begin together, the one with the lower id comes first.
    #[inline(always)]
    fn point(&self, axis: usize) -> u64 {
        u64::from(self.begin[axis]) << 32 | u64::from(self.id)
    }

    /// Returns true if this one begins before a point, and does not end before it.
    #[inline(always)]
    fn has(&self, point: u64, axis: usize) -> bool {
        (self.point(axis) < point) & ((point >> 32) as u32 <= self.end[axis])
    }

    #[inline(always)]
    fn overlaps(&self, other: &Self) -> bool {
        (0..3).all(|k| (self.begin[k] <= other.end[k]) & (other.begin[k] <= self.end[k]))
    }
}

/// Finds all pairs of some boxes; with a `split`, the pairs of an id below it and an id from it on. Returns how many boxes are valid.
pub(crate) fn find_pairs(boxes: &[Aabb], split: Option<u32>, rule: &Rule<'_>, hits: &mut [Hits]) -> usize {
    let valid = (0..).zip(boxes).filter(|(_, aabb)| aabb.is_valid());
    let all: Vec<Corners> = valid.map(|(id, aabb)| Corners::new(id, aabb)).collect();
    match split.map(|split| all.partition_point(|one| one.id < split)) {
        None => stream(&all, &all, rule, hits),
        Some(split) => {
            let (first, second) = all.split_at(split);
            stream(first, second, rule, hits);
            stream(second, first, rule, hits);
        }
    }
    all.len()
}

/// Finds the pairs of an interval and a point on the last axis that overlap on the other ones.
fn stream(intervals: &[Corners], points: &[Corners], rule: &Rule<'_>, hits: &mut [Hits]) {
    let mut points = points.to_vec();
    points.sort_unstable_by_key(|point| point.point(2));
    let parts = if points.len() < PARALLEL_FROM_BOXES { 1 } else { PARTS };
    let size = points.len().div_ceil(parts).max(1);
    run_parts_with(hits, points.chunks_mut(size), |hits, _, points| {
        let mut stream = Stream { rule, from: hits.found.pairs.len(), hits };
        stream.find(intervals, points, 2);
        stream.hits.keep(stream.from, rule);
    });
}

struct Stream<'a, 'b> {
    rule: &'a Rule<'b>,
    hits: &'a mut Hits,
    /// The first pair that is not kept yet.
    from: usize,
}

impl Stream<'_, '_> {
    /// Finds the pairs of an interval and a point on an axis that overlap on the lower ones. On the higher ones all overlap.
    fn find(&mut self, intervals: &[Corners], points: &mut [Corners], axis: usize) {
        if self.hits.is_full {
            return;
        }
        if intervals.len().min(points.len()) <= FEW {
            return self.test_all(intervals, points, axis);
        }
        self.hits.extra += (intervals.len() + points.len()) as u64;
        let places = || points.iter().map(|point| point.point(axis));
        let (first, last) = (places().fold(u64::MAX, u64::min), places().fold(0, u64::max));
        let has_all = |one: &Corners| one.has(first, axis) & one.has(last, axis);
        let meets = |one: &Corners| (one.point(axis) < last) & ((first >> 32) as u32 <= one.end[axis]);
        let has_some = |one: &Corners| meets(one) & !has_all(one);
        let mut whole = chosen(intervals, has_all);
        if axis == 0 {
            self.push_all(&whole, points);
        } else {
            self.find(&whole, points, axis - 1);
            self.find(points, &mut whole, axis - 1);
        }
        drop(whole);
        let partial = chosen(intervals, has_some);
        if !partial.is_empty() {
            let middle = points.len() / 2;
            points.select_nth_unstable_by_key(middle, |point| point.point(axis));
            let (first, rest) = points.split_at_mut(middle);
            self.find(&partial, first, axis);
            self.find(&partial, rest, axis);
        }
    }

    fn test_all(&mut self, intervals: &[Corners], points: &[Corners], axis: usize) {
        self.hits.tests += (intervals.len() * points.len()) as u64;
        for one in intervals {
            let is_met = |point: &&Corners| one.has(point.point(axis), axis) & one.overlaps(point);
            points.iter().filter(is_met).for_each(|point| self.push(one, point));
        }
    }

    fn push_all(&mut self, intervals: &[Corners], points: &[Corners]) {
        for one in intervals {
            if self.hits.is_full {
                return;
            }
            self.hits.tests += points.len() as u64;
            points.iter().for_each(|point| self.push(one, point));
        }
    }

    fn push(&mut self, one: &Corners, other: &Corners) {
        self.hits.found.pairs.push(Pair::new(one.id, other.id));
        self.from = self.hits.keep_many(self.from, self.rule);
    }
}

/// Returns the boxes for which a condition is true. Without a branch: each is written, and the next one overwrites it unless it is
/// chosen.
fn chosen(boxes: &[Corners], is_chosen: impl Fn(&Corners) -> bool) -> Vec<Corners> {
    let (mut chosen, mut len) = (vec![Corners::default(); boxes.len()], 0);
    for one in boxes {
        chosen[len] = *one;
        len += usize::from(is_chosen(one));
    }
    chosen.truncate(len);
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::needles;
    use crate::oracle;
    use rand::rngs::StdRng;
    use rand::{RngExt, SeedableRng};
    use std::sync::atomic::AtomicU64;

    fn random_box(random: &mut StdRng, kind: u64) -> Aabb {
        let mut end = || {
            let x = random.random_range(-20.0f32..20.0);
            [x, x.round(), x.signum() * 0.0, x * f32::INFINITY][(kind as usize).min(3)]
        };
        let (one, other) = ([end(), end(), end()], [end(), end(), end()]);
        let is_thin = |k: usize| kind == 0 && (one[0] as i32).rem_euclid(3) != k as i32;
        let high = |k: usize| if is_thin(k) { one[k].min(other[k]) } else { one[k].max(other[k]) };
        Aabb::new(std::array::from_fn(|k| one[k].min(other[k])), std::array::from_fn(high))
    }

    #[test]
    fn streams_find_the_pairs_of_the_oracle() {
        let mut pairs = 0;
        for seed in 0..40 {
            let mut random = StdRng::seed_from_u64(seed);
            let boxes: Vec<Aabb> = (0..[30, 300, 900][seed as usize % 3])
                .map(|i| if i % 50 == 7 { Aabb::NOWHERE } else { random_box(&mut random, seed % 4) })
                .collect();
            for split in [None, Some(0), Some(boxes.len() / 3), Some(boxes.len())] {
                let (found, mut hits) = (AtomicU64::new(0), [Hits::default(), Hits::default()]);
                hits.iter_mut().for_each(|hits| hits.begin(None));
                find_pairs(&boxes, split.map(|split| split as u32), &Rule::listing(&found), &mut hits);
                let mut found = [&hits[0].found.pairs[..], &hits[1].found.pairs].concat();
                found.sort_unstable();
                let is_across = |pair: &Pair| {
                    split.is_none_or(|split| (pair.a as usize) < split && pair.b as usize >= split)
                };
                let wanted: Vec<Pair> = oracle::pairs(&boxes).into_iter().filter(is_across).collect();
                assert_eq!(found, wanted, "seed {seed}, split {split:?}");
                pairs += wanted.len();
            }
        }
        assert!(pairs > 100_000, "{pairs}");
    }

    /// A tree cannot cut them apart, and takes n^1.5: 2.8 times as much work for each of eight times as many. Staggered ones are only parts of
    /// each other's world.
    #[test]
    fn needles_in_three_directions_take_little_more_work_each_if_they_are_more() {
        for stagger in [0.0, 1.0] {
            let work = [20_000, 160_000].map(|n: usize| {
                let (found, mut hits) = (AtomicU64::new(0), [Hits::default()]);
                hits[0].begin(None);
                let mut boxes = needles(n);
                for (i, aabb) in boxes.iter_mut().enumerate() {
                    let by = stagger * ((i * 7919 % n) as f32 / n as f32 - 0.5);
                    (aabb.min[i % 3], aabb.max[i % 3]) = (aabb.min[i % 3] + by, aabb.max[i % 3] + by);
                }
                find_pairs(&boxes, None, &Rule::listing(&found), &mut hits);
                hits[0].work() as f64 / n as f64
            });
            println!("{stagger}: {work:?}");
            assert!(work[1] < 1.8 * work[0] && work[1] < 130.0 * 160_000f64.log2(), "{stagger}: {work:?}");
        }
    }
}
