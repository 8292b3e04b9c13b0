//! Questions about places. Each is put to the eight boxes of a node at a time.

use super::node::{LANES, Lanes, Node};
use crate::Aabb;

/// Relative error of a time or distance, for a few roundings. Bounds are widened by it, so that rounding costs a visit and never
/// a box (unless a product is denormal, or a square overflows: gaps below 1e-22 or above 1e19).
const SLACK: f32 = 4.0 * f32::EPSILON;

/// A question: a sweep meets a box at a time, a search around a point at a distance.
pub(super) trait Question {
    /// Returns the smallest time or distance at which each box is met; infinity for boxes that are not.
    fn least(&self, node: &Node) -> Lanes;
}

/// Meets boxes that a moving box meets, at a time from 0 on.
pub(super) struct Sweep {
    axes: [Axis; 3],
}

/// The motion of the moving box along an axis.
#[derive(Clone, Copy)]
enum Axis {
    /// It stays where it is, from the first to the second coordinate.
    Still(f32, f32),
    /// Its front and its back end, and the time that it takes for a length unit: negative if it moves down.
    Moving(f32, f32, f32),
}

impl Axis {
    /// Makes the motion of a box along an axis. If the velocity is too small to divide by, the box stays, and is widened by its
    /// whole way.
    fn new(low: f32, high: f32, velocity: f32, max_time: f32) -> Self {
        let pace = 1.0 / velocity;
        if velocity == 0.0 {
            return Self::Still(low, high);
        }
        if !pace.is_finite() {
            let reach = velocity * max_time;
            return Self::Still(low + reach.min(0.0), high + reach.max(0.0));
        }
        let [low, high] = [low, high].map(finite);
        if pace > 0.0 { Self::Moving(high, low, pace) } else { Self::Moving(low, high, pace) }
    }

    /// Narrows the times at which the boxes of a node are met.
    #[inline(always)]
    fn narrow(&self, low: &Lanes, high: &Lanes, enter: &mut Lanes, leave: &mut Lanes) {
        match *self {
            Self::Still(least, most) => {
                for i in 0..LANES {
                    let meets = (low[i] <= most) & (least <= high[i]);
                    leave[i] = if meets { leave[i] } else { f32::NEG_INFINITY };
                }
            }
            Self::Moving(front, back, pace) => {
                let (near, far) = if pace > 0.0 { (low, high) } else { (high, low) };
                for i in 0..LANES {
                    let (begins, ends) = ((near[i] - front) * pace, (far[i] - back) * pace);
                    enter[i] = if begins > enter[i] { begins } else { enter[i] };
                    leave[i] = if ends < leave[i] { ends } else { leave[i] };
                }
            }
        }
    }
}

/// Clamps a coordinate, so that no difference of two is NaN.
fn finite(x: f32) -> f32 {
    x.clamp(f32::MIN, f32::MAX)
}

impl Sweep {
    /// Returns none if a number is NaN.
    pub(super) fn new(start: &Aabb, velocity: [f32; 3], max_time: f32) -> Option<Self> {
        let is_number = start.is_valid() && !max_time.is_nan() && velocity.iter().all(|v| !v.is_nan());
        let axis =
            |k: usize| Axis::new(start.min[k], start.max[k], finite(velocity[k]), max_time.min(f32::MAX));
        is_number.then(|| Self { axes: std::array::from_fn(axis) })
    }
}

impl Question for Sweep {
    #[inline(always)]
    fn least(&self, node: &Node) -> Lanes {
        let (mut enter, mut leave) = ([0.0; LANES], [f32::INFINITY; LANES]);
        for (k, axis) in self.axes.iter().enumerate() {
            axis.narrow(&node.boxes[k], &node.boxes[k + 3], &mut enter, &mut leave);
        }
        for i in 0..LANES {
            let earliest = enter[i] - enter[i] * SLACK;
            let meets = (leave[i] >= 0.0) & (earliest <= leave[i] + leave[i] * SLACK);
            enter[i] = if meets { earliest } else { f32::INFINITY };
        }
        enter
    }
}

/// Meets boxes within a distance of a point.
pub(super) struct Near {
    pub(super) point: [f32; 3],
}

impl Question for Near {
    #[inline(always)]
    fn least(&self, node: &Node) -> Lanes {
        let mut squares = [0.0f32; LANES];
        for k in 0..3 {
            for i in 0..LANES {
                let (below, above) = (node.boxes[k][i] - self.point[k], self.point[k] - node.boxes[k + 3][i]);
                let gap = if below > above { below } else { above };
                let gap = if gap > 0.0 { gap } else { 0.0 };
                squares[i] += gap * gap;
            }
        }
        for square in &mut squares {
            *square = square.sqrt() * (1.0 - SLACK);
        }
        squares
    }
}
