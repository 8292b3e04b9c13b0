//! The axis-aligned bounding box (AABB), the only geometry that pbig knows.

#[cfg(any(test, not(target_arch = "x86_64")))]
pub(crate) mod axes;
#[cfg(target_arch = "x86_64")]
pub(crate) mod sse;

#[cfg(not(target_arch = "x86_64"))]
pub(crate) use axes as one_box;
use bytemuck::{Pod, Zeroable};
#[cfg(target_arch = "x86_64")]
pub(crate) use sse as one_box;

/// Least and greatest coordinates of some boxes, and greatest extents. Each has an axis a lane; the fourth lane holds anything.
pub(crate) type Extremes = [[f32; 4]; 3];

/// A closed axis-aligned box in f32, in the caller's length unit.
///
/// A box is *valid* when `min <= max` on all three axes; a NaN makes it invalid. Extents may be
/// infinite. [`crate::Finder`], [`crate::BroadPhase`] and [`crate::oracle`] pair an invalid box with nothing.
/// [`Aabb::overlaps`] alone does not: it compares corners, and is true for some inverted boxes.
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
    /// An invalid box whose coordinates are all NaN: the box of an absent proxy. [`Aabb::overlaps`] is false for it and
    /// any other box.
    pub const NOWHERE: Self = Self::new([f32::NAN; 3], [f32::NAN; 3]);

    /// Returns the box from one corner to the other.
    #[inline]
    pub const fn new(min: [f32; 3], max: [f32; 3]) -> Self {
        Self { min, max }
    }

    /// Returns the box around `center` that reaches `half` to each side.
    pub fn from_center(center: [f32; 3], half: [f32; 3]) -> Self {
        let corner = |sign: f32| std::array::from_fn(|k| center[k] + sign * half[k]);
        Self::new(corner(-1.0), corner(1.0))
    }

    /// Returns the smallest f32 box that contains the f64 box `[min, max]` (rounded outward). A box that is invalid in f64
    /// gives [`Aabb::NOWHERE`], even where rounding would close the gap.
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

    /// Returns true if `min <= max` on all axes. A NaN makes it false.
    #[inline]
    pub fn is_valid(&self) -> bool {
        (self.min[0] <= self.max[0]) & (self.min[1] <= self.max[1]) & (self.min[2] <= self.max[2])
    }

    /// Returns true if `a.min <= b.max && b.min <= a.max` on all axes: PBIG's equation 1, closed intervals, exactly. Two
    /// valid boxes then share a point.
    ///
    /// An invalid box is not singled out: with a NaN in the compared corners the result is false, but an inverted box can
    /// overlap a box around it. Ask [`Aabb::is_valid`] first where boxes may be inverted.
    ///
    /// ```
    /// use pbig_core::Aabb;
    /// let (around, inverted) = (Aabb::new([0.0; 3], [9.0; 3]), Aabb::new([5.0; 3], [4.0; 3]));
    /// assert!(around.overlaps(&inverted) && !inverted.is_valid());
    /// assert!(!around.overlaps(&Aabb::NOWHERE));
    /// ```
    #[inline(always)]
    pub fn overlaps(&self, other: &Self) -> bool {
        // One branch at most, on the result: six branches took three times as long.
        one_box::overlaps(self, other)
    }

    /// Returns the box grown by `margin` on every side, rounded to nearest.
    #[inline]
    pub fn inflated(&self, margin: f32) -> Self {
        Self::new(self.min.map(|x| x - margin), self.max.map(|x| x + margin))
    }

    /// Returns the smallest box around both. An invalid box does not count. If both are invalid, returns this one.
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

    /// Returns true if `other` lies in this box, its border included. A NaN makes it false.
    #[inline]
    pub fn contains(&self, other: &Self) -> bool {
        (0..3).all(|k| self.min[k] <= other.min[k] && other.max[k] <= self.max[k])
    }

    /// Returns the edge lengths; infinite where they overflow, as for a half-space.
    #[inline]
    pub fn extents(&self) -> [f32; 3] {
        std::array::from_fn(|k| self.max[k] - self.min[k])
    }
}

/// Returns the largest f32 that is not above `x`.
fn round_down(x: f64) -> f32 {
    let nearest = x as f32;
    if f64::from(nearest) > x { nearest.next_down() } else { nearest }
}

/// Returns an integer in the order of the numbers that are not NaN.
#[inline(always)]
pub(crate) fn ordered(x: f32) -> u32 {
    // Without a sign of zero, because -0 and 0 are one number.
    let bits = (x + 0.0).to_bits();
    if bits >> 31 == 1 { !bits } else { bits | 1 << 31 }
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
    fn invalid_boxes_add_nothing_to_a_union_and_lie_nowhere() {
        let (cube, all) =
            (Aabb::new([0.0; 3], [1.0; 3]), Aabb::new([f32::NEG_INFINITY; 3], [f32::INFINITY; 3]));
        for invalid in [Aabb::NOWHERE, Aabb::new([0.0, 0.0, 3.0], [9.0, 9.0, 2.0])] {
            assert_eq!((cube.union(&invalid), invalid.union(&cube)), (cube, cube));
        }
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
