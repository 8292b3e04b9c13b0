// Plan, for boxes that live on the device: counts the valid boxes by size class, with the largest extents of each, and copies a
// sample. The host chooses cells from these. Its choice decides only the time, so floats may be rounded here as they like.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> boxes: array<DeviceBox>;
// Four words for each size class, the number of boxes and the bits of three extents; then six words for each box of the sample.
@group(0) @binding(2) var<storage, read_write> summary: array<atomic<u32>, SUMMARY_WORDS>;

const CLASS_WORDS = 1024u;
const SAMPLE = 1000u;
const SUMMARY_WORDS = 7024u;
// The golden ratio in units of 2^-32, as the host's walk has it.
const GOLDEN = 0x9e3779b9u;

// The size classes of the workgroup's boxes.
var<workgroup> classes: array<atomic<u32>, CLASS_WORDS>;

// Returns the upper half of a product.
fn upper(a: u32, b: u32) -> u32 {
    let low = (a & 0xffffu) * (b & 0xffffu);
    let first = (a >> 16u) * (b & 0xffffu) + (low >> 16u);
    let second = (a & 0xffffu) * (b >> 16u) + (first & 0xffffu);
    return (a >> 16u) * (b >> 16u) + (first >> 16u) + (second >> 16u);
}

// Returns the bits of the distance of two coordinates; those of infinity if one is infinite.
fn extent(low: i32, high: i32) -> u32 {
    if max(low & 0x7fffffff, high & 0x7fffffff) >= 0x7f800000 {
        return 0x7f800000u;
    }
    return bitcast<u32>(bitcast<f32>(high) - bitcast<f32>(low)) & 0x7fffffffu;
}

fn count_box(id: u32) {
    let raw = boxes[id];
    let one = ordered_box(raw);
    if one.low[0] > one.high[0] {
        return;
    }
    var extents = vec3<u32>(0u);
    for (var axis = 0u; axis < 3u; axis++) {
        extents[axis] = extent(raw.low[axis], raw.high[axis]);
    }
    let at = 4u * min(max(extents.x, max(extents.y, extents.z)) >> 23u, 255u);
    atomicAdd(&classes[at], 1u);
    for (var axis = 0u; axis < 3u; axis++) {
        atomicMax(&classes[at + 1u + axis], extents[axis]);
    }
}

// Copies a box of the sample, whose boxes are spread evenly.
fn copy_sample(i: u32) {
    let id = select(upper(i * GOLDEN, params.boxes), i, params.boxes <= SAMPLE);
    let raw = boxes[id];
    for (var axis = 0u; axis < 3u; axis++) {
        atomicStore(&summary[CLASS_WORDS + 6u * i + axis], bitcast<u32>(raw.low[axis]));
        atomicStore(&summary[CLASS_WORDS + 6u * i + 3u + axis], bitcast<u32>(raw.high[axis]));
    }
}

@compute @workgroup_size(LANES)
fn measure(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    for (var word = lane; word < CLASS_WORDS; word += LANES) {
        atomicStore(&classes[word], 0u);
    }
    workgroupBarrier();
    let id = linear(group) * LANES + lane;
    if id < params.boxes {
        count_box(id);
        if id < SAMPLE {
            copy_sample(id);
        }
    }
    workgroupBarrier();
    for (var word = lane; word < CLASS_WORDS; word += LANES) {
        let value = atomicLoad(&classes[word]);
        if value == 0u {
            continue;
        }
        if word % 4u == 0u {
            atomicAdd(&summary[word], value);
        } else {
            atomicMax(&summary[word], value);
        }
    }
}
