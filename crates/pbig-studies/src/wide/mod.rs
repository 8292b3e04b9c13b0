//! A world in f64, beside the one in f32: its poses, boxes and pairs are the reference, near the origin and far from it.

mod layout;
mod pairs;
mod shape;
mod ulps;
mod world;

pub use layout::{Layout, to_f32, to_f64};
pub use pairs::{Differences, Truth, pairs};
pub use shape::aabb;
pub use ulps::widened_by_ulps;
pub use world::{WideWorld, moved};

use pbig_core::Aabb;

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
    /// Grown on every side.
    pub fn inflated(&self, by: f64) -> Self {
        Self { min: self.min.map(|x| x - by), max: self.max.map(|x| x + by) }
    }

    /// The largest distance between two boxes along an axis; negative where they overlap on all, by at least as much.
    pub fn gap(&self, other: &Self) -> f64 {
        let gaps = (0..3).map(|k| (self.min[k] - other.max[k]).max(other.min[k] - self.max[k]));
        gaps.fold(f64::NEG_INFINITY, f64::max)
    }

    /// The smallest box in f32 that holds it.
    pub fn outward(&self) -> Aabb {
        Aabb::from_f64(self.min, self.max)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_and_shortfalls_by_hand() {
        let cube = |x: f64| Wide { min: [x, 0.0, 0.0], max: [x + 1.0, 1.0, 1.0] };
        assert_eq!(cube(0.0).gap(&cube(1.5)), 0.5);
        assert_eq!(cube(1.5).gap(&cube(0.75)), -0.25);
        assert_eq!(cube(0.0).inflated(0.25).gap(&cube(1.5).inflated(0.25)), 0.0);
        let short = Aabb::new([0.25, -1.0, 0.0], [1.0, 1.0, 0.5]);
        assert_eq!(cube(0.0).shortfall(&short), [0.25, 0.0, 0.5]);
        assert_eq!(cube(0.1).shortfall(&cube(0.1).outward()), [0.0; 3]);
    }
}
