//! A node: eight boxes, axis by axis, and what each stands for.

use crate::Aabb;
use crate::simd::{BLOCK, EightBoxes, Simd};

/// Boxes in a node.
pub(crate) const LANES: usize = BLOCK;

/// A number for each box of a node.
pub(crate) type Lanes = [f32; LANES];

/// The child of an empty lane.
pub(crate) const NONE: u32 = u32::MAX;

/// Eight boxes: of stored boxes (a leaf), or of nodes.
#[repr(C, align(32))]
#[derive(Clone, Copy, Debug)]
pub(crate) struct Node {
    /// In an empty lane, corners are at plus and minus infinity, which only an infinite box meets.
    pub(crate) boxes: EightBoxes,
    /// Ids of boxes in a leaf, else numbers of nodes.
    pub(crate) children: [u32; LANES],
}

impl Node {
    pub(crate) const EMPTY: Self = Self {
        boxes: [
            [f32::INFINITY; LANES],
            [f32::INFINITY; LANES],
            [f32::INFINITY; LANES],
            [f32::NEG_INFINITY; LANES],
            [f32::NEG_INFINITY; LANES],
            [f32::NEG_INFINITY; LANES],
        ],
        children: [NONE; LANES],
    };

    /// Stores a box. An invalid one becomes an empty box, which meets nothing.
    #[inline(always)]
    pub(crate) fn set(&mut self, lane: usize, aabb: &Aabb) {
        let is_valid = aabb.is_valid();
        for k in 0..3 {
            self.boxes[k][lane] = if is_valid { aabb.min[k] } else { f32::INFINITY };
            self.boxes[k + 3][lane] = if is_valid { aabb.max[k] } else { f32::NEG_INFINITY };
        }
    }

    /// Returns the box in a lane; where there is none, an empty one, which only an infinite box overlaps.
    #[inline(always)]
    pub(crate) fn get(&self, lane: usize) -> Aabb {
        let mut aabb = Aabb::NOWHERE;
        for k in 0..3 {
            (aabb.min[k], aabb.max[k]) = (self.boxes[k][lane], self.boxes[k + 3][lane]);
        }
        aabb
    }

    /// Returns by how much the sum of the extents in each lane grows with a valid box.
    #[inline(always)]
    pub(crate) fn growths(&self, _: impl Simd, aabb: &Aabb) -> Lanes {
        let mut growths = [0.0; LANES];
        for k in 0..3 {
            for lane in 0..LANES {
                let (below, above) =
                    (self.boxes[k][lane] - aabb.min[k], aabb.max[k] - self.boxes[k + 3][lane]);
                growths[lane] +=
                    (if below > 0.0 { below } else { 0.0 }) + if above > 0.0 { above } else { 0.0 };
            }
        }
        growths
    }

    #[inline(always)]
    pub(crate) fn has(&self, lane: usize) -> bool {
        self.boxes[0][lane] <= self.boxes[3][lane]
    }

    /// Returns a bit for each lane that has a box.
    #[inline(always)]
    pub(crate) fn used(&self, simd: impl Simd) -> u32 {
        simd.at_most(&self.boxes[0], &self.boxes[3])
    }
}

/// Returns the sum of a box's extents; zero for an invalid one.
pub(crate) fn extent_sum(aabb: &Aabb) -> f32 {
    if !aabb.is_valid() {
        return 0.0;
    }
    (0..3).map(|k| aabb.max[k] - aabb.min[k]).sum()
}
