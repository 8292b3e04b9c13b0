//! The structs that Rust and WGSL share. `shaders/shared/types.wgsl` has the same fields, and says what they hold; a test
//! compares names, offsets and constants.

use bytemuck::{Pod, Zeroable};
use pbig_core::{Aabb, ProxyFilter};

/// Number of lanes of a workgroup, and of boxes of a segment (PBIG 5.2).
pub const LANES: u32 = 256;
/// Number of workgroups in a row of a dispatch. The portable limit is 65,535.
pub const GROUPS_PER_ROW: u32 = 32_768;
/// Maximum number of levels of cells. The last level has one cell for everything.
pub const MAX_LEVELS: usize = 8;
/// Maximum number of cells that a box touches along one axis of its level.
pub const MAX_SPAN: u32 = 4;
/// Fewest cells along an axis that is divided. Two overlapping boxes must not meet a second time by wrapping around, so the
/// `2 * MAX_SPAN - 1` cells that they touch together must be distinct.
pub const FEWEST_CELLS: u32 = 2 * MAX_SPAN;
/// Number of cells of a workgroup of the schedule.
pub const CELLS_PER_BLOCK: u32 = 4 * LANES;
/// Number of lists of a workgroup of the scan.
pub const COUNTS_PER_BLOCK: u32 = 4 * LANES;
/// Maximum number of pairs of a row that is ordered by counting.
pub const SHORT_ROW: u32 = 512;
/// Second boxes of a window of a long row, which a workgroup orders.
pub const WINDOW: u32 = 32_768;
/// Index of the first piece among the words of [`pbig_shaders::Buffer::LongRows`]. Each has three words.
pub const FIRST_PIECE: u32 = 4;
/// Number of bits of an entry for the box. Above them are an unused bit and the axes.
pub const BOX_BITS: u32 = 28;
/// Bit of [`Params::flags`]: filters are tested.
pub const FILTERED: u32 = 1;
/// Bit of [`Params::flags`]: redundant tests and overlaps are counted.
pub const COUNTED: u32 = 2;
/// Bit of [`Params::flags`]: boxes that live on the device were not measured yet, so there is no plan and no search.
pub const UNPLANNED: u32 = 4;
/// Words of [`pbig_shaders::Buffer::Summary`] for the size classes: four each.
pub const CLASS_WORDS: u32 = 1024;
/// Number of words of [`pbig_shaders::Buffer::Summary`]. Behind the size classes it has six for each box of the sample.
pub const SUMMARY_WORDS: u32 = CLASS_WORDS + 6000;
/// [`PairCount::status`]: all pairs are there.
pub const COMPLETE: u32 = 0;
/// [`PairCount::status`]: there was no plan yet.
pub const NOT_PLANNED: u32 = 1;
/// [`PairCount::status`]: a list or the pairs did not fit.
pub const TOO_LARGE: u32 = 2;
/// [`PairCount::status`]: the plan was made for other boxes.
pub const PLAN_REFUSED: u32 = 3;

/// Declares structs of plain 32-bit numbers.
macro_rules! shared_structs {
    ($($(#[$about:meta])* $name:ident { $($field:ident: $type:ty),* })*) => {$(
        $(#[$about])*
        #[repr(C)]
        #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
        #[allow(missing_docs, reason = "types.wgsl describes the fields")]
        pub struct $name { $(pub $field: $type),* }
    )*};
}

shared_structs! {
    /// Cells that a box touches at its level: the lowest ones; the level and the numbers of cells, or `u32::MAX`.
    Located { low: [i32; 3], shape: u32 }
    /// Cells of one size.
    Level { dims: [u32; 3], shift: u32, first_cell: u32, unused: [u32; 3] }
    /// Parameters of all kernels of a call.
    Params {
        boxes: u32, levels: u32, tick_exponent: i32, cells_per_tick: u32,
        cells: u32, small_cell: u32, columns: u32, flags: u32,
        entry_capacity: u32, slot_capacity: u32, small_capacity: u32, large_capacity: u32,
        most_tests: u32, unused: [u32; 3], level: [Level; MAX_LEVELS]
    }
    /// Range of the work of one dispatch: work items for the check kernels, or grouped pairs.
    Chunk {
        first_small: u32, small_items: u32, first_large: u32, large_items: u32,
        word_capacity: u32, first_pair: u32, pairs_left: [u32; 2]
    }
    /// Entries of a cell by kind: until the scan counts, then the ends of both lists, then their starts.
    Cell { residents: u32, visitors: u32 }
    /// A small cell in the schedule.
    #[derive(Eq, PartialOrd, Ord)]
    Slot { start: u32, shape: u32, first_pair: u32 }
    /// A work item: [`LANES`] consecutive pairs of the small cells of a block, or the rest.
    #[derive(Eq, PartialOrd, Ord)]
    SmallItem { slot: u32, slots: u32, first_pair: u32, pairs: u32 }
    /// A work item: a segment of rows of a large cell against some segments of columns.
    #[derive(Eq, PartialOrd, Ord)]
    LargeItem { start: u32, boxes: u32, residents: u32, row: u32, column: u32, end_column: u32 }
    /// Lengths of the lists that the map makes, even if they do not fit; valid boxes; tests in units of [`LANES`], and 1 if
    /// their number exceeds 32 bits.
    Counters {
        entries: u32, slots: u32, small_items: u32, large_items: u32,
        valid: u32, tests: u32, unused: u32, too_many_tests: u32
    }
    /// Counts of a check, even if its output does not fit. Each has a low and a high half. A test is redundant if another cell
    /// owns the pair. Overlaps include pairs that filters forbid. Without [`COUNTED`] there are only the words.
    Totals { words: [u32; 2], made: [u32; 2], redundant: [u32; 2], overlaps: [u32; 2] }
    /// The content of the buffer [`crate::DevicePairs::count`].
    ///
    /// Unless [`PairCount::is_complete`], a call has no pairs: repeat it in a later frame, when the counts of this one are known.
    /// - `pairs`: number of pairs in the buffer;
    /// - `status`: 0 if all are there, 1 if the boxes were not measured yet, 2 if pairs or lists did not fit, 3 if the plan was made for
    ///   other boxes;
    /// - `needed`: number of pairs that were found, whether they fit or not;
    /// - `dispatch`: arguments for an indirect dispatch that has a lane for each pair, in workgroups of 256 lanes. The workgroup
    ///   (x, y) has the pairs from 256 (32,768 y + x) on.
    #[derive(Eq)]
    PairCount { pairs: u32, status: u32, needed: u32, unused0: u32, dispatch: [u32; 3], unused1: u32 }
}

impl PairCount {
    /// Bytes before `dispatch`.
    pub const DISPATCH_AT: u64 = 16;

    /// Returns true if all pairs are in the buffer.
    pub fn is_complete(&self) -> bool {
        self.status == COMPLETE
    }
}

/// Returns the number of two halves.
pub fn wide([low, high]: [u32; 2]) -> u64 {
    u64::from(high) << 32 | u64::from(low)
}

/// Returns the two halves of a number.
pub fn halves(x: u64) -> [u32; 2] {
    [x as u32, (x >> 32) as u32]
}

/// Bytes of a box on the device: six floats.
pub(crate) const BOX_BYTES: u64 = size_of::<Aabb>() as u64;
/// Bytes of a filter on the device: one `vec4<u32>`.
pub(crate) const FILTER_BYTES: u64 = size_of::<ProxyFilter>() as u64;
const _: () = assert!(BOX_BYTES == 24 && FILTER_BYTES == 16);
