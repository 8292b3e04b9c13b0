// Sort, step 3, for a chunk of the pairs: writes each pair of a short row to its place, behind the pairs of the row whose second box is smaller. Counts
// the pairs of long rows by window, and cuts these rows into pieces.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> chunk: Chunk;
@group(0) @binding(2) var<storage, read> totals: Totals;
@group(0) @binding(3) var<storage, read> sums: array<u32>;
@group(0) @binding(4) var<storage, read> rows: array<u32>;
@group(0) @binding(5) var<storage, read> grouped: array<u32>;
@group(0) @binding(6) var<storage, read_write> long_rows: array<atomic<u32>>;
@group(0) @binding(7) var<storage, read_write> windows: array<atomic<u32>>;
@group(0) @binding(8) var<storage, read_write> out: array<u32>;

// Returns the end of a row: the start of the next one.
fn end_of(row: u32) -> u32 {
    if row + 1u >= params.boxes {
        return totals.words.x / 2u;
    }
    return rows[row + 1u] + block_start(row + 1u);
}

// Lists a piece of a long row.
fn add_piece(start: u32, end: u32, index: u32) {
    let piece = atomicAdd(&long_rows[PIECES], 1u);
    atomicMax(&long_rows[0], min(piece + 1u, GROUPS_PER_ROW));
    atomicMax(&long_rows[1], piece / GROUPS_PER_ROW + 1u);
    atomicStore(&long_rows[FIRST_PIECE + 3u * piece], start);
    atomicStore(&long_rows[FIRST_PIECE + 3u * piece + 1u], end);
    atomicStore(&long_rows[FIRST_PIECE + 3u * piece + 2u], index);
}

@compute @workgroup_size(LANES)
fn rank_pairs(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let i = chunk.first_pair + linear(group) * LANES + lane;
    if 2u * i >= totals.words.x {
        return;
    }
    let first = grouped[2u * i];
    let second = grouped[2u * i + 1u];
    let start = rows[first] + block_start(first);
    let end = end_of(first);
    if end - start > SHORT_ROW {
        atomicAdd(&windows[window_at(start, second / WINDOW)], 1u);
        if (i - start) % PIECE == 0u {
            add_piece(start, end, (i - start) / PIECE);
        }
        return;
    }
    var at = start;
    for (var k = start; k < end; k++) {
        at += u32(grouped[2u * k + 1u] < second);
    }
    out[2u * at] = first;
    out[2u * at + 1u] = second;
}
