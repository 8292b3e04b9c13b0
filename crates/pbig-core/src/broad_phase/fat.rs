//! Whether the box that is stored for another, grown by the margin, still does.

use crate::Aabb;

/// Whether a fat box still contains the box, and by no more than twice the margin: a box that
/// has shrunk is stored anew, so that only boxes near each other pair.
#[inline(always)]
pub(super) fn still_holds(fat: &Aabb, aabb: &Aabb, valid: bool, margin: f32) -> bool {
    // A little less than two margins: the gaps below are rounded.
    let slack = 2.0 * margin * (1.0 - 2.0 * f32::EPSILON);
    // No branches: which side of a box has moved is a coin toss, and six of them took 30 ns.
    let (mut moved, mut sum) = (!valid, 0.0);
    for k in 0..3 {
        let (below, above) = (aabb.min[k] - fat.min[k], fat.max[k] - aabb.max[k]);
        moved |= (below < 0.0) | (below > slack) | (above < 0.0) | (above > slack);
        sum += below + above;
    }
    if moved {
        return !valid && !fat.is_valid();
    }
    !sum.is_nan() || holds_exactly(fat, aabb, slack)
}

/// As [`still_holds`] of a valid box, some coordinates infinite or the fat box nowhere.
#[cold]
fn holds_exactly(fat: &Aabb, aabb: &Aabb, slack: f32) -> bool {
    // Equal first: the difference of equal infinities is NaN.
    let near = |outer: f32, inner: f32, gap: f32| outer == inner || (gap >= 0.0 && gap <= slack);
    (0..3).all(|k| {
        let (below, above) = (aabb.min[k] - fat.min[k], fat.max[k] - aabb.max[k]);
        near(fat.min[k], aabb.min[k], below) && near(fat.max[k], aabb.max[k], above)
    })
}
