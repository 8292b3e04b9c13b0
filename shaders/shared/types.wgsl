// Types that kernels share. pbig-gpu's layout.rs has the same structs, field by field.

// Lanes of a workgroup, and boxes of a segment (PBIG 5.2).
const LANES = 256u;
// Lists of a workgroup of the scan.
const COUNTS_PER_BLOCK = 1024u;
// Maximum number of levels of cells. The last level has one cell for everything.
const MAX_LEVELS = 8u;
// Maximum number of cells that a box touches along one axis of its level.
const MAX_SPAN = 4;
// Located.shape of an invalid box.
const NO_LEVEL = 0xffffffffu;

// Bits of Params.flags.
const FILTERED = 1u;
// The checks count redundant tests and overlaps.
const COUNTED = 2u;
// There is no plan, so nothing is searched: the boxes live on the device, and were not measured yet.
const UNPLANNED = 4u;

// An AABB whose coordinates are integers in the order of the floats. Comparisons of integers are exact on every device,
// whatever it does to denormals, infinities and NaN. An invalid box has all of `low` above all of `high`.
struct DeviceBox {
    low: array<i32, 3>,
    high: array<i32, 3>,
}

const NOWHERE = DeviceBox(
    array<i32, 3>(0x7fffffff, 0x7fffffff, 0x7fffffff),
    array<i32, 3>(-0x7fffffff - 1, -0x7fffffff - 1, -0x7fffffff - 1),
);

// Cells that a box touches at its level.
struct Located {
    // The lowest on each axis, not wrapped around.
    low: array<i32, 3>,
    // The level, and from SPAN_BITS on two bits an axis for the number of cells less one. NO_LEVEL for an invalid box.
    shape: u32,
}

const SPAN_BITS = 4u;

struct Level {
    // Number of cells on each axis; boxes beyond wrap around. An axis of one cell is not divided.
    dims: vec3<u32>,
    // A cell of the level has 2^shift of the finest cells on each axis.
    shift: u32,
    // Index of the level's first cell among all cells.
    first_cell: u32,
    unused0: u32,
    unused1: u32,
    unused2: u32,
}

struct Params {
    boxes: u32,
    levels: u32,
    // Exponent, as in the bits of a float, of the floats whose last bit is a tick.
    tick_exponent: i32,
    // Cells at the finest resolution in 2^16 ticks, at most 2^16.
    cells_per_tick: u32,
    cells: u32,
    small_cell: u32,
    // Number of column segments of a large work item.
    columns: u32,
    flags: u32,
    entry_capacity: u32,
    slot_capacity: u32,
    small_capacity: u32,
    large_capacity: u32,
    // Counters.tests beyond which nothing is checked: the grid was made for other boxes.
    most_tests: u32,
    unused0: u32,
    unused1: u32,
    unused2: u32,
    level: array<Level, MAX_LEVELS>,
}

// Range of the work of one dispatch.
struct Chunk {
    first_small: u32,
    small_items: u32,
    first_large: u32,
    large_items: u32,
    // Capacity of the output, in words.
    word_capacity: u32,
    // The first of the grouped pairs that are ranked.
    first_pair: u32,
    // Number of pairs after which the call ends in an error: low and high half.
    pairs_left: vec2<u32>,
}

// Entries of a cell. Residents are boxes of the cell's own level, visitors those of finer levels. Two visitors meet in a
// cell of their own levels. Until the scan these are counts, then the ends of both lists of entries (ends.wgsl), and after
// the scatter their starts.
struct Cell {
    residents: u32,
    visitors: u32,
}

// A small cell in the schedule.
struct Slot {
    // First entry.
    start: u32,
    // Number of entries, and number of residents << 16.
    shape: u32,
    // Number of pairs of the cells before it in its block.
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

// Lengths of the lists, counted on past their capacities.
struct Counters {
    entries: u32,
    slots: u32,
    small_items: u32,
    large_items: u32,
    // Number of valid boxes.
    valid: u32,
    // Tests that the checks may make, in units of LANES.
    tests: u32,
    unused0: u32,
    // 1 if the tests exceed 32 bits.
    too_many_tests: u32,
}

// Counts of the checks, in two halves each.
struct Totals {
    words: vec2<u32>,
    made: vec2<u32>,
    redundant: vec2<u32>,
    overlaps: vec2<u32>,
}

// Values of PairCount.status: all pairs are there; there was no plan yet; a list or the pairs did not fit; the plan was made for
// other boxes, and makes too many tests. Unless all are there, the buffer of pairs holds nothing of use.
const COMPLETE = 0u;
const NOT_PLANNED = 1u;
const TOO_LARGE = 2u;
const PLAN_REFUSED = 3u;

// The result of a search whose pairs stay on the device.
struct PairCount {
    // Number of pairs in the buffer; 0 unless all are there.
    pairs: u32,
    status: u32,
    // Number of pairs that were found, whether they fit or not; at most 2^32 - 1.
    needed: u32,
    unused0: u32,
    // Arguments of an indirect dispatch of LANES lanes for each workgroup, and at least one lane for each pair.
    dispatch: array<u32, 3>,
    unused1: u32,
}

// Bits of an entry of a cell: the box, an unused bit, and for each axis a bit that is set if this is the box's lowest cell there.
const BOX_BITS = 28u;
const AXIS_BITS = 29u;

fn box_of(entry: u32) -> u32 {
    return entry & ((1u << BOX_BITS) - 1u);
}

// Returns true if the cell of two entries owns their pair (contract 3). The owner is the component-wise maximum of the
// boxes' lowest cells. Both boxes touch this cell, so on each axis it is the maximum exactly if it is the lowest cell of
// one of them.
fn owns(a: u32, b: u32) -> bool {
    return ((a | b) >> AXIS_BITS) == 7u;
}

// Returns true if the boxes overlap: PBIG's equation 1, in closed intervals.
fn overlap(a: DeviceBox, b: DeviceBox) -> bool {
    return a.low[0] <= b.high[0] && b.low[0] <= a.high[0]
        && a.low[1] <= b.high[1] && b.low[1] <= a.high[1]
        && a.low[2] <= b.high[2] && b.low[2] <= a.high[2];
}

// Returns true if both filters allow the pair. A filter is: body; kind, accepted kinds << 8, test mode << 16;
// memberships; mask.
fn filters_allow(a: vec4<u32>, b: vec4<u32>) -> bool {
    let bodies = a.x != b.x || a.x == 0xffffffffu;
    let kinds = ((((a.y >> 8u) & b.y) | ((b.y >> 8u) & a.y)) & 0xffu) != 0u;
    let forth = (a.z & b.w) != 0u;
    let back = (b.z & a.w) != 0u;
    let either = (((a.y & b.y) >> 16u) & 1u) != 0u;
    return bodies && kinds && ((forth && back) || (either && (forth || back)));
}

// Workgroups in a row of a dispatch; the portable limit is 65,535.
const GROUPS_PER_ROW = 32768u;

// Returns the index of a workgroup. A dispatch of more than GROUPS_PER_ROW workgroups has rows of them. Kernels do not ask
// for the number of workgroups: DirectX 12 has none for indirect dispatches.
fn linear(group: vec3<u32>) -> u32 {
    return group.y * GROUPS_PER_ROW + group.x;
}
