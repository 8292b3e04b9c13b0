//! The margins of boxes: by how much a stored AABB is larger than its collider's.

use crate::{Bounds, policy};

/// The margins of an update, in the world's unit of length.
#[derive(Clone, Copy, Debug, Default)]
pub struct Margins {
    /// The margin of a box that has none of its own.
    pub usual: f32,
    /// Limits of a margin that is an eighth of a box's smallest extent: rapier's `adaptive_change_detection_margin`.
    pub adaptive: Option<[f32; 2]>,
    /// The number of dimensions.
    pub axes: usize,
}

impl Margins {
    /// Returns the margin of a box that has one of its own.
    ///
    /// A new fixed collider may never move, so it has as much margin as rounding needs: more would only add pairs. Once it has moved, it
    /// has the margin of others. So has one that is not listed when it is read first, as after a restore: it may have pairs by its margin.
    #[inline(always)]
    pub(crate) fn own(&self, aabb: &impl Bounds, is_new_and_fixed: bool) -> Option<f32> {
        // The gap between a box and itself is its negative extent.
        let extent = || (0..self.axes).map(|k| -aabb.gap(aabb, k)).fold(f32::INFINITY, f32::min);
        let adaptive = self.adaptive.map(|[least, most]| (0.125 * extent()).max(least).min(most));
        if !is_new_and_fixed {
            return adaptive;
        }
        Some(adaptive.unwrap_or(self.usual).min(aabb.reach() * policy::MARGIN_OF_ROUNDING))
    }

    /// Returns the largest margin that a box can have.
    pub fn largest(&self) -> f32 {
        self.adaptive.map_or(self.usual, |[_, most]| most)
    }
}
