//! The choice between a grid and a tree for a search of all boxes, made when the boxes lie in the grid's cells.
//!
//! Work is counted in tests of codes, eight to an instruction: about 0.35 ns each.

/// Step from one box whose candidates are counted to the next.
pub(crate) const COUNT_ONE_IN: usize = 32;

/// Maximum number of oversize boxes whose candidates are counted.
pub(crate) const COUNTED_OVERSIZE: usize = 16;

/// Minimum number of sampled oversize boxes: each can meet most of the others.
pub(crate) const SAMPLED_OVERSIZE: usize = 32;

/// Tests of codes that take as long as an exact test of two boxes that lie one after the other in memory.
pub(crate) const WORK_OF_EXACT_TEST: u64 = 4;

/// Tests of codes that take as long as one that does not tell two boxes apart, and the exact test after it.
pub(crate) const WORK_OF_VAGUE_TEST: u64 = 6;

/// Maximum number of tests for each box for a search of the grid, in binary logarithms of the number of boxes: a tree is sorted and
/// joined in about the same time.
const GRID_UP_TO_LOGS_PER_BOX: u64 = 31;

/// Maximum number of tests of any box that is searched for, of two sets, for these boxes to stay unsorted. They are at most half of the
/// boxes, and from 300 boxes on a grid may make as many tests: the estimate of these does not matter.
pub(crate) const UNSORTED_UP_TO_TESTS: u64 = 512;

/// Number of tests that each overlap of a box justifies: in a crowd each box overlaps many, and a tree is not faster.
const GRID_UP_TO_PER_PAIR: u64 = 32;

/// Maximum work of a join of a tree for each box, in binary logarithms of their number: within [`crate::WORK_LIMIT`]. Streamed segment
/// trees take as long as about 1400 for each of 320,000 boxes.
const JOIN_UP_TO_LOGS_PER_BOX: u64 = 48;

/// Minimum number of leaves of a tree for each sampled one, and about the maximum number of sampled ones.
const LEAVES_PER_SAMPLED: (u32, u32) = (16, 256);

/// Minimum and maximum number of sampled boxes in cells.
const SAMPLED: std::ops::Range<usize> = 64..512;

/// Approximate work of the whole sample for each box of the world.
const SAMPLE_WORK_PER_BOX: u64 = 16;

/// Returns true if a grid with this work is faster than a tree.
pub(crate) fn is_light(boxes: usize, work: u64) -> bool {
    work <= logs(boxes, GRID_UP_TO_LOGS_PER_BOX)
}

/// Returns the part of a box's work that its overlaps do not pay for.
pub(crate) fn in_vain(work: u64, overlaps: u64) -> u64 {
    work.saturating_sub(GRID_UP_TO_PER_PAIR * overlaps)
}

/// Returns the step from one sampled box to the next. Sampled boxes are searched, to estimate the work in vain.
pub(crate) fn sample_one_in(boxes: usize, work: u64) -> usize {
    let by_work = (work / (SAMPLE_WORK_PER_BOX * boxes.max(1) as u64)) as usize;
    by_work.clamp(boxes / SAMPLED.end, boxes / SAMPLED.start) + 1
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

/// Returns the step from one sampled leaf of a tree to the next.
pub(crate) fn leaves_per_sampled(leaves: u32) -> usize {
    let (least, sampled) = LEAVES_PER_SAMPLED;
    least.max(leaves / sampled) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grid_is_searched_if_cells_hold_few_or_many_pair() {
        assert!(is_light(1024, 310 << 10) && !is_light(1024, (310 << 10) + 1));
        assert_eq!((in_vain(4000, 100), in_vain(4000, 1000)), (800, 0));
        assert_eq!(sample_one_in(100_000, 16_000_000), 196);
        assert_eq!(sample_one_in(100_000, 800_000_000), 501);
        assert_eq!(sample_one_in(100_000, u64::MAX), 1563);
        assert_eq!(sample_one_in(0, 0), 1);
    }

    #[test]
    fn a_tree_is_joined_while_its_work_grows_like_boxes_and_their_logarithm() {
        assert_eq!([0, 1024, 1218, 1 << 20].map(join_up_to_work), [0, 480 << 10, 492 * 1218, 960 << 20]);
        assert_eq!([1, 4096, 8192].map(leaves_per_sampled), [16, 16, 32]);
    }
}
