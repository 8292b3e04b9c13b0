// Study of Avril's mapping: computes the estimated row and the exact pair at both ends of each row, for many n.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> out: array<u32>;

// Parameters: `boxes` is the first n, `split` the number of places of each n, two to a row, `cells` the number of all
// places. Places of rows that an n does not have stay as they are.
@compute @workgroup_size(LANES)
fn row_ends(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
            @builtin(local_invocation_index) lane: u32) {
    let i = linear(group, groups) * LANES + lane;
    if i >= params.cells {
        return;
    }
    let n = params.boxes + i / params.split;
    let row = i % params.split / 2u;
    if row + 1u >= n {
        return;
    }
    let end = i % 2u;
    let k = row_start(row + end, n) - end;
    let pair = pair_at(k, n);
    out[3u * i] = estimated_row(k, n);
    out[3u * i + 1u] = pair.x;
    out[3u * i + 2u] = pair.y;
}
