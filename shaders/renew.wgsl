// Changes, step 2: the boxes and the filters that have changed, each in a list of its own.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> moves: array<Move>;
@group(0) @binding(2) var<storage, read> refilters: array<Refilter>;
@group(0) @binding(3) var<storage, read_write> boxes: array<Motion>;
@group(0) @binding(4) var<storage, read_write> filters: array<vec4<u32>>;

const NOWHERE = Box(
    array<i32, 3>(0x7fffffff, 0x7fffffff, 0x7fffffff),
    array<i32, 3>(-0x7fffffff - 1, -0x7fffffff - 1, -0x7fffffff - 1),
);

@compute @workgroup_size(LANES)
fn renew(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
         @builtin(local_invocation_index) lane: u32) {
    let i = linear(group, groups) * LANES + lane;
    if i < params.moves {
        let id = moves[i].place & ~ANEW;
        boxes[id].now = moves[i].now;
        if (moves[i].place & ANEW) != 0u {
            boxes[id].before = NOWHERE;
        }
    }
    if i < params.refilters {
        let new_filter = refilters[i];
        filters[new_filter.id] =
            vec4<u32>(new_filter.filter0, new_filter.filter1, new_filter.filter2, new_filter.filter3);
    }
}
