// Map, step 3 (PBIG 4.2, scan): computes the prefix sums of the entries within each block of cells, and the block's
// total. The scan takes three dispatches, not one with look-back, because WebGPU guarantees no progress between
// workgroups.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> cells: array<Cell>;
@group(0) @binding(2) var<storage, read_write> starts: array<u32>;
@group(0) @binding(3) var<storage, read_write> sums: array<u32>;

const CELLS_PER_LANE = 4u;

@compute @workgroup_size(LANES)
fn scan_blocks(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) lane: u32) {
    let block = linear(group, groups);
    let first = (block * LANES + lane) * CELLS_PER_LANE;
    var sum = 0u;
    var before: array<u32, CELLS_PER_LANE>;
    for (var i = 0u; i < CELLS_PER_LANE; i++) {
        before[i] = sum;
        if first + i < params.cells {
            sum += cells[first + i].residents + cells[first + i].visitors;
        }
    }
    let start = block_scan(sum, lane);
    let total = block_sum();
    for (var i = 0u; i < CELLS_PER_LANE; i++) {
        if first + i < params.cells {
            starts[first + i] = start + before[i];
        }
    }
    if lane == 0u && block * LANES * CELLS_PER_LANE < params.cells {
        sums[block] = total;
    }
}
