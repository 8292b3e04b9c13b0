// Changes, step 1: stores each box as the box at the last update. `apply_changes` then writes the new boxes.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> boxes: array<Motion>;

@compute @workgroup_size(LANES)
fn store_previous(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                  @builtin(local_invocation_index) lane: u32) {
    let id = linear(group, groups) * LANES + lane;
    if id < params.known {
        boxes[id].before = boxes[id].now;
    }
}
