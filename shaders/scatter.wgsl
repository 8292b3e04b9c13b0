// Map, step 6 (PBIG 4.2, scatter): writes each box into the entries of its cells, residents before visitors. Each list is
// filled from its end. The device decides the order of the boxes of a cell; the returned pairs do not depend on it.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> located: array<Located>;
@group(0) @binding(2) var<storage, read> sums: array<u32>;
@group(0) @binding(3) var<storage, read> counters: Counters;
@group(0) @binding(4) var<storage, read_write> cells: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read_write> entries: array<u32>;

// Visitors of the last level's one cell, placed by the workgroup together, as `visit` counts them.
var<workgroup> last_visitors: atomic<u32>;
var<workgroup> last_end: u32;

@compute @workgroup_size(LANES)
fn scatter(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    // If the entries do not fit, the host makes larger buffers and maps again.
    if counters.entries > params.entry_capacity {
        return;
    }
    if lane == 0u {
        atomicStore(&last_visitors, 0u);
    }
    workgroupBarrier();
    let id = linear(group) * LANES + lane;
    let last = params.levels - 1u;
    let last_cell = params.level[last].first_cell;
    var visits_last = false;
    if id < params.boxes && located[id].shape != NO_LEVEL {
        let at = located[id];
        visits_last = own_level(at) < last && takes_visitors(last_cell);
        place_all(id, at, last);
    }
    var rank = 0u;
    if visits_last {
        rank = atomicAdd(&last_visitors, 1u);
    }
    workgroupBarrier();
    if lane == 0u {
        let visitors = atomicLoad(&last_visitors);
        last_end = block_start(2u * last_cell);
        if visitors > 0u {
            last_end += atomicSub(&cells[2u * last_cell + 1u], visitors);
        }
    }
    let end = workgroupUniformLoad(&last_end);
    if visits_last {
        // The only cell is the lowest of every box, on all axes.
        entries[end - 1u - rank] = id | (7u << AXIS_BITS);
    }
}

// Writes a box into its own level and into the levels between that and the last.
fn place_all(id: u32, at: Located, last: u32) {
    let own = own_level(at);
    for (var level = own; level == own || level < last; level++) {
        let t = touched(at, level);
        for (var k = 0u; k < cell_count(t); k++) {
            let cell = cell_at(t, k, level);
            place(cell.x, id | cell.y, level == own);
        }
    }
}

// Returns true if visitors of a cell were counted; asked by a visitor that is not placed yet. Until then the end of the
// visitors is above that of the residents, whatever was placed. Without residents both stay equal.
fn takes_visitors(cell: u32) -> bool {
    return atomicLoad(&cells[2u * cell + 1u]) > atomicLoad(&cells[2u * cell]);
}

// Writes an entry. Both lists of a cell are counted in one block.
fn place(cell: u32, entry: u32, resident: bool) {
    if resident {
        entries[block_start(2u * cell) + atomicSub(&cells[2u * cell], 1u) - 1u] = entry;
    } else if takes_visitors(cell) {
        entries[block_start(2u * cell) + atomicSub(&cells[2u * cell + 1u], 1u) - 1u] = entry;
    }
}
