// Sort, step 4: writes each pair of a short row to its place, behind the pairs of the row whose second box is smaller. Lists
// the long rows.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> totals: Totals;
@group(0) @binding(2) var<storage, read> sums: array<u32>;
@group(0) @binding(3) var<storage, read> rows: array<u32>;
@group(0) @binding(4) var<storage, read> grouped: array<u32>;
@group(0) @binding(5) var<storage, read_write> counters: array<atomic<u32>, 8>;
@group(0) @binding(6) var<storage, read_write> long_dispatch: array<atomic<u32>, 3>;
@group(0) @binding(7) var<storage, read_write> long_rows: array<vec2<u32>>;
@group(0) @binding(8) var<storage, read_write> out: array<u32>;

const LONG_ROWS = 6u;

// Returns the end of a row: the start of the next one.
fn end_of(row: u32) -> u32 {
    if row + 1u >= params.boxes {
        return totals.words.x / 2u;
    }
    return rows[row + 1u] + block_start(row + 1u);
}

@compute @workgroup_size(LANES)
fn rank_pairs(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) lane: u32) {
    let i = linear(group, groups) * LANES + lane;
    if 2u * i >= totals.words.x {
        return;
    }
    let first = grouped[2u * i];
    let start = rows[first] + block_start(first);
    let end = end_of(first);
    if end - start > SHORT_ROW {
        if i == start {
            let index = atomicAdd(&counters[LONG_ROWS], 1u);
            atomicMax(&long_dispatch[1], min(index + 1u, 32768u));
            long_rows[index] = vec2<u32>(start, end);
        }
        return;
    }
    let second = grouped[2u * i + 1u];
    var at = start;
    for (var k = start; k < end; k++) {
        at += u32(second_of(grouped[2u * k + 1u]) < second_of(second));
    }
    out[2u * at] = first;
    out[2u * at + 1u] = second;
}
