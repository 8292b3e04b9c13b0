// Scan, step 2: one workgroup turns the totals of the blocks into exclusive prefix sums, and counts all entries of cells.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> sums: array<u32>;
@group(0) @binding(2) var<storage, read_write> counters: Counters;

@compute @workgroup_size(LANES)
fn scan_sums(@builtin(local_invocation_index) lane: u32) {
    let blocks = (scanned() + COUNTS_PER_BLOCK - 1u) / COUNTS_PER_BLOCK;
    var sum = 0u;
    for (var first = 0u; first < blocks; first += LANES) {
        var value = 0u;
        if first + lane < blocks {
            value = sums[first + lane];
        }
        let before = block_scan(value, lane);
        let total = block_sum();
        if first + lane < blocks {
            sums[first + lane] = sum + before;
        }
        sum += total;
    }
    if lane == 0u && !ROWS {
        counters.entries = sum;
    }
}
