// Sort, step 1: counts the pairs of each first box.

@group(0) @binding(0) var<storage, read> totals: Totals;
@group(0) @binding(1) var<storage, read> out: array<u32>;
@group(0) @binding(2) var<storage, read_write> rows: array<atomic<u32>>;

@compute @workgroup_size(LANES)
fn count_pairs(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let i = linear(group) * LANES + lane;
    let is_pair = 2u * i < totals.words.x;
    var first = 0u;
    if is_pair {
        first = out[2u * i];
    }
    let leader = follow(first, lane, is_pair).leader;
    if is_pair && leader == lane {
        atomicAdd(&rows[first], atomicLoad(&followers[lane]));
    }
}
