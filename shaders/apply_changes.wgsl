// Changes: applies the lists of changed boxes and of changed filters, and notes which boxes have changed.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> box_changes: array<BoxChange>;
@group(0) @binding(2) var<storage, read> filter_changes: array<FilterChange>;
@group(0) @binding(3) var<storage, read_write> boxes: array<Motion>;
@group(0) @binding(4) var<storage, read_write> filters: array<vec4<u32>>;
// A bit for each box.
@group(0) @binding(5) var<storage, read_write> changed: array<atomic<u32>>;

@compute @workgroup_size(LANES)
fn apply_changes(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let i = linear(group) * LANES + lane;
    if i < params.box_changes {
        let id = box_changes[i].marked_id & ~WAS_ABSENT;
        let was_absent = (box_changes[i].marked_id & WAS_ABSENT) != 0u;
        if was_absent {
            boxes[id].before = NOWHERE;
        } else {
            boxes[id].before = boxes[id].now;
        }
        boxes[id].now = box_changes[i].now;
        atomicOr(&changed[id / 32u], 1u << (id % 32u));
    }
    if i < params.filter_changes {
        let new_filter = filter_changes[i];
        filters[new_filter.id] =
            vec4<u32>(new_filter.filter0, new_filter.filter1, new_filter.filter2, new_filter.filter3);
    }
}
