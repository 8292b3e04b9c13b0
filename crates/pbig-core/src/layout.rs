//! The structs that Rust and WGSL share. `shaders/shared/types.wgsl` has the same fields; a test compares names and offsets.

use crate::{Aabb, ProxyFilter};
use bytemuck::{Pod, Zeroable};

/// Number of lanes of a workgroup, and of boxes of a segment (PBIG 5.2).
pub const LANES: u32 = 256;
/// Most levels of cells. The last level has one cell for everything.
pub const MAX_LEVELS: usize = 8;
/// Most cells that a box touches along one axis of its level.
pub const MAX_SPAN: u32 = 4;
/// Fewest cells along an axis that is divided. Two overlapping boxes must not meet a second time by wrapping around, so the
/// `2 * MAX_SPAN - 1` cells that they touch together must be distinct.
pub const FEWEST_CELLS: u32 = 2 * MAX_SPAN;
/// Level of an invalid box.
pub const NO_LEVEL: u32 = u32::MAX;
/// Number of cells of a workgroup of the scan and of the schedule.
pub const CELLS_PER_BLOCK: u32 = 4 * LANES;
/// Number of bits of an entry for the box. Above them are [`MOVED`] and the axes.
pub const BOX_BITS: u32 = 28;
/// The first of three bits of an entry, one for each axis. A bit is set if this is the box's lowest cell on the axis.
pub const AXIS_BITS: u32 = 29;
/// Bit of an entry and of [`Located::level`] in a search for changes: the box has changed.
pub const MOVED: u32 = 1 << BOX_BITS;
/// Bit of [`BoxChange::marked_id`]: at the last update the box overlapped nothing.
pub const WAS_ABSENT: u32 = 1 << 31;
/// Bit of [`Params::flags`]: filters are tested.
pub const FILTERED: u32 = 1;
/// Bit of [`Params::flags`]: the output is records (docs/PAIR_FORMAT.md), not plain pairs.
pub const PACKED: u32 = 2;
/// Bit of [`Params::flags`]: the output of `check_all` is one bit a pair.
pub const BITS: u32 = 4;

/// An [`Aabb`] in ordered integers, see [`ordered`].
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct DeviceBox {
    /// Lower corner.
    pub low: [i32; 3],
    /// Upper corner.
    pub high: [i32; 3],
}

impl DeviceBox {
    /// A box that overlaps nothing: all of `low` lies above all of `high`, beyond the infinities.
    pub const INVALID: Self = Self { low: [i32::MAX; 3], high: [i32::MIN; 3] };

    /// Returns the box in ordered integers.
    #[inline]
    pub fn new(aabb: &Aabb) -> Self {
        let valid = Self { low: aabb.min.map(ordered), high: aabb.max.map(ordered) };
        if aabb.is_valid() { valid } else { Self::INVALID }
    }
}

/// Returns an integer for a float, in the same order; both zeros become one. Devices may flush denormals and may assume
/// that there are no infinities, but they compare integers exactly.
#[inline]
pub fn ordered(x: f32) -> i32 {
    let bits = (x + 0.0).to_bits() as i32;
    bits ^ (((bits >> 31) as u32) >> 1) as i32
}

/// A box now and at the last update.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Motion {
    /// The box now.
    pub now: DeviceBox,
    /// The box at the last update.
    pub before: DeviceBox,
}

/// A changed box.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct BoxChange {
    /// Id of the box, with [`WAS_ABSENT`].
    pub marked_id: u32,
    /// The box now.
    pub now: DeviceBox,
}

/// A changed filter.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub struct FilterChange {
    /// Id of the box.
    pub id: u32,
    /// The filter now.
    pub filter: ProxyFilter,
}

/// Cells that a box touches at the finest resolution, and its level.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Located {
    /// Lowest cell on each axis.
    pub low: [i32; 3],
    /// Highest cell on each axis.
    pub high: [i32; 3],
    /// Its level, with [`MOVED`], or [`NO_LEVEL`].
    pub level: u32,
}

/// Cells of one size.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Level {
    /// Number of cells on each axis; boxes beyond wrap around. An axis of one cell is not divided.
    pub dims: [u32; 3],
    /// Exponent: a cell of the level has `2^shift` of the finest cells on each axis.
    pub shift: u32,
    /// Index of the level's first cell among all cells.
    pub first_cell: u32,
    /// Padding to a multiple of 16 bytes.
    pub unused: [u32; 3],
}

/// Parameters of all kernels of a call.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Params {
    /// Lower corner of cell 0.
    pub origin: [f32; 3],
    /// Cells per unit of length at the finest resolution.
    pub scale: f32,
    /// Lower bounds that coordinates are clamped to before they become cells, as ordered integers.
    pub clamp_low: [i32; 3],
    /// Number of boxes, with invalid ones.
    pub boxes: u32,
    /// Upper bounds that coordinates are clamped to before they become cells, as ordered integers.
    pub clamp_high: [i32; 3],
    /// Number of levels in use.
    pub levels: u32,
    /// Number of cells of all levels.
    pub cells: u32,
    /// Most entries of a small cell.
    pub small_cell: u32,
    /// Number of column segments of a large work item.
    pub columns: u32,
    /// Flags: [`FILTERED`], [`PACKED`], [`BITS`].
    pub flags: u32,
    /// If not 0: only pairs of a box below this index and a box from it on are wanted.
    pub split: u32,
    /// Capacity for entries.
    pub entry_capacity: u32,
    /// Capacity for slots.
    pub slot_capacity: u32,
    /// Capacity for small work items.
    pub small_capacity: u32,
    /// Capacity for large work items.
    pub large_capacity: u32,
    /// Number of boxes that the device has from the last update, in a search for changes.
    pub known: u32,
    /// Length of the list of changed boxes.
    pub box_changes: u32,
    /// Length of the list of changed filters.
    pub filter_changes: u32,
    /// Levels, finest first.
    pub level: [Level; MAX_LEVELS],
}

/// Range of the work items of one dispatch of the check kernels.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Chunk {
    /// First small work item.
    pub first_small: u32,
    /// Number of small work items.
    pub small_items: u32,
    /// First large work item.
    pub first_large: u32,
    /// Number of large work items.
    pub large_items: u32,
    /// Capacity of the output, in words.
    pub word_capacity: u32,
    /// Padding.
    pub unused: u32,
    /// Number of pairs after which the call ends in an error: low and high half.
    pub pairs_left: [u32; 2],
}

/// Entries of a cell by kind: until `scan_add` counts, then the ends of both lists.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Cell {
    /// Boxes of the cell's own level.
    pub residents: u32,
    /// Boxes of finer levels.
    pub visitors: u32,
}

/// A small cell in the schedule.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Pod, Zeroable)]
pub struct Slot {
    /// First entry of the cell.
    pub start: u32,
    /// Number of entries, and number of residents `<< 16`.
    pub shape: u32,
    /// Number of pairs of the cells before it in its block.
    pub first_pair: u32,
}

/// A work item: [`LANES`] consecutive pairs of the small cells of a block, or the rest.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Pod, Zeroable)]
pub struct SmallItem {
    /// Index of the first slot.
    pub slot: u32,
    /// Number of slots that the item may reach into.
    pub slots: u32,
    /// First pair, counted in the block.
    pub first_pair: u32,
    /// Number of pairs.
    pub pairs: u32,
}

/// A work item: a segment of rows of a large cell against some segments of columns.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Pod, Zeroable)]
pub struct LargeItem {
    /// First entry of the cell.
    pub start: u32,
    /// Number of entries of the cell.
    pub boxes: u32,
    /// Number of residents of the cell.
    pub residents: u32,
    /// Segment of rows.
    pub row: u32,
    /// First segment of columns.
    pub column: u32,
    /// End of the segments of columns.
    pub end_column: u32,
}

/// Lengths of the lists that the map makes, even if they do not fit.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Counters {
    /// Number of entries of all cells.
    pub entries: u32,
    /// Number of small cells with work.
    pub slots: u32,
    /// Number of small work items.
    pub small_items: u32,
    /// Number of large work items.
    pub large_items: u32,
}

/// Counts of a check, even if its output does not fit. Each has a low and a high half.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Totals {
    /// Number of words of output.
    pub words: [u32; 2],
    /// Number of pairs.
    pub pairs: [u32; 2],
    /// Number of tests.
    pub made: [u32; 2],
    /// Number of tests that the entries alone decide: another cell owns the pair, or, in a search for changes, neither
    /// box has changed.
    pub redundant: [u32; 2],
    /// Number of overlapping or changed pairs, including those that filters forbid.
    pub overlaps: [u32; 2],
}

/// Returns the number of two halves.
pub fn wide([low, high]: [u32; 2]) -> u64 {
    u64::from(high) << 32 | u64::from(low)
}

/// Returns the two halves of a number.
pub fn halves(x: u64) -> [u32; 2] {
    [x as u32, (x >> 32) as u32]
}

/// A filter is one `vec4<u32>` on the device.
const _: () = assert!(size_of::<ProxyFilter>() == 16);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ordered_integers_keep_the_order_of_all_floats() {
        let rising = [
            f32::NEG_INFINITY,
            f32::MIN,
            -1.0,
            -f32::MIN_POSITIVE,
            -1e-45,
            0.0,
            1e-45,
            f32::MIN_POSITIVE,
            1.0,
            f32::MAX,
            f32::INFINITY,
        ];
        assert!(rising.windows(2).all(|two| ordered(two[0]) < ordered(two[1])));
        assert_eq!(ordered(-0.0), ordered(0.0));
    }

    #[test]
    fn an_invalid_box_overlaps_nothing_not_even_everything() {
        let all = DeviceBox::new(&Aabb::new([f32::NEG_INFINITY; 3], [f32::INFINITY; 3]));
        for invalid in [Aabb::NOWHERE, Aabb::new([f32::INFINITY; 3], [f32::NEG_INFINITY; 3])] {
            let invalid = DeviceBox::new(&invalid);
            assert_eq!(invalid, DeviceBox::INVALID);
            assert!(!(0..3).any(|k| invalid.low[k] <= all.high[k] || all.low[k] <= invalid.high[k]));
        }
    }
}
