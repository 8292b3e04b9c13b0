// Sort, step 1: computes the number of workgroups of the kernels that sort pairs. If items are left to check, or if the pairs
// do not fit, there are none.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> chunk: Chunk;
@group(0) @binding(2) var<storage, read> counters: Counters;
@group(0) @binding(3) var<storage, read_write> totals: Totals;
@group(0) @binding(4) var<storage, read_write> dispatches: array<u32, 9>;
@group(0) @binding(5) var<storage, read_write> long_rows: array<u32>;

@compute @workgroup_size(1)
fn arrange_rows() {
    let pairs = totals.words.x / 2u;
    let has_all = counters.small_items <= chunk.small_items && counters.large_items <= chunk.large_items;
    let fits = totals.words.y == 0u && totals.words.x <= chunk.word_capacity && pairs <= params.pair_capacity;
    let sorted = has_all && fits;
    totals.sorted = u32(sorted);
    write_dispatch(6u, select(0u, (pairs + LANES - 1u) / LANES, sorted));
    // rank_pairs lists the pieces of long rows, each of which gets a workgroup.
    long_rows[0] = 0u;
    long_rows[1] = 0u;
    long_rows[2] = 1u;
    long_rows[PIECES] = 0u;
}
