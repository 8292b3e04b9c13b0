// Map, step 2: counts the visitors of each cell that has residents: boxes of finer levels. After steps 1 and 2 each box
// is counted in every cell where it can meet a box of its level or of a coarser one. Runs only if there are several
// levels.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> located: array<Located>;
@group(0) @binding(2) var<storage, read_write> cells: array<atomic<u32>>;

// Visitors of the last level's one cell, counted by the workgroup. If that cell has a resident, say a ground, every box
// visits it; without this count all boxes would wait for each other at one address.
var<workgroup> last_visitors: atomic<u32>;

@compute @workgroup_size(LANES)
fn visit(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    if lane == 0u {
        atomicStore(&last_visitors, 0u);
    }
    workgroupBarrier();
    let id = linear(group) * LANES + lane;
    let last = params.levels - 1u;
    let last_cell = params.level[last].first_cell;
    let has_last = atomicLoad(&cells[2u * last_cell]) > 0u;
    // With two levels boxes visit the last one only.
    let has_visits = has_last || params.levels > 2u;
    if has_visits && id < params.boxes && own_level(located[id]) < last {
        if has_last {
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

// Counts a box in the levels between its own and the last.
fn count_visits(id: u32, last: u32) {
    let at = located[id];
    for (var level = own_level(at) + 1u; level < last; level++) {
        let t = touched(at, level);
        for (var k = 0u; k < cell_count(t); k++) {
            let cell = cell_at(t, k, level).x;
            // Step 1 has counted all residents, so this value no longer changes.
            if atomicLoad(&cells[2u * cell]) > 0u {
                atomicAdd(&cells[2u * cell + 1u], 1u);
            }
        }
    }
}
