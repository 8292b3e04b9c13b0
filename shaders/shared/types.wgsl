// What several kernels share. The structs are mirrored, field by field, in pbig-core's layout.rs.

// Lanes of a workgroup, and boxes of a segment (PBIG 5.2).
const LANES = 256u;
// Levels of cells, the last of which is one cell for everything.
const MOST_LEVELS = 8u;
// Cells that a box may touch along one axis of a level.
const MOST_SPAN = 4;
// The level of an invalid box.
const NO_LEVEL = 0xffffffffu;

// Bits of Params.flags.
const FILTERED = 1u;
const PACKED = 2u;
const BITS = 4u;

// An AABB whose coordinates are integers in the order of the floats they stand for: comparisons are
// exact on every device, whatever it does to denormals, infinities and NaN. An invalid box has all
// of `low` above all of `high`.
struct Box {
    low: array<i32, 3>,
    high: array<i32, 3>,
}

// A box as it is, and as it was at the last update.
struct Motion {
    now: Box,
    before: Box,
}

// A box that is to be what `now` says: its id, and ANEW if it was nowhere before.
struct Move {
    place: u32,
    now: Box,
}

// A box that is to have another filter.
struct Refilter {
    id: u32,
    filter0: u32,
    filter1: u32,
    filter2: u32,
    filter3: u32,
}

// Cells that a box touches at the finest resolution, both ends included; its level, with MOVED where
// it differs from what it was.
struct Located {
    low: array<i32, 3>,
    high: array<i32, 3>,
    level: u32,
}

struct Level {
    // Cells on each axis before they wrap around; an axis of one cell is not divided.
    dims: vec3<u32>,
    // The level's cells are 2^shift of the finest on each axis.
    shift: u32,
    // Where the level's cells begin among all cells.
    first_cell: u32,
    unused0: u32,
    unused1: u32,
    unused2: u32,
}

struct Params {
    // Where cell 0 begins, and cells per unit of length at the finest resolution.
    origin: vec3<f32>,
    scale: f32,
    // Coordinates beyond are cut off before they become cells.
    reach_low: vec3<i32>,
    boxes: u32,
    reach_high: vec3<i32>,
    levels: u32,
    cells: u32,
    small_cell: u32,
    // Column segments of one large work item.
    columns: u32,
    flags: u32,
    // Only pairs of one box below and one box from `split` on, unless 0.
    split: u32,
    entry_room: u32,
    slot_room: u32,
    small_room: u32,
    large_room: u32,
    // Boxes that the device knows from the last update, and what has changed since.
    known: u32,
    moves: u32,
    refilters: u32,
    level: array<Level, MOST_LEVELS>,
}

// The part of the work items that one dispatch of the check kernels handles.
struct Chunk {
    first_small: u32,
    small_items: u32,
    first_large: u32,
    large_items: u32,
    // Words of output that there is room for.
    word_room: u32,
    unused: u32,
    // Pairs after which the call will end in an error anyway: low and high half.
    pairs_left: vec2<u32>,
}

// Residents are the boxes of the cell's own level, visitors those of finer levels. Two visitors meet
// in their own level. Counts until scan_add, from then on the ends of their entries.
struct Cell {
    residents: u32,
    visitors: u32,
}

// A small cell in the schedule.
struct Slot {
    // Its first entry.
    start: u32,
    // Entries, and residents << 16.
    shape: u32,
    // Pairs of the cells before it in its block.
    first_pair: u32,
}

// LANES consecutive pairs of the small cells of a block.
struct SmallItem {
    slot: u32,
    slots: u32,
    first_pair: u32,
    pairs: u32,
}

// A segment of rows of a large cell against some segments of columns.
struct LargeItem {
    start: u32,
    boxes: u32,
    residents: u32,
    row: u32,
    column: u32,
    end_column: u32,
}

// What the map found, counted on past any capacity.
struct Counters {
    entries: u32,
    slots: u32,
    small_items: u32,
    large_items: u32,
}

// An entry of a cell: the box, whether it has moved, and for each axis whether this is the box's
// lowest cell there.
const BOX_BITS = 28u;
const AXIS_BITS = 29u;
const MOVED = 1u << BOX_BITS;
// In a Move: before, the box overlapped nothing.
const ANEW = 0x80000000u;

fn box_of(entry: u32) -> u32 {
    return entry & ((1u << BOX_BITS) - 1u);
}

// Whether the cell of two entries owns their pair (contract 3). Its owner is the component-wise
// maximum of the boxes' lowest cells; both boxes touch this cell, so on each axis the maximum is
// here exactly if the lowest cell of one of them is.
fn owns(a: u32, b: u32) -> bool {
    return ((a | b) >> AXIS_BITS) == 7u;
}

// PBIG's equation 1, in closed intervals.
fn overlap(a: Box, b: Box) -> bool {
    return a.low[0] <= b.high[0] && b.low[0] <= a.high[0]
        && a.low[1] <= b.high[1] && b.low[1] <= a.high[1]
        && a.low[2] <= b.high[2] && b.low[2] <= a.high[2];
}

// ProxyFilter: body; kind, accepted kinds << 8, test mode << 16; memberships; mask.
fn filters_allow(a: vec4<u32>, b: vec4<u32>) -> bool {
    let bodies = a.x != b.x || a.x == 0xffffffffu;
    let kinds = ((((a.y >> 8u) & b.y) | ((b.y >> 8u) & a.y)) & 0xffu) != 0u;
    let forth = (a.z & b.w) != 0u;
    let back = (b.z & a.w) != 0u;
    let either = (((a.y & b.y) >> 16u) & 1u) != 0u;
    return bodies && kinds && ((forth && back) || (either && (forth || back)));
}

// Dispatches of more than 65,535 workgroups have rows of them.
fn linear(group: vec3<u32>, groups: vec3<u32>) -> u32 {
    return group.y * groups.x + group.x;
}
