//! The loss of a box by rounding to f32, and boxes widened by as much.
//!
//! An *ulp*, a unit in the last place, is the distance from a float to the next. Far from the origin it is large: 1/128
//! of a length unit at 10^5, 1 at 10^7. Let `u` be 2^-24, so that an operation rounds by at most `u` times its result and by
//! half an ulp of it; `t` the coordinate of the pose on an axis; `E` the farthest that the box reaches from the pose's
//! position on any axis. The question is by how much a bound that parry 0.22 computes can lie too far inside.
//!
//! - **Sums with `t`** are rounded up to three times: where a shape's corner or centre is, what it reaches from there
//!   (a radius, half extents, a border), and contact skin with prediction. A ball, a cuboid and a hull have two of these.
//!   Each is half an ulp of `|t| + 2 E` at most. (Of `|t| + E`, but for an `E` that is rounded itself: twice that is in the
//!   upper of two powers of two where a bound is between them.)
//! - **The rotated shape** is off by some `u E`. Half extents times the absolute matrix: entries are off by 4 `u`, and by 8 `u` of
//!   themselves if the quaternion's squared norm is off by 8 `u`; 3 `u` more for the products and their sum. As half extents
//!   add up to at most 3 `E`, 23 `u E`. A point (a hull's corner, a capsule's end, a compound's centre) is at most the root of
//!   3 times `E` away: 17 `u` for two cross products and their sum, 16 `u` for the norm: 57 `u E`. Both, for a box around a
//!   box, 80 `u E`; and once more for the parts of a compound, 160 `u E`. A support point (cylinder, cone) is a point in a
//!   direction that is off by 57 `u`, which at worst, along the axis, costs twice that: 171 `u E`.
//!
//! So a bound is too far inside by at most 1.5 ulps of `|t| + 2 E` and 171 `u E`. Two of `ulp(|t| + 2 E) + 128 u E` are more:
//! before it is rounded, the widened bound is not inside the exact one. Rounding is monotone, so what it parts was
//! apart: **with 2, all boxes that overlap exactly still do**. A position that was rounded from f64 is off by half an ulp
//! more, its rotation by 8 `u E`: with 3, also what overlaps there. (Above 10^-30 in size, where products do not underflow.)

use pbig_core::Aabb;
use rapier3d::prelude::{Isometry, Real};

/// The loss by rotations, as a part of the size: half of it for each of two ulps.
const ROTATION: f32 = 128.0 / (1 << 24) as f32;

/// The box with every bound moved outward by `ulps` units in the last place (ulps) of the numbers that it was computed
/// from: the position of the shape on that axis and the box's reach, with 2^-17 of that for rotations.
///
/// With 2, boxes that parry has computed in f32 for two shapes overlap if the exact boxes of these shapes do at the same
/// poses; with 3 also if they do at poses in f64 of which these are the rounded ones. Near the origin that is about a
/// hundred-thousandth of the size. An invalid box stays as it is, and so do bounds that are infinite.
#[inline]
pub fn widened_by_ulps(aabb: &Aabb, pose: &Isometry<Real>, ulps: u32) -> Aabb {
    let at: [f32; 3] = pose.translation.vector.into();
    let reach = |k: usize| finite((aabb.max[k] - at[k]).abs()).max(finite((aabb.min[k] - at[k]).abs()));
    let reach = reach(0).max(reach(1)).max(reach(2));
    let count = if aabb.is_valid() { ulps as f32 } else { 0.0 };
    let by = at.map(|at| count * (ulp(at.abs() + 2.0 * reach) + ROTATION * reach));
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
    fn invalid_and_infinite_bounds_stay_so_and_widen_no_other() {
        for invalid in [Aabb::new([1e7, 0.0, 0.0], [1e7 - 1.0, 1.0, 1.0]), Aabb::NOWHERE] {
            let wide = widened_by_ulps(&invalid, &pose([1e7, 0.0, 0.0]), u32::MAX);
            assert!(!wide.is_valid(), "{wide:?}");
        }
        let plate = Aabb::new([f32::NEG_INFINITY, 0.0, 0.0], [f32::INFINITY, 1.0, 1.0]);
        // One that does not follow its position, too.
        for origin in [0.0, f32::NAN] {
            let wide = widened_by_ulps(&plate, &pose([origin, 0.0, 0.0]), 4);
            assert_eq!((wide.min[0], wide.max[0]), (f32::NEG_INFINITY, f32::INFINITY));
            assert!(wide.max[1] > 1.0 && wide.max[1] < 1.001 && wide.min[2] < 0.0, "{wide:?}");
        }
        let half_space = Aabb::new([-0.5 * f32::MAX; 3], [0.5 * f32::MAX; 3]);
        let wide = widened_by_ulps(&half_space, &pose([1.0; 3]), 4);
        assert!(wide.contains(&half_space) && wide.max.iter().all(|x| x.is_finite()), "{wide:?}");
    }
}
