// Conclude, for pairs that stay on the device: says how many there are, and whether they are all.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> chunk: Chunk;
@group(0) @binding(2) var<storage, read> counters: Counters;
@group(0) @binding(3) var<storage, read> totals: Totals;
@group(0) @binding(4) var<storage, read_write> pair_count: PairCount;

fn status() -> u32 {
    if has_flag(UNPLANNED) {
        return NOT_PLANNED;
    }
    if !tests_fit() {
        return PLAN_REFUSED;
    }
    let pairs_fit = totals.words.y == 0u && totals.words.x <= chunk.word_capacity;
    return select(TOO_LARGE, COMPLETE, lists_fit() && pairs_fit);
}

@compute @workgroup_size(1)
fn conclude() {
    let now = status();
    let words = totals.words;
    let found = select((words.x >> 1u) | (words.y << 31u), 0xffffffffu, words.y > 1u);
    let pairs = select(0u, found, now == COMPLETE);
    pair_count.pairs = pairs;
    pair_count.status = now;
    pair_count.needed = found;
    pair_count.dispatch = dispatch_of((pairs + LANES - 1u) / LANES);
}
