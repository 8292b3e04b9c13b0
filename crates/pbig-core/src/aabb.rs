//! The axis-aligned bounding box (AABB), the only geometry that pbig knows.

use bytemuck::{Pod, Zeroable};

/// A closed axis-aligned box in f32, in the caller's length unit.
///
/// A box is *valid* when `min <= max` on all three axes; a NaN makes it invalid. Extents may be
/// infinite. An invalid box overlaps nothing, itself included (contract 7).
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Aabb {
    /// Lower corner.
    pub min: [f32; 3],
    /// Upper corner.
    pub max: [f32; 3],
}

impl Aabb {
    /// An invalid box: what an absent proxy is stored as.
    pub const NOWHERE: Self = Self::new([f32::NAN; 3], [f32::NAN; 3]);

    /// The box from one corner to the other.
    #[inline]
    pub const fn new(min: [f32; 3], max: [f32; 3]) -> Self {
        Self { min, max }
    }

    /// The box around `center` that reaches `half` to each side.
    pub fn from_center(center: [f32; 3], half: [f32; 3]) -> Self {
        let corner = |sign: f32| std::array::from_fn(|k| center[k] + sign * half[k]);
        Self::new(corner(-1.0), corner(1.0))
    }

    /// The smallest f32 box that contains the f64 box `[min, max]` (rounded outward). A box that
    /// is invalid in f64 stays invalid, even where rounding would close the gap.
    ///
    /// ```
    /// let b = pbig_core::Aabb::from_f64([0.1; 3], [0.1; 3]);
    /// assert!((b.min[0] as f64) < 0.1 && (b.max[0] as f64) >= 0.1);
    /// ```
    pub fn from_f64(min: [f64; 3], max: [f64; 3]) -> Self {
        if !(0..3).all(|k| min[k] <= max[k]) {
            return Self::NOWHERE;
        }
        Self::new(min.map(round_down), max.map(|x| -round_down(-x)))
    }

    /// Whether `min <= max` on all axes (false when a value is NaN).
    #[inline]
    pub fn is_valid(&self) -> bool {
        (self.min[0] <= self.max[0]) & (self.min[1] <= self.max[1]) & (self.min[2] <= self.max[2])
    }

    /// Whether two boxes share a point: PBIG's equation 1, closed intervals, exactly (contract 1).
    /// For valid boxes only: an inverted box can pass this test, see [`Aabb::is_valid`].
    #[inline(always)]
    pub fn overlaps(&self, other: &Self) -> bool {
        // `&` rather than `&&`: one predictable branch on the result instead of six.
        (self.min[0] <= other.max[0])
            & (other.min[0] <= self.max[0])
            & (self.min[1] <= other.max[1])
            & (other.min[1] <= self.max[1])
            & (self.min[2] <= other.max[2])
            & (other.min[2] <= self.max[2])
    }

    /// The box grown by `margin` on every side, rounded to nearest.
    #[inline]
    pub fn inflated(&self, margin: f32) -> Self {
        Self::new(self.min.map(|x| x - margin), self.max.map(|x| x + margin))
    }

    /// The smallest box around both, of which an invalid one does not count.
    #[inline]
    pub fn union(&self, other: &Self) -> Self {
        match (self.is_valid(), other.is_valid()) {
            (true, true) => Self::new(
                std::array::from_fn(|k| self.min[k].min(other.min[k])),
                std::array::from_fn(|k| self.max[k].max(other.max[k])),
            ),
            (false, true) => *other,
            _ => *self,
        }
    }

    /// The box around this one and where it is after `motion`, a displacement in the same unit: velocity times time.
    /// A motion that is no number leaves the box as it is.
    ///
    /// ```
    /// use pbig_core::Aabb;
    /// let (cube, velocity, dt) = (Aabb::from_center([0.0; 3], [0.5; 3]), [6.0, 0.0, -12.0], 0.25);
    /// let swept = cube.swept(velocity.map(|v| v * dt));
    /// assert_eq!(swept, Aabb::new([-0.5, -0.5, -3.5], [2.0, 0.5, 0.5]));
    /// ```
    #[inline]
    pub fn swept(&self, motion: [f32; 3]) -> Self {
        let moved = |corner: [f32; 3]| std::array::from_fn(|k| corner[k] + motion[k]);
        self.union(&Self::new(moved(self.min), moved(self.max)))
    }

    /// Whether a box lies in this one, its border included; false where a number is NaN.
    #[inline]
    pub fn contains(&self, other: &Self) -> bool {
        (0..3).all(|k| self.min[k] <= other.min[k] && other.max[k] <= self.max[k])
    }

    /// Edge lengths; infinite where they overflow, as for a half-space.
    #[inline]
    pub fn extents(&self) -> [f32; 3] {
        std::array::from_fn(|k| self.max[k] - self.min[k])
    }
}

/// The largest f32 that is not above `x`.
fn round_down(x: f64) -> f32 {
    let nearest = x as f32;
    if f64::from(nearest) > x { nearest.next_down() } else { nearest }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn touching_boxes_overlap_and_a_gap_of_one_ulp_parts_them() {
        let a = Aabb::new([0.0; 3], [1.0; 3]);
        assert!(a.overlaps(&Aabb::new([1.0; 3], [2.0; 3])));
        assert!(!a.overlaps(&Aabb::new([1.0f32.next_up(), 0.0, 0.0], [2.0; 3])));
    }

    #[test]
    fn what_is_invalid_does_not_count_in_a_union_and_is_contained_nowhere() {
        let (cube, all) =
            (Aabb::new([0.0; 3], [1.0; 3]), Aabb::new([f32::NEG_INFINITY; 3], [f32::INFINITY; 3]));
        for invalid in [Aabb::NOWHERE, Aabb::new([0.0, 0.0, 3.0], [9.0, 9.0, 2.0])] {
            assert_eq!((cube.union(&invalid), invalid.union(&cube)), (cube, cube));
        }
        assert_eq!(cube.swept([0.0, f32::NAN, 1.0]), cube);
        assert_eq!(all.swept([1.0; 3]), all);
        assert!(cube.contains(&cube) && all.contains(&cube) && !cube.contains(&all));
        assert!(!cube.contains(&Aabb::new([0.5; 3], [0.9, 0.9, 1.0f32.next_up()])));
        assert!(!all.contains(&Aabb::NOWHERE) && !Aabb::NOWHERE.contains(&cube));
    }

    #[test]
    fn an_inverted_f64_box_stays_invalid_after_rounding() {
        let tiny = 1e-12;
        assert!(!Aabb::from_f64([1.0 + tiny, 0.0, 0.0], [1.0; 3]).is_valid());
        assert!(!Aabb::from_f64([f64::NAN, 0.0, 0.0], [1.0; 3]).is_valid());
    }

    #[test]
    fn rounding_is_outward_also_beyond_the_range_of_f32() {
        let b = Aabb::from_f64([1e300, -1e300, 0.1], [1e300, -1e300, 0.1]);
        assert_eq!(b.min, [f32::MAX, f32::NEG_INFINITY, 0.1f32.next_down()]);
        assert_eq!(b.max, [f32::INFINITY, -f32::MAX, 0.1]);
    }
}
