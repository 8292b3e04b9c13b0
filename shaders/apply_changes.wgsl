// Changes, step 2: applies the lists of changed boxes and of changed filters.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> box_changes: array<BoxChange>;
@group(0) @binding(2) var<storage, read> filter_changes: array<FilterChange>;
@group(0) @binding(3) var<storage, read_write> boxes: array<Motion>;
@group(0) @binding(4) var<storage, read_write> filters: array<vec4<u32>>;

const NOWHERE = DeviceBox(
    array<i32, 3>(0x7fffffff, 0x7fffffff, 0x7fffffff),
    array<i32, 3>(-0x7fffffff - 1, -0x7fffffff - 1, -0x7fffffff - 1),
);

@compute @workgroup_size(LANES)
fn apply_changes(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                 @builtin(local_invocation_index) lane: u32) {
    let i = linear(group, groups) * LANES + lane;
    if i < params.box_changes {
        let id = box_changes[i].marked_id & ~WAS_ABSENT;
        boxes[id].now = box_changes[i].now;
        if (box_changes[i].marked_id & WAS_ABSENT) != 0u {
            boxes[id].before = NOWHERE;
        }
    }
    if i < params.filter_changes {
        let new_filter = filter_changes[i];
        filters[new_filter.id] =
            vec4<u32>(new_filter.filter0, new_filter.filter1, new_filter.filter2, new_filter.filter3);
    }
}
