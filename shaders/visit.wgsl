// Map, step 2: counts, in the cells of coarser levels that have residents, the boxes of finer levels.
// Together with step 1 every box is counted in every cell where it can meet a box of its size or
// larger. Only dispatched when there are several levels.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> located: array<Located>;
@group(0) @binding(2) var<storage, read_write> cells: array<atomic<u32>>;

// Visitors of the last level's one cell, which every box visits when there is a ground: counted once
// for the workgroup, or all boxes would wait for each other at one address.
var<workgroup> last_visitors: atomic<u32>;

@compute @workgroup_size(LANES)
fn visit(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
         @builtin(local_invocation_index) lane: u32) {
    let id = linear(group, groups) * LANES + lane;
    let last = params.levels - 1u;
    let last_cell = params.level[last].first_cell;
    if id < params.boxes && own_level(located[id]) < last {
        if atomicLoad(&cells[2u * last_cell]) > 0u {
            atomicAdd(&last_visitors, 1u);
        }
        count_visits(id, last);
    }
    workgroupBarrier();
    if lane == 0u {
        let visitors = atomicLoad(&last_visitors);
        if visitors > 0u {
            atomicAdd(&cells[2u * last_cell + 1u], visitors);
        }
    }
}

// A box in the levels between its own and the last.
fn count_visits(id: u32, last: u32) {
    let at = located[id];
    for (var level = own_level(at) + 1u; level < last; level++) {
        let t = touched(low_of(at), high_of(at), level);
        for (var k = 0u; k < cell_count(t); k++) {
            let cell = cell_at(t, k, level).x;
            // The last pass has counted all residents, so what is read here does not change.
            if atomicLoad(&cells[2u * cell]) > 0u {
                atomicAdd(&cells[2u * cell + 1u], 1u);
            }
        }
    }
}
