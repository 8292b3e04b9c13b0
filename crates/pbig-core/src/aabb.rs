//! The axis-aligned bounding box (AABB), the only geometry that pbig knows.

use bytemuck::{Pod, Zeroable};

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
        #[cfg(target_arch = "x86_64")]
        return self.overlaps_by_lanes(other);
        #[cfg(not(target_arch = "x86_64"))]
        return self.overlaps_by_axes(other);
    }

    /// Returns true if the gaps between this box and one around it are from 0 to `slack` on all sides; none if a gap is NaN, as
    /// between equal infinities.
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    pub(crate) fn gaps_are_within(&self, outer: &Self, slack: f32) -> Option<bool> {
        use std::arch::x86_64::*;
        // SAFETY: SSE is part of the architecture.
        unsafe {
            // Each coordinate goes into a lane. A box that was just computed and is loaded as a whole waits until it is written.
            let [min, max] = [self.min, self.max].map(|[x, y, z]| _mm_setr_ps(x, y, z, z));
            let (outer_min, outer_max) = outer.corners();
            let (below, above) = (_mm_sub_ps(min, outer_min), _mm_sub_ps(outer_max, max));
            let (zero, slack) = (_mm_setzero_ps(), _mm_set1_ps(slack));
            let least = _mm_and_ps(_mm_cmpge_ps(below, zero), _mm_cmpge_ps(above, zero));
            let most = _mm_and_ps(_mm_cmple_ps(below, slack), _mm_cmple_ps(above, slack));
            let axes = |lanes| _mm_movemask_ps(lanes) & 7;
            let is_within = axes(_mm_and_ps(least, most)) == 7;
            (is_within || axes(_mm_cmpunord_ps(below, above)) == 0).then_some(is_within)
        }
    }

    /// Returns true if the gaps between this box and one around it are from 0 to `slack` on all sides; none if a gap is NaN, as
    /// between equal infinities.
    #[cfg(not(target_arch = "x86_64"))]
    #[inline(always)]
    pub(crate) fn gaps_are_within(&self, outer: &Self, slack: f32) -> Option<bool> {
        let (mut is_within, mut sum) = (true, 0.0);
        for k in 0..3 {
            let (below, above) = (self.min[k] - outer.min[k], outer.max[k] - self.max[k]);
            is_within &= (below >= 0.0) & (below <= slack) & (above >= 0.0) & (above <= slack);
            sum += below + above;
        }
        (!sum.is_nan()).then_some(is_within)
    }

    /// Returns both corners, three lanes each; the fourth holds anything.
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    pub(crate) fn corners(&self) -> (std::arch::x86_64::__m128, std::arch::x86_64::__m128) {
        use std::arch::x86_64::{_mm_loadu_ps, _mm_shuffle_ps};
        // SAFETY: SSE is part of the architecture. A box is six numbers; the loads are of the first four and the last four.
        unsafe {
            let first = std::ptr::from_ref(self).cast::<f32>();
            let max = _mm_loadu_ps(first.add(2));
            (_mm_loadu_ps(first), _mm_shuffle_ps::<0b00_11_10_01>(max, max))
        }
    }

    /// Compares all axes at once with instructions of every x86-64: 11 of them, where one axis after the other takes 30.
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    fn overlaps_by_lanes(&self, other: &Self) -> bool {
        use std::arch::x86_64::{_mm_and_ps, _mm_cmple_ps, _mm_movemask_ps};
        let ((min, max), (other_min, other_max)) = (self.corners(), other.corners());
        // SAFETY: SSE is part of the architecture.
        let axes = unsafe {
            _mm_movemask_ps(_mm_and_ps(_mm_cmple_ps(min, other_max), _mm_cmple_ps(other_min, max)))
        };
        axes & 7 == 7
    }

    #[cfg(any(test, not(target_arch = "x86_64")))]
    #[inline(always)]
    fn overlaps_by_axes(&self, other: &Self) -> bool {
        (self.min[0] <= other.max[0])
            & (other.min[0] <= self.max[0])
            & (self.min[1] <= other.max[1])
            & (other.min[1] <= self.max[1])
            & (self.min[2] <= other.max[2])
            & (other.min[2] <= self.max[2])
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

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(target_arch = "x86_64")]
    #[test]
    fn all_axes_at_once_say_what_one_after_the_other_says() {
        let numbers =
            [-1.0, -0.0, 0.0, f32::MIN_POSITIVE / 2.0, 1.0, f32::INFINITY, f32::NEG_INFINITY, f32::NAN];
        let mut seed = 1u64;
        let mut number = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            numbers[(seed >> 61) as usize]
        };
        let mut aabb = || Aabb::new([number(), number(), number()], [number(), number(), number()]);
        let mut overlaps = 0;
        for _ in 0..200_000 {
            let (a, b) = (aabb(), aabb());
            assert_eq!(a.overlaps_by_lanes(&b), a.overlaps_by_axes(&b), "{a:?} {b:?}");
            overlaps += u32::from(a.overlaps(&b));
        }
        assert!(overlaps > 1000, "{overlaps}");
    }

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
