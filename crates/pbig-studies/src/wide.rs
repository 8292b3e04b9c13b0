//! A world in f64, beside the one in f32: its poses, boxes and pairs are the reference, near the origin and far from it.

mod layout;
mod ulps;
mod world;

pub use layout::{Layout, to_f32, to_f64};
pub use ulps::widened_by_ulps;
pub use world::{WideWorld, moved};

use pbig_core::{Aabb, Pair, oracle};
use std::ops::AddAssign;

/// A pose in f64.
pub type Pose = rapier3d::na::Isometry3<f64>;

/// A closed box in f64.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wide {
    /// Lower corner.
    pub min: [f64; 3],
    /// Upper corner.
    pub max: [f64; 3],
}

impl Wide {
    /// Returns the largest distance between two boxes along an axis; negative where they overlap on all, by at least as much.
    pub fn gap(&self, other: &Self) -> f64 {
        let gaps = (0..3).map(|k| (self.min[k] - other.max[k]).max(other.min[k] - self.max[k]));
        gaps.fold(f64::NEG_INFINITY, f64::max)
    }

    /// Returns the distance by which a box in f32 ends inside this one, on each axis; 0 where it does not.
    pub fn shortfall(&self, aabb: &Aabb) -> [f64; 3] {
        let [min, max] = [aabb.min, aabb.max].map(|corner| corner.map(f64::from));
        std::array::from_fn(|k| (min[k] - self.min[k]).max(self.max[k] - max[k]).max(0.0))
    }
}

/// Returns the largest error of a distance between two boxes in f64 whose poses are at most `farthest` from the origin. If
/// boxes are nearer to each other than that, they count neither as touching nor as apart. The error is tens of roundings,
/// each by 2^-53 of `farthest`.
pub fn doubt(farthest: f64) -> f64 {
    (farthest + 1.0) * 64.0 * f64::EPSILON
}

/// Returns every pair of boxes that overlap, in order, with its gap: by brute force over the boxes rounded outward to f32.
fn pairs(boxes: &[Wide]) -> Vec<(Pair, f64)> {
    let outward: Vec<Aabb> = boxes.iter().map(|one| Aabb::from_f64(one.min, one.max)).collect();
    let gap = |pair: Pair| (pair, boxes[pair.a as usize].gap(&boxes[pair.b as usize]));
    oracle::pairs(&outward).into_iter().map(gap).filter(|(_, gap)| *gap <= 0.0).collect()
}

/// Boxes in f64 and their pairs.
pub struct Truth {
    /// The boxes.
    pub boxes: Vec<Wide>,
    /// Their pairs, in order, with gaps.
    pub pairs: Vec<(Pair, f64)>,
    /// Boxes nearer to touching than this count neither as a pair nor as none.
    pub doubt: f64,
}

/// The differences of pairs from the true ones.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Differences {
    /// True pairs that are not among them.
    pub missed: u64,
    /// Missed pairs whose boxes overlap by more than the given depth.
    pub missed_deep: u64,
    /// Others that are.
    pub added: u64,
}

impl AddAssign for Differences {
    fn add_assign(&mut self, other: Self) {
        self.missed += other.missed;
        self.missed_deep += other.missed_deep;
        self.added += other.added;
    }
}

impl Truth {
    /// Finds the pairs.
    pub fn of(boxes: Vec<Wide>, doubt: f64) -> Self {
        let pairs = pairs(&boxes);
        Self { boxes, pairs, doubt }
    }

    /// Compares with pairs in order; `deep` is the overlap from which a missed one also counts as [`Differences::missed_deep`].
    pub fn differences(&self, found: &[Pair], deep: f64) -> Differences {
        let is_lost = |&(pair, gap): &(Pair, f64)| gap < -self.doubt && found.binary_search(&pair).is_err();
        let lost: Vec<f64> = self.pairs.iter().copied().filter(is_lost).map(|(_, gap)| gap).collect();
        let missed_deep = lost.iter().filter(|gap| **gap < -deep - self.doubt).count() as u64;
        let gap = |pair: &Pair| self.boxes[pair.a as usize].gap(&self.boxes[pair.b as usize]);
        let added = found.iter().filter(|pair| gap(pair) > self.doubt).count() as u64;
        Differences { missed: lost.len() as u64, missed_deep, added }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube(x: f64) -> Wide {
        Wide { min: [x, 0.0, 0.0], max: [x + 1.0, 1.0, 1.0] }
    }

    #[test]
    fn missed_and_added_pairs_are_counted_and_those_in_doubt_are_not() {
        let truth = Truth::of([0.0, 0.5, 1.25, 2.25 + 1e-12].map(cube).to_vec(), 1e-9);
        let pair = Pair::new;
        assert_eq!(truth.pairs, [(pair(0, 1), -0.5), (pair(1, 2), -0.25)]);
        let differences = |found: &[Pair], deep| {
            let d = truth.differences(found, deep);
            [d.missed, d.missed_deep, d.added]
        };
        assert_eq!(differences(&[pair(0, 1), pair(1, 2)], 0.0), [0, 0, 0]);
        // The third and fourth touch, as far as f64 tells.
        assert_eq!(differences(&[pair(2, 3)], 0.3), [2, 1, 0]);
        assert_eq!(differences(&[pair(0, 1), pair(0, 2), pair(1, 2)], 0.0), [0, 0, 1]);
    }
}
