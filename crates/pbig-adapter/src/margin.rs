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
    /// A new collider of a fixed or sleeping body may never move, so it has as much margin as rounding needs: more would only add pairs.
    /// Once it has moved, it has the margin of others. So has one that is not listed when it is read first, as after a restore: it may have pairs by its margin.
    #[inline(always)]
    pub(crate) fn own(&self, aabb: &impl Bounds, is_new_and_still: bool) -> Option<f32> {
        // The gap between a box and itself is its negative extent.
        let extent = || (0..self.axes).map(|k| -aabb.gap(aabb, k)).fold(f32::INFINITY, f32::min);
        let adaptive = self.adaptive.map(|[least, most]| (0.125 * extent()).max(least).min(most));
        if !is_new_and_still {
            return adaptive;
        }
        Some(adaptive.unwrap_or(self.usual).min(aabb.reach() * policy::MARGIN_OF_ROUNDING))
    }

    /// Returns the largest margin that a box can have.
    pub fn largest(&self) -> f32 {
        self.adaptive.map_or(self.usual, |[_, most]| most)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pbig_core::Aabb;

    #[test]
    fn an_adaptive_margin_is_an_eighth_of_the_smallest_extent() {
        let margins = Margins { usual: 0.5, adaptive: Some([0.04, 0.25]), axes: 2 };
        let own = |margins: Margins, width: f32| margins.own(&Aabb::new([0.0; 3], [width, 9.0, 0.0]), false);
        assert_eq!([0.1, 1.0, 8.0].map(|width| own(margins, width)), [0.04, 0.125, 0.25].map(Some));
        assert_eq!(own(Margins { axes: 3, ..margins }, 1.0), Some(0.04), "flat in three dimensions");
        assert_eq!(own(Margins { adaptive: None, ..margins }, 1.0), None);
        assert_eq!(margins.largest(), 0.25);
    }

    #[test]
    fn a_new_fixed_box_has_at_most_the_margin_of_rounding() {
        let far = Aabb::new([-4096.0, 0.0, 0.0], [1.0; 3]);
        let own = |usual| Margins { usual, ..Margins::default() }.own(&far, true);
        assert_eq!([1.0, 1e-6].map(own), [1.0 / 512.0, 1e-6].map(Some));
    }
}
