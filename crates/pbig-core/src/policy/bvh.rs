//! Upkeep of the index for queries. A node is eight boxes; looking at one takes about 5 ns, sorting a box about 150.

/// Minimum share of changed boxes, as one in this number, for all boxes to be read in order. That takes about 3 ns a box; a box
/// alone takes 50, because it updates its ancestors.
pub(crate) const REFIT_SHARE: usize = 16;

/// Maximum growth of a node's extents since the last sort. A node that grew more counts as grown.
pub(crate) const GROWN_TO: f32 = 2.0;

/// Minimum share of grown nodes, as one in this number, for the order to be bad.
pub(crate) const GROWN_SHARE: usize = 8;

/// Minimum work of queries, in sorts, before boxes are sorted although their order is not bad: such a sort adds at most an
/// eighth to the work.
pub(crate) const SORTS_FOR_ORDER: u64 = 8;

/// Returns the number of nodes that queries look at before a sort: it then takes about as long as they did: 256 nodes for the boxes of a
/// leaf, a quarter for reading a box, and 64 so that tiny trees are left alone.
pub(crate) fn nodes_for_sort(leaves: u32, boxes: usize) -> u64 {
    64 + 256 * u64::from(leaves) + boxes as u64 / 4
}

/// Minimum share of leaves with a box, as one in this number, for a layout to stay when all boxes are read.
pub(crate) const FULL_LEAVES_SHARE: usize = 4;

/// Minimum share of the maximum number of leaves outside the tree, as one in this number, for the order to be bad.
pub(crate) const FEW_LOOSE_SHARE: usize = 8;

/// Returns the maximum number of leaves outside the tree, which every query looks at.
pub(crate) fn loose_leaves(leaves: u32) -> usize {
    8 + leaves as usize / 16
}
