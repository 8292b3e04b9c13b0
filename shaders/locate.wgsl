// Map, step 1 (PBIG 4.2, count): computes the cells that each box touches and its level. Counts the residents of each
// cell: boxes of the cell's own level. Counts the valid boxes.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> boxes: array<DeviceBox>;
@group(0) @binding(2) var<storage, read_write> located: array<Located>;
@group(0) @binding(3) var<storage, read_write> cells: array<atomic<u32>>;
// Counters, as atomics.
@group(0) @binding(4) var<storage, read_write> counters: array<atomic<u32>, 8>;

const VALID = 4u;

var<workgroup> valid: atomic<u32>;

// Coordinates in ticks lie less than this far from zero; those beyond are at the ends.
const REACH = 0x40000000;

// Returns a coordinate in ticks, rounded down. The shifts are exact: two places that read a coordinate get the same tick,
// whatever the compiler does to floats.
fn ticks(key: i32) -> i32 {
    let bits = key ^ ((key >> 31u) & 0x7fffffff);
    let exponent = (bits >> 23u) & 0xff;
    let magnitude = (bits & 0x7fffff) | select(0x800000, 0, exponent == 0);
    let signed = select(magnitude, -magnitude, key < 0);
    let shift = max(exponent, 1) - params.tick_exponent;
    // Seven places move a float of any larger exponent beyond the reach.
    let up = signed << u32(clamp(shift, 0, 7));
    let down = signed >> u32(clamp(-shift, 0, 31));
    return clamp(select(down, up, shift > 0), -REACH, REACH - 1);
}

// Returns the cell of a coordinate at the finest resolution: monotone, and never negative.
fn finest_cell(key: i32) -> i32 {
    let above = u32(ticks(key) + REACH);
    let scale = params.cells_per_tick;
    return i32((above >> 16u) * scale + (((above & 0xffffu) * scale) >> 16u));
}

// Returns the first level at which the box touches at most MAX_SPAN cells along each axis. The last level has one cell.
fn level_of(low: vec3<i32>, high: vec3<i32>) -> u32 {
    var level = 0u;
    while level + 1u < params.levels {
        let shift = vec3<u32>(params.level[level].shift);
        let steps = (high >> shift) - (low >> shift);
        let divided = params.level[level].dims > vec3<u32>(1u);
        if all(select(vec3<i32>(0), steps, divided) < vec3<i32>(MAX_SPAN)) {
            break;
        }
        level += 1u;
    }
    return level;
}

@compute @workgroup_size(LANES)
fn locate(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    if lane == 0u {
        atomicStore(&valid, 0u);
    }
    workgroupBarrier();
    let id = linear(group) * LANES + lane;
    if id < params.boxes {
        locate_one(id);
    }
    workgroupBarrier();
    if lane == 0u {
        atomicAdd(&counters[VALID], atomicLoad(&valid));
    }
}

fn locate_one(id: u32) {
    let one = ordered_box(boxes[id]);
    if one.low[0] > one.high[0] {
        located[id].shape = NO_LEVEL;
        return;
    }
    atomicAdd(&valid, 1u);
    var low: vec3<i32>;
    var high: vec3<i32>;
    for (var axis = 0u; axis < 3u; axis++) {
        low[axis] = finest_cell(one.low[axis]);
        high[axis] = finest_cell(one.high[axis]);
    }
    let level = level_of(low, high);
    let at = located_at(low, high, level);
    located[id] = at;
    let t = touched(at, level);
    for (var k = 0u; k < cell_count(t); k++) {
        atomicAdd(&cells[2u * cell_at(t, k, level).x], 1u);
    }
}
