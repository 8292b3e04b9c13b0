// Sort, step 3: writes each pair into the row of its first box. The order within a row is the device's.

@group(0) @binding(0) var<storage, read> totals: Totals;
@group(0) @binding(1) var<storage, read> out: array<u32>;
@group(0) @binding(2) var<storage, read> sums: array<u32>;
@group(0) @binding(3) var<storage, read_write> rows: array<atomic<u32>>;
@group(0) @binding(4) var<storage, read_write> grouped: array<u32>;

@compute @workgroup_size(LANES)
fn place_pairs(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) lane: u32) {
    let i = linear(group, groups) * LANES + lane;
    if 2u * i < totals.words.x {
        let first = out[2u * i];
        let at = block_start(first) + atomicSub(&rows[first], 1u) - 1u;
        grouped[2u * at] = first;
        grouped[2u * at + 1u] = out[2u * i + 1u];
    }
}
