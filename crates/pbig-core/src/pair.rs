//! Pairs of box ids.

use bytemuck::{Pod, Zeroable};

/// Two overlapping boxes by id, `a < b`. Ordered by `a`, then `b`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Pair {
    /// The smaller id.
    pub a: u32,
    /// The larger id.
    pub b: u32,
}

/// A box of a first set and a box of a second one that overlap: two ids of two lists, so either may be the larger. Ordered by
/// `a`, then `b`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CrossPair {
    /// The id in the first set.
    pub a: u32,
    /// The id in the second set.
    pub b: u32,
}

impl Pair {
    /// Returns the pair of two different ids, given in either order.
    #[inline(always)]
    pub fn new(i: u32, j: u32) -> Self {
        Self { a: i.min(j), b: i.max(j) }
    }
}
