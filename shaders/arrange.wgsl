// Schedule: computes the number of workgroups of the first check kernels. If a list did not fit, or if there are more tests
// than the plan promised, there are none: the host makes larger buffers, or another plan, and maps again.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> chunk: Chunk;
@group(0) @binding(2) var<storage, read> counters: Counters;
// Arguments of indirect dispatches: small items, large items.
@group(0) @binding(3) var<storage, read_write> dispatches: array<u32, 6>;

// Writes the arguments of an indirect dispatch of this number of workgroups.
fn write_dispatch(at: u32, groups: u32) {
    dispatches[at] = min(groups, GROUPS_PER_ROW);
    dispatches[at + 1u] = (groups + GROUPS_PER_ROW - 1u) / GROUPS_PER_ROW;
    dispatches[at + 2u] = 1u;
}

@compute @workgroup_size(1)
fn arrange() {
    let fits = lists_fit() && tests_fit();
    write_dispatch(0u, select(0u, min(counters.small_items, chunk.small_items), fits));
    write_dispatch(3u, select(0u, min(counters.large_items, chunk.large_items), fits));
}
