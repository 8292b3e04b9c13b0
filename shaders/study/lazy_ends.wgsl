// Study of Avril's lazy way: computes the pairs at both ends of each row of identifiers and at the diagonal, for many n.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> out: array<u32>;

// Parameters: `boxes` is the first n, `split` the number of places of each n, five to a row, `cells` the number of all
// places. Places of rows that an n does not have stay as they are.
@compute @workgroup_size(LANES)
fn lazy_ends(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
             @builtin(local_invocation_index) lane: u32) {
    let i = linear(group, groups) * LANES + lane;
    if i >= params.cells {
        return;
    }
    let n = params.boxes + i / params.split;
    let place = i % params.split;
    let row = place / 5u;
    if row + 1u >= n {
        return;
    }
    var columns = array<u32, 5>(0u, max(row, 1u) - 1u, row, row + 1u, n - 1u);
    let pair = lazy_pair(row * n + columns[place % 5u], n);
    out[2u * i] = pair.x;
    out[2u * i + 1u] = pair.y;
}
