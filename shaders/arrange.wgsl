// Computes the number of workgroups of the first check kernels, between schedule and check. If a list did not fit, there
// are none: the host makes larger buffers and maps again.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> chunk: Chunk;
@group(0) @binding(2) var<storage, read> counters: Counters;
// Arguments of two indirect dispatches, for small and for large items.
@group(0) @binding(3) var<storage, read_write> dispatches: array<u32, 6>;

// Workgroups in a row of a dispatch; the portable limit is 65,535.
const ROW = 32768u;

fn write_dispatch(at: u32, items: u32) {
    dispatches[at] = min(items, ROW);
    dispatches[at + 1u] = (items + ROW - 1u) / ROW;
    dispatches[at + 2u] = 1u;
}

@compute @workgroup_size(1)
fn arrange() {
    let fits = counters.entries <= params.entry_capacity && counters.slots <= params.slot_capacity
        && counters.small_items <= params.small_capacity && counters.large_items <= params.large_capacity;
    write_dispatch(0u, select(0u, min(counters.small_items, chunk.small_items), fits));
    write_dispatch(3u, select(0u, min(counters.large_items, chunk.large_items), fits));
}
