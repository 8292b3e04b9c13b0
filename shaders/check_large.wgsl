// Check, large cells (PBIG algorithm 2): tests a segment of rows against segments of columns, which pass through workgroup
// memory. Within one segment equation 7 distributes the pairs over the rows.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> chunk: Chunk;
@group(0) @binding(2) var<storage, read> boxes: array<KnownBox>;
@group(0) @binding(3) var<storage, read> filters: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read> entries: array<u32>;
@group(0) @binding(5) var<storage, read> counters: Counters;
@group(0) @binding(6) var<storage, read> large_items: array<LargeItem>;
@group(0) @binding(7) var<storage, read_write> totals: array<atomic<u32>, 12>;
@group(0) @binding(8) var<storage, read_write> out: array<u32>;

// If true, the rows of one segment get equally many pairs (PBIG 5.1). If false, a row gets all boxes after it.
override BALANCED: bool = true;

// The segment of columns.
var<workgroup> column_boxes: array<KnownBox, LANES>;
var<workgroup> column_entries: array<u32, LANES>;
// All marks of the item's entries. If the mark of an axis is missing, the cell owns none of the item's pairs, and the item
// is skipped. For many boxes across one border of cells this skips 7 of 8 cells. A search for changes also skips items
// without a moved box.
var<workgroup> marks: atomic<u32>;
var<workgroup> skip: u32;

// Returns the number of partners of a row within its own segment of n boxes (equation 7 with m = n, without the diagonal).
fn row_length(row: u32, n: u32) -> u32 {
    if row >= n {
        return 0u;
    }
    if !BALANCED {
        return n - 1u - row;
    }
    return (n - 1u) / 2u + u32(n % 2u == 0u && row < n / 2u);
}

// Returns the k-th partner: the boxes after the row's, wrapping around at the end (figure 3).
fn row_partner(row: u32, k: u32, n: u32) -> u32 {
    let partner = row + 1u + k;
    return select(partner, partner - n, partner >= n);
}

// Hits of a lane against one segment of columns: bit k is set if the k-th partner is a hit.
var<private> mask: array<u32, 8>;

// Tests a row against the segment's columns; `within` its own segment against the columns that equation 7 assigns.
// Returns the number of hits.
fn test_row(lane: u32, row: u32, entry: u32, one: KnownBox, item: LargeItem, n: u32, within: bool) -> u32 {
    var length = select(select(0u, n, row < item.residents), row_length(lane, n), within);
    var counts = vec3<u32>(0u);
    var hits = 0u;
    for (var w = 0u; w < 8u; w++) {
        var bits = 0u;
        for (var k = 32u * w; k < min(32u * w + 32u, length); k++) {
            let j = select(k, row_partner(lane, k, n), within);
            // Two visitors meet in a cell of their own level.
            if within && item.row * LANES + min(lane, j) >= item.residents {
                continue;
            }
            counts.x += 1u;
            let a = box_of(entry);
            let b = box_of(column_entries[j]);
            if !owns(entry, column_entries[j]) || !may_be_wanted(entry | column_entries[j])
                || (params.split > 0u && (a < params.split) == (b < params.split)) {
                counts.y += 1u;
                continue;
            }
            if !is_wanted(one, column_boxes[j]) {
                continue;
            }
            counts.z += 1u;
            if !has_flag(FILTERED) || filters_allow(filters[a], filters[b]) {
                bits |= 1u << (k % 32u);
            }
        }
        mask[w] = bits;
        hits += countOneBits(bits);
    }
    note_test(0u, counts.x);
    note_test(1u, counts.y);
    note_test(2u, counts.z);
    return hits;
}

// Decides, by one lane, how and where the workgroup's hits are written.
fn place(item: LargeItem, column: u32) -> Placed {
    add_tests();
    let hits = atomicExchange(&tally[HITS], 0u);
    let words = 3u + atomicExchange(&tally[ROW_WORDS], 0u);
    if hits == 0u {
        return Placed(NO_SPACE, 0u, 0u, 0u);
    }
    if !has_flag(PACKED) || words > 1u + 2u * hits {
        return place_plain(hits);
    }
    let at = reserve(words, hits);
    if at != NO_SPACE {
        out[at] = words - 3u;
        out[at + 1u] = item.start;
        out[at + 2u] = item.row | (column << 16u);
    }
    return Placed(select(at + 3u, NO_SPACE, at == NO_SPACE), hits, words, 1u);
}

@compute @workgroup_size(LANES)
fn check_large(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = linear(group);
    if index >= chunk.large_items || chunk.first_large + index >= counters.large_items {
        return;
    }
    if lane == 0u {
        atomicStore(&marks, 0u);
    }
    if beyond_limit(lane) {
        return;
    }
    let item = large_items[chunk.first_large + index];
    let row = item.row * LANES + lane;
    var row_entry = 0u;
    var row_box: KnownBox;
    if row < item.boxes {
        row_entry = entries[item.start + row];
        row_box = boxes[box_of(row_entry)];
    }
    var lane_marks = row_entry;
    for (var at = item.column * LANES + lane; at < min(item.end_column * LANES, item.boxes); at += LANES) {
        lane_marks |= entries[item.start + at];
    }
    atomicOr(&marks, lane_marks);
    workgroupBarrier();
    if lane == 0u {
        let all = atomicLoad(&marks);
        skip = u32(!owns(all, 0u) || !may_be_wanted(all));
    }
    if workgroupUniformLoad(&skip) != 0u {
        return;
    }
    for (var column = item.column; column < item.end_column; column++) {
        let n = min(LANES, item.boxes - column * LANES);
        workgroupBarrier();
        if lane < n {
            let entry = entries[item.start + column * LANES + lane];
            column_entries[lane] = entry;
            column_boxes[lane] = boxes[box_of(entry)];
        }
        workgroupBarrier();
        let within = column == item.row;
        let hits = test_row(lane, row, row_entry, row_box, item, n, within);
        // Words of a row: its index, its number of hits less one, and a byte for each hit.
        let words = select(0u, (hits + 5u) / 4u, hits > 0u);
        // Algorithm 2, line 26, takes a prefix sum here. The rows may come in any order, so atomics are enough: 1 barrier
        // instead of 17.
        var rank = 0u;
        var word_rank = 0u;
        if hits > 0u {
            rank = atomicAdd(&tally[HITS], hits);
            word_rank = atomicAdd(&tally[ROW_WORDS], words);
        }
        workgroupBarrier();
        if lane == 0u {
            placed = place(item, column);
        }
        let to = workgroupUniformLoad(&placed);
        let written = hits > 0u && to.at != NO_SPACE;
        if written && to.packed != 0u {
            write_row(to.at + word_rank, lane, hits, within, n);
        }
        if written && to.packed == 0u {
            write_pairs(to.at + 2u * rank, lane, row_entry, row_box, within, n);
        }
    }
}

fn write_pairs(start: u32, lane: u32, entry: u32, one: KnownBox, within: bool, n: u32) {
    var at = start;
    for (var w = 0u; w < 8u; w++) {
        var bits = mask[w];
        while bits != 0u {
            let k = 32u * w + firstTrailingBit(bits);
            bits &= bits - 1u;
            let j = select(k, row_partner(lane, k, n), within);
            write_pair(at, box_of(entry), box_of(column_entries[j]), mark_of(one, column_boxes[j]));
            at += 2u;
        }
    }
}

// Writes a row of a packed record, four bytes to a word.
fn write_row(start: u32, lane: u32, hits: u32, within: bool, n: u32) {
    var at = start;
    var word = lane | ((hits - 1u) << 8u);
    var shift = 16u;
    for (var w = 0u; w < 8u; w++) {
        var bits = mask[w];
        while bits != 0u {
            let k = 32u * w + firstTrailingBit(bits);
            bits &= bits - 1u;
            if shift == 32u {
                out[at] = word;
                at += 1u;
                word = 0u;
                shift = 0u;
            }
            word |= select(k, row_partner(lane, k, n), within) << shift;
            shift += 8u;
        }
    }
    out[at] = word;
}
