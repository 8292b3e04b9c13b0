//! Queries about places. Each is put to the eight boxes of a node at a time.

use super::node::{LANES, Lanes, Node};
use crate::Aabb;

/// Relative error of a time or distance, for a few roundings. Limits are widened by it, so that rounding costs a visit and never
/// a box (unless a product is denormal).
const SLACK: f32 = 8.0 * f32::EPSILON;

/// A query: a cast meets a box at a time, a search around a point at a distance.
pub(super) trait Query {
    /// Returns the least time, or the square of the least distance, at which each box is met, and a value for each box that is not
    /// below it if the box is met up to the limit.
    fn meet(&self, node: &Node, limit: f32) -> [Lanes; 2];

    /// Returns the limit for boxes up to a time or distance, which is from 0 to the largest number.
    fn limit(&self, bound: f32) -> f32;
}

/// Meets boxes that a moving box meets, at a time from 0 on.
pub(super) struct Cast {
    axes: [Axis; 3],
}

/// The motion of the moving box along an axis.
///
/// Without motion the time for a length unit is infinite: a gap takes forever, and what is across has always been there. Where ends
/// touch, the product of 0 and infinity is NaN, which counts as no limit.
#[derive(Clone, Copy)]
struct Axis {
    /// The ends of the moving box at time 0.
    low: f32,
    high: f32,
    /// Time for a length unit: negative if the box moves down.
    pace: f32,
}

impl Axis {
    #[inline(always)]
    fn new(low: f32, high: f32, velocity: f32, max_time: f32) -> Self {
        // The sum has no negative zero.
        let axis = Self { low: finite(low), high: finite(high), pace: 1.0 / (finite(velocity) + 0.0) };
        if axis.pace.is_infinite() && velocity != 0.0 { axis.widened(velocity * max_time) } else { axis }
    }

    /// Returns a box without motion, because its velocity is too small to divide by. It has its whole way.
    #[cold]
    fn widened(self, way: f32) -> Self {
        Self {
            low: finite(self.low + way.min(0.0)),
            high: finite(self.high + way.max(0.0)),
            pace: f32::INFINITY,
        }
    }

    /// Narrows the times at which a box is met.
    #[inline(always)]
    fn narrow(&self, low: f32, high: f32, enter: &mut f32, leave: &mut f32) {
        let (one, other) = ((low - self.high) * self.pace, (high - self.low) * self.pace);
        // If one of them is NaN, `one` is no limit for the first, and `other` for the last time. So is NaN.
        let first = if other < one { other } else { one };
        let last = if one > other { one } else { other };
        *enter = if first > *enter { first } else { *enter };
        *leave = if last < *leave { last } else { *leave };
    }
}

/// Clamps a coordinate, so that no difference of two is NaN. (Without a care for NaN, which takes instructions.)
#[inline(always)]
fn finite(x: f32) -> f32 {
    let x = if x > f32::MIN { x } else { f32::MIN };
    if x < f32::MAX { x } else { f32::MAX }
}

impl Cast {
    /// Returns none if a number is NaN.
    #[inline(always)]
    pub(super) fn new(start: &Aabb, velocity: [f32; 3], max_time: f32) -> Option<Self> {
        let (Aabb { min, max }, max_time) = (start, max_time.min(f32::MAX));
        let is_number = !velocity[0].is_nan() & !velocity[1].is_nan() & !velocity[2].is_nan();
        let axis = |k: usize| Axis::new(min[k], max[k], velocity[k], max_time);
        (start.is_valid() & is_number).then(|| Self { axes: [axis(0), axis(1), axis(2)] })
    }

    /// Returns true if the moving box meets a box up to a time, or may.
    #[inline(always)]
    pub(super) fn meets(&self, aabb: &Aabb, max_time: f32) -> bool {
        let (mut enter, mut leave) = (0.0, f32::MAX);
        for k in 0..3 {
            self.axes[k].narrow(aabb.min[k], aabb.max[k], &mut enter, &mut leave);
        }
        (enter <= leave * (1.0 + SLACK)) & (enter <= max_time * (1.0 + SLACK))
    }
}

impl Query for Cast {
    #[inline(always)]
    fn meet(&self, node: &Node, limit: f32) -> [Lanes; 2] {
        let (mut enter, mut leave) = ([0.0; LANES], [f32::MAX; LANES]);
        for k in 0..3 {
            for i in 0..LANES {
                let (low, high) = (node.boxes[k][i], node.boxes[k + 3][i]);
                self.axes[k].narrow(low, high, &mut enter[i], &mut leave[i]);
            }
        }
        for i in 0..LANES {
            let last = leave[i] * (1.0 + SLACK);
            let last = if last < limit { last } else { limit };
            leave[i] = if node.boxes[0][i] <= node.boxes[3][i] { last } else { -1.0 };
        }
        [enter, leave]
    }

    #[inline(always)]
    fn limit(&self, bound: f32) -> f32 {
        (bound * (1.0 + SLACK)).min(f32::MAX)
    }
}

/// Meets boxes within a distance of a point.
pub(super) struct Near {
    pub(super) point: [f32; 3],
}

impl Query for Near {
    #[inline(always)]
    fn meet(&self, node: &Node, limit: f32) -> [Lanes; 2] {
        let mut squares = [0.0f32; LANES];
        for k in 0..3 {
            for i in 0..LANES {
                let (below, above) = (node.boxes[k][i] - self.point[k], self.point[k] - node.boxes[k + 3][i]);
                let gap = if below > above { below } else { above };
                let gap = if gap > 0.0 { gap } else { 0.0 };
                squares[i] += gap * gap;
            }
        }
        let mut limits = [limit; LANES];
        for i in 0..LANES {
            limits[i] = if node.boxes[0][i] <= node.boxes[3][i] { limit } else { -1.0 };
        }
        [squares, limits]
    }

    /// Never 0, because the square of a short distance is. Where it overflows, all boxes are within it.
    #[inline(always)]
    fn limit(&self, bound: f32) -> f32 {
        (bound * bound * (1.0 + SLACK)).max(f32::MIN_POSITIVE)
    }
}
