//! Every struct that is shared with WGSL: field by field those of `shaders/shared/types.wgsl`, which a
//! test compares by name and offset.

use crate::{Aabb, ProxyFilter};
use bytemuck::{Pod, Zeroable};

/// Lanes of a workgroup and boxes of a segment (PBIG 5.2).
pub const LANES: u32 = 256;
/// Levels of cells, the last of which is one cell for everything.
pub const MOST_LEVELS: usize = 8;
/// Cells that a box may touch along one axis of a level.
pub const MOST_SPAN: u32 = 4;
/// Fewest cells along an axis that is divided: two boxes that overlap must not meet a second time by
/// wrapping around, so the cells they touch together, `2 * MOST_SPAN - 1`, must be distinct.
pub const FEWEST_CELLS: u32 = 2 * MOST_SPAN;
/// The level of an invalid box.
pub const NO_LEVEL: u32 = u32::MAX;
/// Cells to a workgroup of the scan and of the schedule.
pub const CELLS_PER_BLOCK: u32 = 4 * LANES;
/// Bits of an entry that number the box; above them are [`MOVED`] and the axes.
pub const BOX_BITS: u32 = 28;
/// The first of the three bits of an entry that say on which axes this is the box's lowest cell.
pub const AXIS_BITS: u32 = 29;
/// Bit of an entry and of [`Located::level`], in a search for changes: the box is not what it was.
pub const MOVED: u32 = 1 << BOX_BITS;
/// Bit of [`Move::place`]: before, the box overlapped nothing.
pub const ANEW: u32 = 1 << 31;
/// Bit of [`Params::flags`]: filters are tested.
pub const FILTERED: u32 = 1;
/// Bit of [`Params::flags`]: the output is records (docs/PAIR_FORMAT.md) rather than plain pairs.
pub const PACKED: u32 = 2;
/// Bit of [`Params::flags`]: the output of `check_all` is one bit a pair.
pub const BITS: u32 = 4;

/// An [`Aabb`] in ordered integers, see [`ordered`].
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Box {
    /// Lower corner.
    pub low: [i32; 3],
    /// Upper corner.
    pub high: [i32; 3],
}

impl Box {
    /// Overlaps nothing: all of `low` lies above all of `high`, beyond the infinities.
    pub const INVALID: Self = Self { low: [i32::MAX; 3], high: [i32::MIN; 3] };

    /// The box in ordered integers.
    #[inline]
    pub fn new(aabb: &Aabb) -> Self {
        let valid = Self { low: aabb.min.map(ordered), high: aabb.max.map(ordered) };
        if aabb.is_valid() { valid } else { Self::INVALID }
    }
}

/// The integer of a float, in the same order; both zeros become one. Devices may flush denormals and
/// assume that there are no infinities: integers they compare exactly.
#[inline]
pub fn ordered(x: f32) -> i32 {
    let bits = (x + 0.0).to_bits() as i32;
    bits ^ (((bits >> 31) as u32) >> 1) as i32
}

/// A box as it is, and as it was at the last update.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Motion {
    /// As it is.
    pub now: Box,
    /// As it was.
    pub before: Box,
}

/// A box that is to be something else.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Move {
    /// Its id, and [`ANEW`].
    pub place: u32,
    /// What it is from now on.
    pub now: Box,
}

/// A box that is to have another filter.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub struct Refilter {
    /// Its id.
    pub id: u32,
    /// Its filter from now on.
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
    /// Cells on each axis before they wrap around; an axis of one cell is not divided.
    pub dims: [u32; 3],
    /// The level's cells are `2^shift` of the finest on each axis.
    pub shift: u32,
    /// Where the level's cells begin among all cells.
    pub first_cell: u32,
    /// Padding to a multiple of 16 bytes.
    pub unused: [u32; 3],
}

/// What all kernels of a call share.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Params {
    /// Where cell 0 begins.
    pub origin: [f32; 3],
    /// Cells per unit of length at the finest resolution.
    pub scale: f32,
    /// Coordinates below are cut off before they become cells; ordered.
    pub reach_low: [i32; 3],
    /// Boxes in all, invalid ones too.
    pub boxes: u32,
    /// Coordinates above are cut off before they become cells; ordered.
    pub reach_high: [i32; 3],
    /// Levels in use.
    pub levels: u32,
    /// Cells of all levels.
    pub cells: u32,
    /// Most entries of a small cell.
    pub small_cell: u32,
    /// Column segments of one large work item.
    pub columns: u32,
    /// [`FILTERED`], [`PACKED`], [`BITS`].
    pub flags: u32,
    /// Only pairs of one box below and one from here on, unless 0.
    pub split: u32,
    /// Room for entries.
    pub entry_room: u32,
    /// Room for slots.
    pub slot_room: u32,
    /// Room for small work items.
    pub small_room: u32,
    /// Room for large work items.
    pub large_room: u32,
    /// Boxes that the device knows from the last update, in a search for changes.
    pub known: u32,
    /// Length of the list of moves.
    pub moves: u32,
    /// Length of the list of filters that have changed.
    pub refilters: u32,
    /// The levels, finest first.
    pub level: [Level; MOST_LEVELS],
}

/// The work items of one dispatch of the check kernels.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Chunk {
    /// First small item.
    pub first_small: u32,
    /// Small items.
    pub small_items: u32,
    /// First large item.
    pub first_large: u32,
    /// Large items.
    pub large_items: u32,
    /// Room for words of output.
    pub word_room: u32,
    /// Padding.
    pub unused: u32,
    /// Pairs beyond which the call ends in an error: low and high half.
    pub pairs_left: [u32; 2],
}

/// Entries of a cell by kind: counts until `scan_add`, from then on the ends of both lists.
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
    /// Its first entry.
    pub start: u32,
    /// Entries, and residents `<< 16`.
    pub shape: u32,
    /// Pairs of the cells before it in its block.
    pub first_pair: u32,
}

/// [`LANES`] consecutive pairs of the small cells of a block, or the rest.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Pod, Zeroable)]
pub struct SmallItem {
    /// The slot in which it begins.
    pub slot: u32,
    /// Slots that it may reach into.
    pub slots: u32,
    /// Its first pair in the block.
    pub first_pair: u32,
    /// Its pairs.
    pub pairs: u32,
}

/// A segment of rows of a large cell against some segments of columns.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Pod, Zeroable)]
pub struct LargeItem {
    /// The cell's first entry.
    pub start: u32,
    /// The cell's entries.
    pub boxes: u32,
    /// The cell's residents.
    pub residents: u32,
    /// The segment of rows.
    pub row: u32,
    /// The first segment of columns.
    pub column: u32,
    /// The end of the segments of columns.
    pub end_column: u32,
}

/// What the map found, whether or not there was room for it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Counters {
    /// Entries of all cells.
    pub entries: u32,
    /// Small cells with work.
    pub slots: u32,
    /// Small work items.
    pub small_items: u32,
    /// Large work items.
    pub large_items: u32,
}

/// What a check found, whether or not there was room for it: low and high halves.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Totals {
    /// Words of output.
    pub words: [u32; 2],
    /// Pairs.
    pub pairs: [u32; 2],
    /// Tests made.
    pub made: [u32; 2],
    /// Tests that the entries alone decide: of pairs that another cell owns, and, in a search for changes,
    /// of boxes that have not moved.
    pub redundant: [u32; 2],
    /// Overlapping pairs, or changed ones, whether filters allow them or not.
    pub overlaps: [u32; 2],
}

/// The number of which the device counts two halves.
pub fn wide([low, high]: [u32; 2]) -> u64 {
    u64::from(high) << 32 | u64::from(low)
}

/// The two halves of a number.
pub fn halves(x: u64) -> [u32; 2] {
    [x as u32, (x >> 32) as u32]
}

/// A filter is one `vec4<u32>` on the device, as it lies in memory.
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
        let all = Box::new(&Aabb::new([f32::NEG_INFINITY; 3], [f32::INFINITY; 3]));
        for invalid in [Aabb::NOWHERE, Aabb::new([f32::INFINITY; 3], [f32::NEG_INFINITY; 3])] {
            let invalid = Box::new(&invalid);
            assert_eq!(invalid, Box::INVALID);
            assert!(!(0..3).any(|k| invalid.low[k] <= all.high[k] || all.low[k] <= invalid.high[k]));
        }
    }
}
