// Emit: counts and output of the check kernels. A pair is two words: the smaller index, the larger one.

// Indices into `totals`, see Totals. Each count has a low and a high half, because pairs may be more than 2^32.
const WORDS = 0u;
const MADE = 1u;
const REDUNDANT = 2u;
const OVERLAPS = 3u;

fn add_total(index: u32, amount: u32) -> u32 {
    let before = atomicAdd(&totals[2u * index], amount);
    if before + amount < before {
        atomicAdd(&totals[2u * index + 1u], 1u);
    }
    return before;
}

// Returns true if a bit of the flags is set.
fn has_flag(flag: u32) -> bool {
    return (params.flags & flag) != 0u;
}

// Place of output that does not fit: nothing is written.
const NO_SPACE = 0xffffffffu;

// Returns both halves of the number of pairs so far. They are read one after the other. A carry in between can only happen
// long after the output has overflowed.
fn pairs_so_far() -> vec2<u32> {
    let low = atomicLoad(&totals[2u * WORDS]);
    let high = atomicLoad(&totals[2u * WORDS + 1u]);
    return vec2<u32>((low >> 1u) | (high << 31u), high >> 1u);
}

var<workgroup> is_over_limit: u32;

// Zeroes the tally. Returns true if the call has passed its limit of pairs, so the rest need not be tested. The barriers of
// its load also end what the lanes zeroed before.
fn beyond_limit(lane: u32) -> bool {
    if lane < TALLIES {
        atomicStore(&tally[lane], 0u);
    }
    if lane == 0u {
        let found = pairs_so_far();
        let left = chunk.pairs_left;
        is_over_limit = u32(found.y > left.y || (found.y == left.y && found.x > left.x));
    }
    return workgroupUniformLoad(&is_over_limit) != 0u;
}

// Counts of the workgroup: tests made, redundant tests, overlaps; hits.
const HITS = 3u;
const TALLIES = 4u;
var<workgroup> tally: array<atomic<u32>, TALLIES>;

// Counts a test of a lane, if tests are counted.
fn note_test(index: u32, amount: u32) {
    if has_flag(COUNTED) {
        atomicAdd(&tally[index], amount);
    }
}

// Adds the tests to the totals, by one lane, after a barrier.
fn add_tests() {
    if !has_flag(COUNTED) {
        return;
    }
    for (var i = 0u; i < 3u; i++) {
        let sum = atomicExchange(&tally[i], 0u);
        if sum > 0u {
            add_total(MADE + i, sum);
        }
    }
}

// Returns true if the filters of two boxes allow their pair, or are not tested.
fn allowed(a: u32, b: u32) -> bool {
    return !has_flag(FILTERED) || filters_allow(filters[a], filters[b]);
}

// First word of the workgroup's output, which one lane decides for all.
var<workgroup> placed: u32;

// Adds the tests to the totals, and reserves words for the workgroup's hits (PBIG algorithm 2, line 27), by one lane after a barrier:
// one atomic operation in all. The counter runs past the capacity, so the host knows how many words are needed.
fn place() -> u32 {
    add_tests();
    let words = 2u * atomicExchange(&tally[HITS], 0u);
    if words == 0u {
        return NO_SPACE;
    }
    let at = add_total(WORDS, words);
    let fits = at <= chunk.word_capacity && words <= chunk.word_capacity - at;
    return select(NO_SPACE, at, fits);
}

// Adds the tests to the totals, and reserves words for the hits of each lane, by all lanes together. Returns the place of the lane's
// first word. Algorithm 2, line 26, takes a prefix sum here. The hits may come in any order, so atomics are enough: 1 barrier
// instead of 17.
fn reserve(lane: u32, hits: u32) -> u32 {
    var rank = 0u;
    if hits > 0u {
        rank = atomicAdd(&tally[HITS], hits);
    }
    workgroupBarrier();
    if lane == 0u {
        placed = place();
    }
    let at = workgroupUniformLoad(&placed);
    return select(at + 2u * rank, NO_SPACE, at == NO_SPACE);
}

fn write_pair(at: u32, a: u32, b: u32) {
    out[at] = min(a, b);
    out[at + 1u] = max(a, b);
}
