// Check, large cells (PBIG algorithm 2): tests a segment of rows against segments of columns, which pass through workgroup
// memory. Within one segment equation 7 distributes the pairs over the rows. With few residents the two change roles.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> chunk: Chunk;
@group(0) @binding(2) var<storage, read> boxes: array<DeviceBox>;
@group(0) @binding(3) var<storage, read> filters: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read> entries: array<u32>;
@group(0) @binding(5) var<storage, read> counters: Counters;
@group(0) @binding(6) var<storage, read> large_items: array<LargeItem>;
@group(0) @binding(7) var<storage, read_write> totals: array<atomic<u32>, 8>;
@group(0) @binding(8) var<storage, read_write> out: array<u32>;

// If true, the rows of one segment get equally many pairs (PBIG 5.1). If false, a row gets all boxes after it.
override BALANCED: bool = true;

// The staged segment: usually the columns.
var<workgroup> staged_boxes: array<DeviceBox, LANES>;
var<workgroup> staged_entries: array<u32, LANES>;
// All marks of the item's entries. If the mark of an axis is missing, the cell owns none of the item's pairs, and the item
// is skipped. For many boxes across one border of cells this skips 7 of 8 cells.
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

// Hits of a lane against the staged segment: bit k is set if the k-th partner is a hit.
var<private> mask: array<u32, 8>;

// Two segments of a large cell, of which each lane has a box of one, and workgroup memory has the other.
struct Segments {
    // Index of the lanes' segment and of the staged one.
    lanes: u32,
    staged: u32,
    // The columns are the lanes' segment, and the residents of the rows are staged.
    is_swapped: bool,
    // Both are one segment.
    within: bool,
    // Number of boxes of the columns, and of residents of the rows.
    boxes: u32,
    residents: u32,
}

// Returns the segments of an item and a column. A lane of the rows tests all columns, or the half that equation 7 assigns; a
// lane of the columns tests the residents. The roles with the shorter loop keep more lanes busy: under one ground the lanes
// are its visitors.
fn segments(item: LargeItem, column: u32) -> Segments {
    let within = column == item.row;
    let boxes = min(LANES, item.boxes - column * LANES);
    let residents = min(LANES, item.residents - item.row * LANES);
    if residents < select(boxes, boxes / 2u, within) {
        return Segments(column, item.row, true, within, boxes, residents);
    }
    return Segments(item.row, column, false, within, boxes, residents);
}

// Returns the number of partners of a lane.
fn partners(lane: u32, s: Segments) -> u32 {
    if s.is_swapped {
        let most = select(s.residents, min(s.residents, lane), s.within);
        return select(0u, most, lane < s.boxes);
    }
    return select(select(0u, s.boxes, lane < s.residents), row_length(lane, s.boxes), s.within);
}

// Returns the place of a lane's k-th partner in the staged segment.
fn partner(lane: u32, k: u32, s: Segments) -> u32 {
    return select(k, row_partner(lane, k, s.boxes), s.within && !s.is_swapped);
}

// Stages a segment, and returns the entry of the lane's own box.
fn stage(item: LargeItem, lane: u32, s: Segments) -> u32 {
    let own = s.lanes * LANES + lane;
    let other = s.staged * LANES + lane;
    if lane < select(s.boxes, s.residents, s.is_swapped) {
        let entry = entries[item.start + other];
        staged_entries[lane] = entry;
        staged_boxes[lane] = ordered_box(boxes[box_of(entry)]);
    }
    var entry = 0u;
    if own < item.boxes {
        entry = entries[item.start + own];
    }
    workgroupBarrier();
    return entry;
}

// Tests a lane's box against its partners. Returns the number of hits.
fn test_partners(lane: u32, entry: u32, one: DeviceBox, s: Segments) -> u32 {
    let length = partners(lane, s);
    var counts = vec3<u32>(0u);
    var hits = 0u;
    for (var w = 0u; w < 8u; w++) {
        var bits = 0u;
        for (var k = 32u * w; k < min(32u * w + 32u, length); k++) {
            let j = partner(lane, k, s);
            // Two visitors meet in a cell of their own level.
            if s.within && min(lane, j) >= s.residents {
                continue;
            }
            counts.x += 1u;
            if !owns(entry, staged_entries[j]) {
                counts.y += 1u;
                continue;
            }
            if !overlap(one, staged_boxes[j]) {
                continue;
            }
            counts.z += 1u;
            if allowed(box_of(entry), box_of(staged_entries[j])) {
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
    var lane_marks = 0u;
    if row < item.boxes {
        lane_marks = entries[item.start + row];
    }
    for (var at = item.column * LANES + lane; at < min(item.end_column * LANES, item.boxes); at += LANES) {
        lane_marks |= entries[item.start + at];
    }
    atomicOr(&marks, lane_marks);
    workgroupBarrier();
    if lane == 0u {
        let all = atomicLoad(&marks);
        skip = u32(!owns(all, 0u));
    }
    if workgroupUniformLoad(&skip) != 0u {
        return;
    }
    for (var column = item.column; column < item.end_column; column++) {
        workgroupBarrier();
        let s = segments(item, column);
        let entry = stage(item, lane, s);
        let one = ordered_box(boxes[box_of(entry)]);
        let hits = test_partners(lane, entry, one, s);
        let at = reserve(lane, hits);
        if hits > 0u && at != NO_SPACE {
            write_pairs(at, lane, entry, s);
        }
    }
}

fn write_pairs(start: u32, lane: u32, entry: u32, s: Segments) {
    var at = start;
    for (var w = 0u; w < 8u; w++) {
        var bits = mask[w];
        while bits != 0u {
            let k = 32u * w + firstTrailingBit(bits);
            bits &= bits - 1u;
            write_pair(at, box_of(entry), box_of(staged_entries[partner(lane, k, s)]));
            at += 2u;
        }
    }
}
