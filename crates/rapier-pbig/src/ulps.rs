//! What rounding takes off a box that is computed in f32, and boxes widened by as much.
//!
//! An *ulp*, a unit in the last place, is the distance from a float to the next. Far from the origin it is large: 1/128
//! of a length unit at 10^5, 1 at 10^7. Let `u` be 2^-24, so that an operation rounds by at most `u` times its result and by
//! half an ulp of it; `t` the coordinate of the pose on an axis; `E` the farthest that the box reaches from the pose's
//! position on any axis. How much too far inside may a bound be that parry 0.22 computes?
//!
//! - **Sums with `t`** are rounded up to three times: where a shape's corner or centre is, what it reaches from there
//!   (a radius, half extents, a border), and contact skin with prediction. A ball and a cuboid have two of these, a hull
//!   too. That is half an ulp each.
//! - **The rotated shape** is off by some `u E`. Half extents times the absolute matrix: an entry is off by 4 `u`, and by 8 `u`
//!   of itself if the quaternion's squared norm is off by 8 `u`; 3 `u` more for the sum; half extents add up to at
//!   most 3 `E`: 45 `u E`. A point (a hull's corner, a capsule's end, a compound's centre) is at most the root of 3 times `E`
//!   away: 17 `u` for two cross products and their sum, 16 `u` for the norm: 57 `u E`. Both, for a box around a box, and
//!   once more for the parts of a compound: 220 `u E` at most.
//!
//! So with `M = |t| + 128 E`, of which an ulp is at least `u M`: three half ulps of `M`, another for the rounding of the
//! widened bound itself (two where that is in the next power of two), and the rotated shape, are never more than 3 ulps of `M`.
//! Where |t| is above 92 `E`, 220 `u E` is less than `u M`, thus than one ulp. Where it is below, the sums are
//! rounded by `u (|t| + E)` each: 4 `u |t|` + 224 `u E` in all, and 3 ulps are 3 `u |t|` + 384 `u E` at least. A position that
//! was rounded from f64 is off by half an ulp: 4 ulps then. (Above 10^-30 in size, where products do not underflow.)

use crate::PbigBroadPhase;
use pbig_core::Aabb;
use rapier3d::prelude::{Isometry, Real};

/// By how much farther from the origin a shape counts: see above.
const ROTATION: f32 = 128.0;

impl PbigBroadPhase {
    /// For worlds far from the origin: boxes are widened as by [`widened_by_ulps`], colliders listed from now on. With 0, the
    /// default, they are rapier's own.
    ///
    /// Parry's boxes are rounded in f32 to where shapes are, and so are the prediction distance and the margin that cover
    /// that: they do up to `margin x 2^22` from the origin, 40 km with the default margin of 1 cm. Beyond, pairs can be
    /// missed, as rapier's own broad phase misses them, those first that are about to touch. With 3 ulps none is, however far
    /// away; with 4 none is that the world would have whose positions were rounded to f32. There are more pairs that do not
    /// touch: boxes reach up to so many ulps further, a third of a millimetre 1 km from the origin, 2 cm at 10^5 m, 3 m at 10^7 m.
    ///
    /// ```
    /// use rapier_pbig::PbigBroadPhase;
    /// let broad_phase = PbigBroadPhase::new().widened_by_ulps(3); // was: PbigBroadPhase::new()
    /// ```
    pub fn widened_by_ulps(mut self, ulps: u32) -> Self {
        self.ulps = ulps;
        #[cfg(feature = "shadow")]
        if let Some(checker) = self.shadow.as_mut().filter(|_| ulps > 0) {
            checker.expect_any_distance();
        }
        self
    }
}

/// The box with every bound moved outward by so many units in the last place (ulps) of the numbers that it was computed
/// from: the position of the shape on that axis, and the box's own size.
///
/// With 3, a box that parry has computed in f32 for a shape at this pose holds the exact box of the shape there; with 4 also
/// at the pose in f64 of which this one is the rounded one. Near the origin that is less than a ten-thousandth of the size.
/// An invalid box stays as it is, and so do bounds that are infinite or beyond 10^36.
///
/// ```
/// use rapier_pbig::{pbig_core::Aabb, widened_by_ulps};
/// use rapier3d::prelude::*;
/// // Floats are 1 apart there, and the ball lies in no box of corners half a unit from its centre.
/// let (ball, pose) = (Ball::new(0.5), Isometry::translation(1e7, 0.0, 0.0));
/// let stock = ball.aabb(&pose);
/// assert_eq!(stock.mins.x, stock.maxs.x);
/// let aabb = Aabb::new(stock.mins.coords.into(), stock.maxs.coords.into());
/// assert_eq!(widened_by_ulps(&aabb, &pose, 3).max[0], 1e7 + 3.0);
/// ```
#[inline]
pub fn widened_by_ulps(aabb: &Aabb, pose: &Isometry<Real>, ulps: u32) -> Aabb {
    let at: [f32; 3] = pose.translation.vector.into();
    let reach = |k: usize| finite((aabb.max[k] - at[k]).abs()).max(finite((aabb.min[k] - at[k]).abs()));
    let size = ROTATION * reach(0).max(reach(1)).max(reach(2));
    let count = if aabb.is_valid() { ulps as f32 } else { 0.0 };
    let by = at.map(|at| count * ulp(at.abs() + size));
    Aabb::new(std::array::from_fn(|k| aabb.min[k] - by[k]), std::array::from_fn(|k| aabb.max[k] + by[k]))
}

/// 0 in place of NaN and infinity.
#[inline(always)]
fn finite(x: f32) -> f32 {
    if x.is_finite() { x } else { 0.0 }
}

/// From the power of two at or below `x`, which is not negative, to the next float; 0 where `x` is less than the smallest normal
/// number, NaN or infinite.
#[inline(always)]
fn ulp(x: f32) -> f32 {
    const EXPONENT: u32 = 0x7f80_0000;
    finite(f32::from_bits(x.to_bits() & EXPONENT)) * f32::EPSILON
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose(at: [f32; 3]) -> Isometry<Real> {
        Isometry::translation(at[0], at[1], at[2])
    }

    #[test]
    fn an_ulp_is_the_distance_to_the_next_float_above_a_power_of_two() {
        for power in -126..128 {
            let x = 2f32.powi(power);
            assert_eq!(ulp(x), x.next_up() - x, "2^{power}");
            assert_eq!(ulp((2.0 * x).next_down()), ulp(x), "below 2^{}", power + 1);
        }
        for x in [0.0, f32::from_bits(1), f32::INFINITY, f32::NAN] {
            assert_eq!(ulp(x), 0.0, "{x}");
        }
    }

    #[test]
    fn bounds_move_by_ulps_of_the_position_on_their_own_axis() {
        // In (0, 1024), [2^20, 2^21) and beyond 2^23, sizes included.
        let at = [8.0, -1.5e6, 1e7];
        let cube = Aabb::from_center(at, [0.5; 3]);
        let wide = widened_by_ulps(&cube, &pose(at), 2);
        let by = [2.0 * ulp(72.0), 0.25, 2.0];
        assert_eq!(wide.min, std::array::from_fn(|k| cube.min[k] - by[k]));
        assert_eq!(wide.max, std::array::from_fn(|k| cube.max[k] + by[k]));
        assert_eq!(widened_by_ulps(&cube, &pose(at), 0), cube);
    }

    #[test]
    fn where_a_shape_lies_across_from_its_position_that_counts() {
        // A mesh whose corners are in the coordinates of a world, moved back to the origin.
        let cube = Aabb::from_center([0.0; 3], [1.0; 3]);
        let wide = widened_by_ulps(&cube, &pose([-1e6, 0.0, 0.0]), 1);
        assert!(wide.max[0] - cube.max[0] >= 0.0625, "{wide:?}");
    }

    #[test]
    fn what_is_invalid_stays_so_and_what_is_infinite_does_and_widens_nothing_else() {
        let origin = pose([0.0; 3]);
        for invalid in [Aabb::new([1e7, 0.0, 0.0], [1e7 - 1.0, 1.0, 1.0]), Aabb::NOWHERE] {
            let wide = widened_by_ulps(&invalid, &pose([1e7, 0.0, 0.0]), u32::MAX);
            assert!(!wide.is_valid(), "{wide:?}");
        }
        let slab = Aabb::new([f32::NEG_INFINITY, 0.0, -0.5 * f32::MAX], [f32::INFINITY, 1.0, 0.5 * f32::MAX]);
        assert_eq!(widened_by_ulps(&slab, &origin, 4), slab, "sizes beyond 10^36 are not widened");
        let plate = Aabb::new([f32::NEG_INFINITY, 0.0, 0.0], [f32::INFINITY, 1.0, 1.0]);
        let wide = widened_by_ulps(&plate, &origin, 4);
        assert_eq!((wide.min[0], wide.max[0]), (f32::NEG_INFINITY, f32::INFINITY));
        assert!(wide.max[1] > 1.0 && wide.max[1] < 1.001 && wide.min[2] < 0.0, "{wide:?}");
        let lost = pose([f32::NAN, 0.0, 0.0]);
        assert!(widened_by_ulps(&plate, &lost, 3).is_valid(), "a box that does not follow its position");
    }
}
