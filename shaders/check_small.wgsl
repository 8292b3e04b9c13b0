// Check, small cells (Avril 3.2): one invocation per pair. The workgroup's pairs lie in consecutive small cells of a
// block. A lane finds its cell by bisection in workgroup memory, and its pair by a square root and an exact correction. If
// the boxes of all these cells fit workgroup memory, each is loaded once.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> chunk: Chunk;
@group(0) @binding(2) var<storage, read> boxes: array<DeviceBox>;
@group(0) @binding(3) var<storage, read> filters: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read> entries: array<u32>;
@group(0) @binding(5) var<storage, read> counters: Counters;
@group(0) @binding(6) var<storage, read> slots: array<Slot>;
@group(0) @binding(7) var<storage, read> small_items: array<SmallItem>;
@group(0) @binding(8) var<storage, read_write> totals: array<atomic<u32>, 8>;
@group(0) @binding(9) var<storage, read_write> out: array<u32>;

var<workgroup> first_pairs: array<u32, LANES>;

// Returns the last of the item's slots that begins at or before a pair.
fn slot_of(pair: u32, count: u32) -> u32 {
    var low = 0u;
    var high = count;
    while high - low > 1u {
        let middle = (low + high) / 2u;
        if first_pairs[middle] <= pair {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low;
}

// Number of boxes of small cells that fit workgroup memory.
const STAGED = 256u;

// The entries and boxes of the item's cells, if they are at most STAGED.
var<workgroup> staged_entries: array<u32, STAGED>;
var<workgroup> staged_boxes: array<DeviceBox, STAGED>;

// A range of entries, and true if it is staged.
struct Stage {
    start: u32,
    is_used: bool,
}

// Stages the entries from the item's first cell to the cell of its last pair.
fn stage(item: SmallItem, lane: u32) -> Stage {
    let last = slots[item.slot + slot_of(item.first_pair + item.pairs - 1u, item.slots)];
    let start = slots[item.slot].start;
    let len = last.start + (last.shape & 0xffffu) - start;
    if len <= STAGED && lane < len {
        let entry = entries[start + lane];
        staged_entries[lane] = entry;
        staged_boxes[lane] = ordered_box(boxes[box_of(entry)]);
    }
    return Stage(start, len <= STAGED);
}

fn entry_at(place: u32, staged: Stage) -> u32 {
    if staged.is_used {
        return staged_entries[place - staged.start];
    }
    return entries[place];
}

fn box_at(place: u32, staged: Stage) -> DeviceBox {
    if staged.is_used {
        return staged_boxes[place - staged.start];
    }
    return ordered_box(boxes[box_of(entries[place])]);
}

// Tests the pair of two entries, cheapest test first, and counts for the report.
fn is_pair(one: u32, other: u32, staged: Stage) -> bool {
    let a = entry_at(one, staged);
    let b = entry_at(other, staged);
    if !owns(a, b) {
        note_test(1u, 1u);
        return false;
    }
    if !overlap(box_at(one, staged), box_at(other, staged)) {
        return false;
    }
    note_test(2u, 1u);
    return allowed(box_of(a), box_of(b));
}

@compute @workgroup_size(LANES)
fn check_small(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = linear(group);
    if index >= chunk.small_items || chunk.first_small + index >= counters.small_items {
        return;
    }
    if beyond_limit(lane) {
        return;
    }
    let item = small_items[chunk.first_small + index];
    if lane < item.slots {
        first_pairs[lane] = slots[item.slot + lane].first_pair;
    }
    workgroupBarrier();
    let staged = stage(item, lane);
    workgroupBarrier();
    var hit = false;
    var start = 0u;
    var pair = vec2<u32>(0u);
    if lane < item.pairs {
        let cell = slots[item.slot + slot_of(item.first_pair + lane, item.slots)];
        start = cell.start;
        pair = pair_at(item.first_pair + lane - cell.first_pair, cell.shape & 0xffffu);
        hit = is_pair(start + pair.x, start + pair.y, staged);
    }
    if lane == 0u {
        atomicStore(&tally[0], item.pairs);
    }
    let at = reserve(lane, u32(hit));
    if hit && at != NO_SPACE {
        let a = entry_at(start + pair.x, staged);
        let b = entry_at(start + pair.y, staged);
        write_pair(at, box_of(a), box_of(b));
    }
}
