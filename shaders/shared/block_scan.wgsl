// Exclusive prefix sum over the lanes of a workgroup, in two barriers: some lanes sum a group each, then every lane adds the
// groups before its own.

const SCAN_GROUP = 16u;

var<workgroup> scan_space: array<u32, LANES>;
var<workgroup> scan_totals: array<u32, SCAN_GROUP>;

fn block_scan(value: u32, lane: u32) -> u32 {
    scan_space[lane] = value;
    workgroupBarrier();
    if lane < LANES / SCAN_GROUP {
        var sum = 0u;
        for (var at = lane * SCAN_GROUP; at < (lane + 1u) * SCAN_GROUP; at++) {
            let own = scan_space[at];
            scan_space[at] = sum;
            sum += own;
        }
        scan_totals[lane] = sum;
    }
    workgroupBarrier();
    var before = scan_space[lane];
    for (var group = 0u; group < lane / SCAN_GROUP; group++) {
        before += scan_totals[group];
    }
    return before;
}

// Returns the sum over all lanes of the last block_scan. The barrier at its end lets the next scan begin.
fn block_sum() -> u32 {
    var sum = 0u;
    for (var group = 0u; group < LANES / SCAN_GROUP; group++) {
        sum += scan_totals[group];
    }
    workgroupBarrier();
    return sum;
}
