// Study of Avril's lazy way: computes the pair of each identifier.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> out: array<u32>;

// Parameters: `boxes` is n, `split` the first identifier, `cells` the number of identifiers.
@compute @workgroup_size(LANES)
fn lazy_pairs(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) lane: u32) {
    let i = linear(group, groups) * LANES + lane;
    if i >= params.cells {
        return;
    }
    let pair = lazy_pair(params.split + i, params.boxes);
    out[2u * i] = pair.x;
    out[2u * i + 1u] = pair.y;
}
