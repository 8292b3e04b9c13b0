// For the study of Avril's lazy way (3.2.2): of n^2 - n identifiers, those above the diagonal are pairs.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> out: array<u32>;

// What identifiers below the diagonal give, and on it.
const NO_BOX: u32 = 0xffffffffu;

// `params.boxes` is n, up to 65,536; `params.cells` the number of identifiers from `params.split` on.
@compute @workgroup_size(LANES)
fn lazy_pairs(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) lane: u32) {
    let i = linear(group, groups) * LANES + lane;
    if i >= params.cells {
        return;
    }
    let id = params.split + i;
    let a = id / params.boxes;
    let b = id % params.boxes;
    out[2u * i] = select(NO_BOX, a, a < b);
    out[2u * i + 1u] = select(NO_BOX, b, a < b);
}
