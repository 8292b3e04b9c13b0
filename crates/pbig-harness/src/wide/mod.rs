//! The same world in f64: poses, boxes and pairs to hold those of f32 against, near the origin and far from it.

mod layout;
mod pairs;
mod plain;
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

    /// How far a box in f32 ends inside this one, on each axis: 0 where it reaches as far.
    pub fn shortfall(&self, aabb: &Aabb) -> [f64; 3] {
        let [min, max] = [aabb.min, aabb.max].map(|corner| corner.map(f64::from));
        std::array::from_fn(|k| (min[k] - self.min[k]).max(self.max[k] - max[k]).max(0.0))
    }
}

/// What rounding in f64 may have done to the distance of two boxes of poses that are `farthest` from the origin at most: nearer
/// than that they neither touch nor are they apart. Tens of roundings, each by 2^-53 of that.
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
