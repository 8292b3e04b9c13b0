// Sort, step 5: sorts long rows through a bitmap of the second boxes in a window. A workgroup does a window of a row, and
// counts the pairs before it.

@group(0) @binding(0) var<storage, read> counters: Counters;
@group(0) @binding(1) var<storage, read> grouped: array<u32>;
@group(0) @binding(2) var<storage, read> long_rows: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read_write> out: array<u32>;

const WORDS = 1024u;
const WORDS_PER_LANE = 4u;

var<workgroup> found: array<atomic<u32>, WORDS>;
var<workgroup> ended: array<atomic<u32>, WORDS>;
var<workgroup> before: atomic<u32>;

@compute @workgroup_size(LANES)
fn rank_long_rows(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                  @builtin(local_invocation_index) lane: u32) {
    for (var index = group.y; index < counters.long_rows; index += groups.y) {
        let row = long_rows[index];
        note(row, group.x, lane);
        workgroupBarrier();
        write_window(row.x, group.x, lane);
        workgroupBarrier();
    }
}

// Notes the pairs of the row in the window, and counts those before.
fn note(row: vec2<u32>, window: u32, lane: u32) {
    var below = 0u;
    for (var k = row.x + lane; k < row.y; k += LANES) {
        let word = grouped[2u * k + 1u];
        let second = second_of(word);
        let bit = second % WINDOW;
        below += u32(second / WINDOW < window);
        if second / WINDOW == window {
            atomicOr(&found[bit / 32u], 1u << (bit % 32u));
            atomicOr(&ended[bit / 32u], (word >> 31u) << (bit % 32u));
        }
    }
    atomicAdd(&before, below);
}

// Writes the pairs of the window in order, and clears the bitmap for the next row.
fn write_window(start: u32, window: u32, lane: u32) {
    let first = grouped[2u * start];
    var count = 0u;
    for (var i = 0u; i < WORDS_PER_LANE; i++) {
        count += countOneBits(atomicLoad(&found[lane * WORDS_PER_LANE + i]));
    }
    var at = start + atomicLoad(&before) + block_scan(count, lane);
    for (var i = 0u; i < WORDS_PER_LANE; i++) {
        let word = lane * WORDS_PER_LANE + i;
        var bits = atomicExchange(&found[word], 0u);
        let marks = atomicExchange(&ended[word], 0u);
        while bits != 0u {
            let bit = firstTrailingBit(bits);
            bits &= bits - 1u;
            out[2u * at] = first;
            out[2u * at + 1u] = (window * WINDOW + 32u * word + bit) | (((marks >> bit) & 1u) << 31u);
            at += 1u;
        }
    }
    workgroupBarrier();
    if lane == 0u {
        atomicStore(&before, 0u);
    }
}
