// Map, step 1 (PBIG 4.2, count): computes the cells that each box touches and its level. Counts the residents of each
// cell: boxes of the cell's own level. Counts the valid boxes. In a search for changes, renews stale boxes.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> boxes: array<KnownBox>;
@group(0) @binding(2) var<storage, read> changed: array<u32>;
@group(0) @binding(3) var<storage, read_write> located: array<Located>;
@group(0) @binding(4) var<storage, read_write> cells: array<atomic<u32>>;
// Counters, as atomics.
@group(0) @binding(5) var<storage, read_write> counters: array<atomic<u32>, 8>;

const VALID = 4u;

var<workgroup> valid: atomic<u32>;

// Returns the cell of a coordinate. Each step is monotone in `key`: clamp, subtraction, multiplication by a positive
// number, rounding.
fn finest_cell(key: i32, axis: u32) -> i32 {
    let x = float_of(clamp(key, params.clamp_low[axis], params.clamp_high[axis]));
    let cell = floor((x - params.origin[axis]) * params.scale);
    // The limit is just inside 2^30: the distance of two cells must fit an i32.
    return i32(clamp(cell, -1073741760.0, 1073741760.0));
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
    let known = known_box(id);
    if is_stale(boxes[id], has_changed(id)) {
        boxes[id] = known;
    }
    let one = bounds_of(known);
    if one.low[0] > one.high[0] {
        located[id].shape = NO_LEVEL;
        return;
    }
    atomicAdd(&valid, 1u);
    var low: vec3<i32>;
    var high: vec3<i32>;
    for (var axis = 0u; axis < 3u; axis++) {
        low[axis] = finest_cell(one.low[axis], axis);
        high[axis] = finest_cell(one.high[axis], axis);
    }
    let level = level_of(low, high);
    var at = located_at(low, high, level);
    at.shape |= select(0u, MOVED, has_moved(known));
    located[id] = at;
    let t = touched(at, level);
    for (var k = 0u; k < cell_count(t); k++) {
        atomicAdd(&cells[2u * cell_at(t, k, level).x], 1u);
    }
}
