// Emit: counts and output of the check kernels. The format of the words is docs/PAIR_FORMAT.md.

// Places in `totals`, each a low and a high half: counts of pairs pass 2^32.
const WORDS = 0u;
const PAIRS = 1u;
const MADE = 2u;
const REDUNDANT = 3u;
const OVERLAPS = 4u;

// The mark of a record of plain pairs.
const PLAIN = 0x80000000u;

fn add_total(index: u32, amount: u32) -> u32 {
    let before = atomicAdd(&totals[2u * index], amount);
    if before + amount < before {
        atomicAdd(&totals[2u * index + 1u], 1u);
    }
    return before;
}

// Where `reserve` found no room: nothing is to be written.
const NO_ROOM = 0xffffffffu;

// One reservation for the workgroup (PBIG algorithm 2, line 27), by one lane. The counter runs past
// the room, so that the host knows what is needed.
fn reserve(words: u32, pairs: u32) -> u32 {
    let at = add_total(WORDS, words);
    add_total(PAIRS, pairs);
    let fits = at <= chunk.word_room && words <= chunk.word_room - at;
    return select(NO_ROOM, at, fits);
}

var<workgroup> enough: u32;

// Whether the call has passed its limit of pairs: the rest need not be looked at. The halves are read
// one after the other; a carry in between can only happen when the output has long overflowed.
fn beyond_limit(lane: u32) -> bool {
    if lane == 0u {
        let low = atomicLoad(&totals[2u * PAIRS]);
        let high = atomicLoad(&totals[2u * PAIRS + 1u]);
        let left = chunk.pairs_left;
        enough = u32(high > left.y || (high == left.y && low > left.x));
    }
    return workgroupUniformLoad(&enough) != 0u;
}

// What the lanes of the workgroup count: tests made, redundant ones, overlaps; hits; words of rows.
const HITS = 3u;
const ROW_WORDS = 4u;
var<workgroup> tally: array<atomic<u32>, 5>;

// Adds the tests to the totals, by one lane, after a barrier.
fn add_tests() {
    for (var i = 0u; i < 3u; i++) {
        let sum = atomicExchange(&tally[i], 0u);
        if sum > 0u {
            add_total(MADE + i, sum);
        }
    }
}

// Where the workgroup's output goes, as one lane has decided for all.
struct Placed {
    at: u32,
    hits: u32,
    words: u32,
    // Whether it is a record of rows rather than plain pairs.
    packed: u32,
}

var<workgroup> placed: Placed;

// Plain pairs, behind a mark if the output has records.
fn place_plain(hits: u32) -> Placed {
    let mark = u32((params.flags & PACKED) != 0u);
    let at = reserve(mark + 2u * hits, hits);
    if mark != 0u && at != NO_ROOM {
        out[at] = PLAIN | hits;
    }
    return Placed(select(at + mark, NO_ROOM, at == NO_ROOM), hits, 2u * hits, 0u);
}

fn write_pair(at: u32, a: u32, b: u32) {
    out[at] = min(a, b);
    out[at + 1u] = max(a, b);
}
