// Sort, step 4: orders the pairs of long rows by window. A workgroup moves a piece of a row, and reserves places in each window
// once. Only second boxes are written.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> grouped: array<u32>;
@group(0) @binding(2) var<storage, read> long_rows: array<u32>;
@group(0) @binding(3) var<storage, read_write> windows: array<atomic<u32>>;
@group(0) @binding(4) var<storage, read_write> out: array<u32>;

// For each window: the piece's pairs so far, and the place of its first one.
var<workgroup> members: array<atomic<u32>, LANES>;
var<workgroup> places: array<u32, LANES>;

fn second_of(i: u32) -> u32 {
    return grouped[2u * i + 1u];
}

// Reserves the places of the piece in the window of each lane, which begins at `start`.
fn reserve(row: u32, window: u32, start: u32, lane: u32) {
    let count = atomicExchange(&members[lane], 0u);
    if count > 0u {
        places[lane] = start + (atomicAdd(&windows[window_at(row, window)], count << 16u) >> 16u);
    }
}

@compute @workgroup_size(LANES)
fn place_windows(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = linear(group);
    if index >= long_rows[PIECES] {
        return;
    }
    let piece = piece_at(index);
    let first = piece.start + piece.index * PIECE + lane;
    let end = min(piece.start + (piece.index + 1u) * PIECE, piece.end);
    atomicStore(&members[lane], 0u);
    var before = piece.start;
    for (var base = 0u; base < window_count(); base += LANES) {
        let start = before + block_scan(pairs_of_window(piece.start, base + lane), lane);
        before += block_sum();
        for (var i = first; i < end; i += LANES) {
            let window = second_of(i) / WINDOW - base;
            if window < LANES {
                atomicAdd(&members[window], 1u);
            }
        }
        workgroupBarrier();
        reserve(piece.start, base + lane, start, lane);
        workgroupBarrier();
        for (var i = first; i < end; i += LANES) {
            let second = second_of(i);
            let window = second / WINDOW - base;
            if window < LANES {
                out[2u * (places[window] + atomicAdd(&members[window], 1u)) + 1u] = second;
            }
        }
        workgroupBarrier();
        atomicStore(&members[lane], 0u);
    }
}
