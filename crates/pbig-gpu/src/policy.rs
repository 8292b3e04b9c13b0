//! The rules on counts by which the device declines a call, and the limit of a dispatch.

use crate::GpuOptions;
use crate::layout::{BOX_BITS, MAX_LEVELS, MAX_SPAN};

/// Maximum number of segments of columns of a large item.
pub(crate) const WIDEST_ITEM: u32 = 8;

/// Maximum number of entries of a box: in the cells of its own level, of the next one and so on, and in the last level's only cell. A
/// coarser cell is at least two finer ones long, so a box touches 4, then 3, then 2 cells on an axis.
const ENTRIES_OF_A_BOX: u64 = 64 + 27 + 8 * (MAX_LEVELS as u64 - 3) + 1;
const _: () = assert!(MAX_SPAN == 4);

/// Maximum number of boxes of a search: 32 bits count their entries. They also count the work items of a cell that has all boxes, which
/// are 2^17 rows by 2^17 / 8 groups of 8 columns.
pub(crate) const MAX_BOXES: u64 = 32_000_000;
const _: () = assert!(MAX_BOXES * ENTRIES_OF_A_BOX <= u32::MAX as u64 && MAX_BOXES <= 1 << 25);
const _: () = assert!(MAX_BOXES <= 1 << BOX_BITS, "an entry names each box");

/// Maximum number of tests for each box and binary logarithm of the number of boxes. Uniform cubes make about one.
const TESTS_PER_BOX_AND_LOG: u64 = 3;

/// Maximum number of tests for each pair that a sample promises, as on the CPU: in a crowd no other way is faster.
const TESTS_PER_PAIR: u64 = 32;

/// Number of tests that every search may make: the device is done in less time than the CPU takes to begin.
const ALWAYS_ALLOWED_TESTS: u64 = 1 << 17;

/// Returns the maximum number of tests of a search. Beyond it the device declines: the CPU's work is bounded for every shape,
/// that of one grid is not. A caller who wants larger cells allows their tests.
pub(crate) fn most_tests(boxes: u64, expected_pairs: u64, boxes_per_cell: f32) -> u64 {
    let by_boxes = TESTS_PER_BOX_AND_LOG * boxes * u64::from((boxes | 1).ilog2());
    let by_pairs = TESTS_PER_PAIR.saturating_mul(expected_pairs);
    let most = by_boxes.saturating_add(by_pairs).saturating_add(ALWAYS_ALLOWED_TESTS);
    // A NaN is 0 as an integer.
    let larger = (boxes_per_cell / GpuOptions::DEFAULT.boxes_per_cell).clamp(1.0, 1024.0) as u64;
    most.saturating_mul(larger.max(1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::LANES;

    /// Returns the maximum number of tests of one dispatch, for chunks of this number of small and large items.
    const fn tests_of_dispatch([small, large]: [u32; 2], columns: u32) -> u64 {
        let lanes = LANES as u64;
        let (small, large) = (small as u64 * lanes, large as u64 * lanes * lanes * columns as u64);
        if small > large { small } else { large }
    }

    /// A device with a twentieth of a modern one's speed makes 10^11 tests a second: 20 ms.
    #[test]
    fn no_dispatch_of_the_defaults_makes_more_than_two_billion_tests() {
        assert_eq!(tests_of_dispatch(GpuOptions::DEFAULT.chunk, WIDEST_ITEM), 1 << 31);
    }

    /// The table against the kernels' shifts: boxes of up to four cells on an axis, wherever they begin.
    #[test]
    fn a_box_has_no_more_entries_than_the_boxes_allow_for() {
        let touched =
            |low: u64, shift: usize| ((low + u64::from(MAX_SPAN) - 1) >> shift) - (low >> shift) + 1;
        let most = |shift: usize| (0..1024).map(|low| touched(low, shift).pow(3)).max().expect("numbers");
        assert_eq!((0..MAX_LEVELS - 1).map(most).sum::<u64>() + 1, ENTRIES_OF_A_BOX);
    }

    #[test]
    fn larger_cells_allow_as_many_times_the_tests() {
        let times = |wanted: f32| most_tests(1000, 0, wanted) / most_tests(1000, 0, 4.0);
        assert_eq!([f32::NAN, -1.0, 2.0, 4.0, 32.0, f32::INFINITY].map(times), [1, 1, 1, 1, 8, 1024]);
    }

    /// One ground under ten million boxes: each pair of the ground is one test more.
    #[test]
    fn ordinary_scenes_are_far_below_the_limit_and_crowds_beyond() {
        let ten_million = 10_000_000;
        let most_tests = |boxes, pairs| most_tests(boxes, pairs, GpuOptions::DEFAULT.boxes_per_cell);
        assert!(most_tests(ten_million, 0) > 2 * (18 * ten_million + ten_million));
        assert!(most_tests(ten_million, 0) < ten_million * ten_million / 1000);
        assert!(most_tests(25_000, 0) < 25_000 * 25_000 / 2 / 20);
        assert!(most_tests(25_000, 25_000 * 12_500) > 25_000 * 25_000);
    }
}
