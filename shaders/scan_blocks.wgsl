// Scan, step 1 (PBIG 4.2): turns the lengths of lists into inclusive prefix sums within each block, and computes the
// block's total. The scan takes two dispatches, not one with look-back, because WebGPU guarantees no progress between
// workgroups; who needs an end adds the blocks before (ends.wgsl).

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> cells: array<u32>;
@group(0) @binding(2) var<storage, read_write> sums: array<u32>;

const COUNTS_PER_LANE = 4u;

@compute @workgroup_size(LANES)
fn scan_blocks(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let block = linear(group);
    let first = (block * LANES + lane) * COUNTS_PER_LANE;
    let count = scanned();
    var sum = 0u;
    var ends: array<u32, COUNTS_PER_LANE>;
    for (var i = 0u; i < COUNTS_PER_LANE; i++) {
        if first + i < count {
            sum += cells[first + i];
        }
        ends[i] = sum;
    }
    let start = block_scan(sum, lane);
    let total = block_sum();
    for (var i = 0u; i < COUNTS_PER_LANE; i++) {
        if first + i < count {
            cells[first + i] = start + ends[i];
        }
    }
    if lane == 0u && block * LANES * COUNTS_PER_LANE < count {
        sums[block] = total;
    }
}
