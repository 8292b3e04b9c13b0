// Exclusive prefix sum over the lanes of a workgroup, without subgroups (Hillis and Steele).

var<workgroup> scan_space: array<u32, LANES>;

fn block_scan(value: u32, lane: u32) -> u32 {
    scan_space[lane] = value;
    workgroupBarrier();
    for (var step = 1u; step < LANES; step <<= 1u) {
        var before = 0u;
        if lane >= step {
            before = scan_space[lane - step];
        }
        workgroupBarrier();
        scan_space[lane] += before;
        workgroupBarrier();
    }
    return scan_space[lane] - value;
}

// Returns the sum over all lanes of the last block_scan. The barrier at its end lets the next scan begin.
fn block_sum() -> u32 {
    let sum = scan_space[LANES - 1u];
    workgroupBarrier();
    return sum;
}
