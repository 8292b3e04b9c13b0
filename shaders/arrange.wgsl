// Schedule: computes the numbers of workgroups that check a chunk of the work items. If a list did not fit, or if there are more tests
// than the plan promised, there are none: the host makes larger buffers, or another plan, and maps again.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> chunk: Chunk;
@group(0) @binding(2) var<storage, read> counters: Counters;
// Arguments of indirect dispatches: small items, large items.
@group(0) @binding(3) var<storage, read_write> dispatches: array<array<u32, 3>, 2>;

// Returns the number of a chunk's work items, of all that there are.
fn items_of(all: u32, first: u32, most: u32) -> u32 {
    return select(0u, min(all - min(all, first), most), lists_fit() && tests_fit());
}

@compute @workgroup_size(1)
fn arrange() {
    dispatches[0] = dispatch_of(items_of(counters.small_items, chunk.first_small, chunk.small_items));
    dispatches[1] = dispatch_of(items_of(counters.large_items, chunk.first_large, chunk.large_items));
}
