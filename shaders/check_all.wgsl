// Check, without a grid, for few boxes: one invocation for each pair (Avril 3.2).

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> chunk: Chunk;
@group(0) @binding(2) var<storage, read> boxes: array<DeviceBox>;
@group(0) @binding(3) var<storage, read> filters: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read_write> totals: array<atomic<u32>, 8>;
@group(0) @binding(5) var<storage, read_write> out: array<u32>;

@compute @workgroup_size(LANES)
fn check_all(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = params.boxes;
    let all = n * (n - 1u) / 2u;
    let first = linear(group) * LANES;
    if first >= all || beyond_limit(lane) {
        return;
    }
    var hit = false;
    var pair = vec2<u32>(0u);
    if first + lane < all {
        pair = pair_at(first + lane, n);
        let found = overlap(ordered_box(boxes[pair.x]), ordered_box(boxes[pair.y]));
        note_test(2u, u32(found));
        hit = found && allowed(pair.x, pair.y);
    }
    if lane == 0u {
        atomicStore(&tally[0], min(LANES, all - first));
    }
    let at = reserve(lane, u32(hit));
    if hit && at != NO_SPACE {
        write_pair(at, pair.x, pair.y);
    }
}
