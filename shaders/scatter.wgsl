// Map, step 6 (PBIG 4.2, scatter): every box into its cells, residents before visitors, each list from
// its end. In which order the boxes of a cell come is up to the device; the order of the pairs that
// are returned does not depend on it.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> located: array<Located>;
@group(0) @binding(2) var<storage, read> starts: array<u32>;
@group(0) @binding(3) var<storage, read> counters: Counters;
@group(0) @binding(4) var<storage, read_write> cells: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read_write> entries: array<u32>;

@compute @workgroup_size(LANES)
fn scatter(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
           @builtin(local_invocation_index) lane: u32) {
    let id = linear(group, groups) * LANES + lane;
    // Without room for all entries the host makes room and maps again.
    if id >= params.boxes || counters.entries > params.entry_room {
        return;
    }
    let at = located[id];
    if at.level == NO_LEVEL {
        return;
    }
    for (var level = at.level; level < params.levels; level++) {
        let t = touched(low_of(at), high_of(at), level);
        for (var k = 0u; k < cell_count(t); k++) {
            let cell = cell_at(t, k, level);
            place(cell.x, id | cell.y, level == at.level);
        }
    }
}

// A cell without residents has counted no visitors, and its cursors stand at its start for good.
fn place(cell: u32, entry: u32, resident: bool) {
    if resident {
        entries[atomicSub(&cells[2u * cell], 1u) - 1u] = entry;
    } else if atomicLoad(&cells[2u * cell + 1u]) > starts[cell] {
        entries[atomicSub(&cells[2u * cell + 1u], 1u) - 1u] = entry;
    }
}
