//! The choice between a grid and a tree for a search of all boxes, made when the boxes lie in the grid's cells.
//!
//! Work is counted in tests of codes, eight to an instruction: about 0.35 ns each.

/// Boxes, one in so many, whose candidates are counted.
pub(crate) const COUNT_ONE_IN: usize = 32;

/// Oversize boxes whose candidates are counted, at most.
pub(crate) const COUNTED_OVERSIZE: usize = 16;

/// Sampled oversize boxes, at least: each can meet most of the others.
pub(crate) const SAMPLED_OVERSIZE: usize = 32;

/// Tests of codes that take as long as an exact test of two boxes that lie one after the other in memory.
pub(crate) const WORK_OF_EXACT_TEST: u64 = 4;

/// Tests of codes that take as long as one that does not tell two boxes apart, and the exact test after it.
pub(crate) const WORK_OF_VAGUE_TEST: u64 = 6;

/// Tests of codes that take as long as what can lie anywhere in memory: an entry of a list, a box that is met, or the ends of a
/// run of cells.
pub(crate) const WORK_OF_ENTRY: u64 = 16;

/// Tests for each box up to which a grid is searched: a tree is sorted and joined in about the same time.
const GRID_UP_TO_PER_BOX: u64 = 400;

/// Tests of a box that each of its overlaps pays for: in a crowd each box meets many, and a tree is no faster.
const GRID_UP_TO_PER_PAIR: u64 = 32;

/// Sampled boxes in cells, at least and at most.
const SAMPLED: std::ops::Range<usize> = 64..512;

/// Work of the whole sample for each box of the world, about.
const SAMPLE_WORK_PER_BOX: u64 = 16;

/// Returns true if so much work, or work in vain, leaves the grid faster than a tree.
pub(crate) fn is_light(boxes: usize, work: u64) -> bool {
    work <= GRID_UP_TO_PER_BOX * boxes as u64
}

/// Returns the part of a box's work that its overlaps do not pay for.
pub(crate) fn in_vain(work: u64, overlaps: u64) -> u64 {
    work.saturating_sub(GRID_UP_TO_PER_PAIR * overlaps)
}

/// Returns the step of the sample: one box in so many is searched, to estimate the work in vain.
pub(crate) fn sample_one_in(boxes: usize, work: u64) -> usize {
    let by_work = (work / (SAMPLE_WORK_PER_BOX * boxes.max(1) as u64)) as usize;
    by_work.clamp(boxes / SAMPLED.end, boxes / SAMPLED.start) + 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grid_is_searched_if_cells_hold_few_or_many_pair() {
        assert!(is_light(1000, 400_000) && !is_light(1000, 400_001));
        assert_eq!((in_vain(4000, 100), in_vain(4000, 1000)), (800, 0));
        assert_eq!(sample_one_in(100_000, 16_000_000), 196);
        assert_eq!(sample_one_in(100_000, 800_000_000), 501);
        assert_eq!(sample_one_in(100_000, u64::MAX), 1563);
        assert_eq!(sample_one_in(0, 0), 1);
    }
}
