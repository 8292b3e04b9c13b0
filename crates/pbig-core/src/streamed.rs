//! Pairs by streamed segment trees, for boxes that cross and cannot be cut apart: work of n log^3 n and the pairs, whatever the boxes
//! (Zomorodian and Edelsbrunner, "Fast software for box intersections", 2002).
//!
//! On each axis the one of two boxes that begins later is a *point* in the other one's *interval*. Points are halved again and again.
//! An interval with all points of a part goes on to the next axis with them; one with some goes on to both halves. What is left on
//! the last axis overlaps, without a test.

use crate::grid::{Hits, Rule};
use crate::parallel::{SharedSlice, run_with};
use crate::policy::PARALLEL_FROM_BOXES;
use crate::{Aabb, Pair};

/// Maximum number of intervals or points for a test of all of them.
const FEW: usize = 16;

/// Number of parts of many points that threads share. It does not follow the threads, because the work is counted.
const PARTS: usize = 16;

/// Number of pairs that are kept together.
const BATCH: usize = 4096;

/// A box by ranks: on each axis the place of its begin among the begins of all boxes, and the number of begins up to its end.
#[repr(align(32))]
#[derive(Clone, Copy, Debug, Default)]
struct Ranked {
    begin: [u32; 3],
    end: [u32; 3],
    id: u32,
}

impl Ranked {
    /// Returns true if a box begins after this one, before it ends.
    #[inline(always)]
    fn has(&self, point: &Self, axis: usize) -> bool {
        (self.begin[axis] < point.begin[axis]) & (point.begin[axis] < self.end[axis])
    }

    #[inline(always)]
    fn overlaps(&self, other: &Self) -> bool {
        (0..3).all(|k| (self.begin[k] < other.end[k]) & (other.begin[k] < self.end[k]))
    }
}

/// Finds all pairs of some boxes; with a `split`, the pairs of an id below it and an id from it on.
pub(crate) fn find_pairs(boxes: &[Aabb], split: Option<u32>, rule: &Rule<'_>, hits: &mut [Hits]) {
    let all = ranked(boxes);
    match split.map(|split| all.partition_point(|one| one.id < split)) {
        None => stream(&all, &all, rule, hits),
        Some(split) => {
            let (first, second) = all.split_at(split);
            stream(first, second, rule, hits);
            stream(second, first, rule, hits);
        }
    }
}

/// Returns the valid boxes by ranks, in the order of ids.
fn ranked(boxes: &[Aabb]) -> Vec<Ranked> {
    let is_valid = |id: &u32| boxes[*id as usize].is_valid();
    let ids: Vec<u32> = (0..boxes.len() as u32).filter(is_valid).collect();
    let mut all: Vec<Ranked> = ids.iter().map(|&id| Ranked { id, ..Ranked::default() }).collect();
    let mut begins: Vec<(f32, u32)> = Vec::new();
    for axis in 0..3 {
        // Without a sign of zero, because the numbers decide.
        let begin = |(at, id): (u32, &u32)| (boxes[*id as usize].min[axis] + 0.0, at);
        begins.clear();
        begins.extend((0..).zip(&ids).map(begin));
        begins.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for (rank, (_, at)) in (0..).zip(&begins) {
            all[*at as usize].begin[axis] = rank;
        }
        for one in &mut all {
            let end = boxes[one.id as usize].max[axis];
            one.end[axis] = begins.partition_point(|(begin, _)| *begin <= end) as u32;
        }
    }
    all
}

/// Finds the pairs of an interval and a point on the last axis that overlap on the other ones.
fn stream(intervals: &[Ranked], points: &[Ranked], rule: &Rule<'_>, hits: &mut [Hits]) {
    let mut points = points.to_vec();
    points.sort_unstable_by_key(|point| point.begin[2]);
    let parts = if points.len() < PARALLEL_FROM_BOXES { 1 } else { PARTS };
    let (len, size) = (points.len(), points.len().div_ceil(parts).max(1));
    let points = SharedSlice::new(&mut points);
    run_with(hits, len.div_ceil(size), |hits, part| {
        // SAFETY: each part has its own points.
        let points = unsafe { points.part(part * size..len.min((part + 1) * size)) };
        let mut stream = Stream { rule, from: hits.pairs.len(), hits };
        stream.find(intervals, points, 2);
        stream.keep();
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
    fn find(&mut self, intervals: &[Ranked], points: &mut [Ranked], axis: usize) {
        if self.hits.is_full() {
            return;
        }
        if intervals.len().min(points.len()) <= FEW {
            return self.test_all(intervals, points, axis);
        }
        self.hits.runs += (intervals.len() + points.len()) as u64;
        let mut divided = Divided::new(intervals, points, axis);
        let (whole, partial) = divided.parts();
        if axis == 0 {
            self.push_all(whole, points);
        } else {
            self.find(whole, points, axis - 1);
            self.find(points, whole, axis - 1);
        }
        if !partial.is_empty() {
            let middle = points.len() / 2;
            points.select_nth_unstable_by_key(middle, |point| point.begin[axis]);
            let (first, rest) = points.split_at_mut(middle);
            self.find(partial, first, axis);
            self.find(partial, rest, axis);
        }
    }

    fn test_all(&mut self, intervals: &[Ranked], points: &[Ranked], axis: usize) {
        self.hits.tests += (intervals.len() * points.len()) as u64;
        for one in intervals {
            for point in points.iter().filter(|point| one.has(point, axis) & one.overlaps(point)) {
                self.push(one, point);
            }
        }
    }

    fn push_all(&mut self, intervals: &[Ranked], points: &[Ranked]) {
        self.hits.tests += (intervals.len() * points.len()) as u64;
        intervals.iter().for_each(|one| points.iter().for_each(|point| self.push(one, point)));
    }

    fn push(&mut self, one: &Ranked, other: &Ranked) {
        self.hits.pairs.push(Pair::new(one.id, other.id));
        if self.hits.pairs.len() >= self.from + BATCH {
            self.keep();
        }
    }

    /// Filters and counts the pairs so far.
    fn keep(&mut self) {
        self.hits.keep(self.from, self.rule);
        self.from = self.hits.pairs.len();
    }
}

/// The intervals that have all points, then unused room, then those that have some.
struct Divided {
    all: Vec<Ranked>,
    whole: usize,
    partial: usize,
}

impl Divided {
    fn new(intervals: &[Ranked], points: &[Ranked], axis: usize) -> Self {
        let begins = || points.iter().map(|point| point.begin[axis]);
        let (first, last) = (begins().fold(u32::MAX, u32::min), begins().fold(0, u32::max));
        let mut all = vec![Ranked::default(); intervals.len()];
        let (mut whole, mut partial) = (0, intervals.len());
        for one in intervals {
            let (begin, end) = (one.begin[axis], one.end[axis]);
            let has_all = (begin < first) & (last < end);
            let has_some = (begin < last) & (first < end) & !has_all;
            // Without a branch: written where it may belong, and counted where it does.
            all[whole] = *one;
            all[partial - 1] = *one;
            whole += usize::from(has_all);
            partial -= usize::from(has_some);
        }
        Self { all, whole, partial }
    }

    fn parts(&mut self) -> (&mut [Ranked], &mut [Ranked]) {
        let (first, partial) = self.all.split_at_mut(self.partial);
        (&mut first[..self.whole], partial)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
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
                hits.iter_mut().for_each(|hits| hits.begin(0, 0));
                find_pairs(&boxes, split.map(|split| split as u32), &Rule::listing(None, &found), &mut hits);
                let mut found = [&hits[0].pairs[..], &hits[1].pairs].concat();
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

    /// A tree cannot cut them apart, and takes n^1.5: 2.8 times as much work for each of eight times as many.
    #[test]
    fn needles_in_three_directions_take_little_more_work_each_if_they_are_more() {
        let work = [20_000, 160_000].map(|n: usize| {
            let mut random = StdRng::seed_from_u64(1);
            let needle = |i: usize| {
                let (mut at, mut half) = ([0; 3].map(|_| random.random_range(0.0f32..1.0)), [1e-9; 3]);
                (at[i % 3], half[i % 3]) = (0.5, 0.5);
                Aabb::from_center(at, half)
            };
            let boxes: Vec<Aabb> = (0..n).map(needle).collect();
            let (found, mut hits) = (AtomicU64::new(0), [Hits::default()]);
            hits[0].begin(0, 0);
            find_pairs(&boxes, None, &Rule::listing(None, &found), &mut hits);
            (hits[0].tests + hits[0].runs) as f64 / n as f64
        });
        assert!(work[1] < 1.7 * work[0], "{work:?}");
    }
}
