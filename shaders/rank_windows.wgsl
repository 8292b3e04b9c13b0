// Sort, step 5: sorts the windows of long rows, each through a bitmap. The pieces of a row share its windows.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> grouped: array<u32>;
@group(0) @binding(2) var<storage, read> long_rows: array<u32>;
@group(0) @binding(3) var<storage, read_write> windows: array<atomic<u32>>;
@group(0) @binding(4) var<storage, read_write> out: array<u32>;

const WORDS = 1024u;
const WORDS_PER_LANE = 4u;

var<workgroup> found: array<atomic<u32>, WORDS>;
// Start and number of pairs of each window.
var<workgroup> starts: array<u32, LANES>;
var<workgroup> counts: array<u32, LANES>;

@compute @workgroup_size(LANES)
fn rank_windows(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = linear(group);
    if index >= long_rows[PIECES] {
        return;
    }
    for (var word = lane; word < WORDS; word += LANES) {
        atomicStore(&found[word], 0u);
    }
    let piece = piece_at(index);
    let pieces = (piece.end - piece.start + PIECE - 1u) / PIECE;
    var before = piece.start;
    var window = piece.index;
    for (var base = 0u; base < window_count(); base += LANES) {
        counts[lane] = pairs_of_window(piece.start, base + lane);
        starts[lane] = before + block_scan(counts[lane], lane);
        before += block_sum();
        while window < min(base + LANES, window_count()) {
            let start = workgroupUniformLoad(&starts[window - base]);
            let count = workgroupUniformLoad(&counts[window - base]);
            if count > 0u {
                note(start, count, lane);
                write(piece.start, start, window, lane);
            }
            window += pieces;
        }
        workgroupBarrier();
    }
}

// Sets the bits of a window's pairs.
fn note(start: u32, count: u32, lane: u32) {
    for (var i = start + lane; i < start + count; i += LANES) {
        let bit = out[2u * i + 1u] % WINDOW;
        atomicOr(&found[bit / 32u], 1u << (bit % 32u));
    }
    storageBarrier();
    workgroupBarrier();
}

// Writes the pairs of a window in order, and clears the bitmap for the next one.
fn write(row: u32, start: u32, window: u32, lane: u32) {
    let first = grouped[2u * row];
    var count = 0u;
    for (var i = 0u; i < WORDS_PER_LANE; i++) {
        count += countOneBits(atomicLoad(&found[lane * WORDS_PER_LANE + i]));
    }
    var at = start + block_scan(count, lane);
    for (var i = 0u; i < WORDS_PER_LANE; i++) {
        let word = lane * WORDS_PER_LANE + i;
        var bits = atomicExchange(&found[word], 0u);
        while bits != 0u {
            let bit = firstTrailingBit(bits);
            bits &= bits - 1u;
            out[2u * at] = first;
            out[2u * at + 1u] = window * WINDOW + 32u * word + bit;
            at += 1u;
        }
    }
    workgroupBarrier();
}
