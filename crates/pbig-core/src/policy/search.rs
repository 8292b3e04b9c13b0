//! The most work of a search in a grid and in a tree: what takes more goes on in another way.
//!
//! Work is counted in tests of codes, eight to an instruction: about 0.35 ns each.

/// Work of a look at a row of cells: 11 ns.
pub(crate) const WORK_OF_ROW: u64 = 32;

/// Work, for a box, of a look at all of its five runs, which is all that boxes as small as a cell need.
pub(crate) const WORK_OF_RUNS: u64 = 16;

/// Work of an exact test of two boxes that lie one after the other in memory.
pub(crate) const WORK_OF_EXACT_TEST: u64 = 4;

/// Work of a test of codes that does not tell two boxes apart, and the exact test after it.
pub(crate) const WORK_OF_VAGUE_TEST: u64 = 6;

/// Work of a look at a node of a tree.
pub(crate) const WORK_OF_NODE: u64 = 8;

/// Maximum work in a grid for each box, in binary logarithms of their number: a tree is sorted and joined in about the same time. (With 31,
/// the edges of two real meshes were searched in a tree after most of a grid, and took 1.5 and 3 times as long.)
const GRID_UP_TO_LOGS_PER_BOX: u64 = 40;

/// Maximum work of a join of a tree for each box, in binary logarithms of their number: streamed segment trees take about as much, 75 to
/// 270.
const JOIN_UP_TO_LOGS_PER_BOX: u64 = 96;

/// Work that each overlap of a box justifies: in a crowd each box overlaps many, and no other way is faster.
const WORK_PER_PAIR: u64 = 32;

/// Returns the part of some work that overlaps do not pay for.
pub(crate) fn in_vain(work: u64, overlaps: u64) -> u64 {
    work.saturating_sub(WORK_PER_PAIR * overlaps)
}

/// Returns the maximum work in a grid that overlaps do not pay for.
pub(crate) fn grid_up_to_work(boxes: usize) -> u64 {
    logs(boxes, GRID_UP_TO_LOGS_PER_BOX)
}

/// Returns the maximum work of a join of a tree that overlaps do not pay for.
pub(crate) fn join_up_to_work(boxes: usize) -> u64 {
    logs(boxes, JOIN_UP_TO_LOGS_PER_BOX)
}

/// Returns a work for each box, in binary logarithms of the number of boxes. These are rounded down to quarters, as integers, so that
/// every machine has the same.
fn logs(boxes: usize, per_box: u64) -> u64 {
    let quarters = (boxes.clamp(1, u32::MAX as usize) as u128).pow(4).ilog2();
    per_box * boxes as u64 * u64::from(quarters) / 4
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_may_grow_like_boxes_and_their_logarithm() {
        assert_eq!([0, 1024, 1218, 1 << 20].map(join_up_to_work), [0, 960 << 10, 984 * 1218, 1920 << 20]);
        assert_eq!(grid_up_to_work(1024), 400 << 10);
        assert_eq!((in_vain(4000, 100), in_vain(4000, 1000)), (800, 0));
    }
}
