// Plan: counts the boxes of each size class, and finds the largest extents of each. The host plans cells by them. Runs only
// when there is no plan, or when the boxes have outgrown it.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> boxes: array<KnownBox>;
@group(0) @binding(2) var<storage, read> changed: array<u32>;
// For each class: the number of boxes, and the largest extent on each axis, as the bits of a float.
@group(0) @binding(3) var<storage, read_write> classes: array<atomic<u32>, 1024>;

const CLASSES = 256u;
// Maximum number of workgroups. Each adds its counts to those of all.
const MEASURE_GROUPS = 64u;
const INFINITE = 0x7f800000u;

var<workgroup> own_classes: array<atomic<u32>, 1024>;

// Returns the bits of an extent. Positive floats are ordered as their bits.
fn extent(low: i32, high: i32) -> u32 {
    let length = bitcast<u32>(max(float_of(high) - float_of(low), 0.0));
    return select(min(length, INFINITE), INFINITE, low == LOWEST || high == HIGHEST);
}

fn count(one: DeviceBox) {
    var extents: array<u32, 3>;
    var largest = 0u;
    for (var axis = 0u; axis < 3u; axis++) {
        extents[axis] = extent(one.low[axis], one.high[axis]);
        largest = max(largest, extents[axis]);
    }
    let class_at = 4u * (largest >> 23u);
    atomicAdd(&own_classes[class_at], 1u);
    for (var axis = 0u; axis < 3u; axis++) {
        atomicMax(&own_classes[class_at + 1u + axis], extents[axis]);
    }
}

@compute @workgroup_size(LANES)
fn measure(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    for (var i = lane; i < 4u * CLASSES; i += LANES) {
        atomicStore(&own_classes[i], 0u);
    }
    workgroupBarrier();
    for (var id = group.x * LANES + lane; id < params.boxes; id += MEASURE_GROUPS * LANES) {
        let one = bounds_of(known_box(id));
        if one.low[0] <= one.high[0] {
            count(one);
        }
    }
    workgroupBarrier();
    for (var class_index = lane; class_index < CLASSES; class_index += LANES) {
        let at = 4u * class_index;
        let boxes_of_class = atomicLoad(&own_classes[at]);
        if boxes_of_class > 0u {
            atomicAdd(&classes[at], boxes_of_class);
            for (var axis = 1u; axis < 4u; axis++) {
                atomicMax(&classes[at + axis], atomicLoad(&own_classes[at + axis]));
            }
        }
    }
}
