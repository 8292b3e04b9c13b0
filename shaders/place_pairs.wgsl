// Sort, step 2: writes each pair into the row of its first box. The order within a row is the device's.

@group(0) @binding(0) var<storage, read> totals: Totals;
@group(0) @binding(1) var<storage, read> out: array<u32>;
@group(0) @binding(2) var<storage, read> sums: array<u32>;
@group(0) @binding(3) var<storage, read_write> rows: array<atomic<u32>>;
@group(0) @binding(4) var<storage, read_write> grouped: array<u32>;

// For each leader: the end of the places of its lanes.
var<workgroup> ends: array<u32, LANES>;

@compute @workgroup_size(LANES)
fn place_pairs(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let i = linear(group) * LANES + lane;
    let is_pair = 2u * i < totals.words.x;
    var first = 0u;
    if is_pair {
        first = out[2u * i];
    }
    let following = follow(first, lane, is_pair);
    if is_pair && following.leader == lane {
        ends[lane] = block_start(first) + atomicSub(&rows[first], atomicLoad(&followers[lane]));
    }
    workgroupBarrier();
    if is_pair {
        let at = ends[following.leader] - 1u - following.rank;
        grouped[2u * at] = first;
        grouped[2u * at + 1u] = out[2u * i + 1u];
    }
}
