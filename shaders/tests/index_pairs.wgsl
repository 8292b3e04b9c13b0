// A test of `pair_at`: computes the estimated row and the exact pair of each index.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> out: array<u32>;

// Parameters: `boxes` is n, `levels` the first index, `cells` the number of indices.
@compute @workgroup_size(LANES)
fn index_pairs(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let i = linear(group) * LANES + lane;
    if i >= params.cells {
        return;
    }
    let k = params.levels + i;
    let pair = pair_at(k, params.boxes);
    out[3u * i] = estimated_row(k, params.boxes);
    out[3u * i + 1u] = pair.x;
    out[3u * i + 2u] = pair.y;
}
