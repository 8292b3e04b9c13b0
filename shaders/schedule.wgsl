// Schedule (PBIG 4.3): turns cells into work items of bounded size. The pairs of small cells are packed, LANES pairs to an
// item. Large cells are cut into segments. A workgroup handles a block of cells and reserves its part of each list once.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> cells: array<Cell>;
@group(0) @binding(2) var<storage, read> sums: array<u32>;
@group(0) @binding(3) var<storage, read_write> slots: array<Slot>;
@group(0) @binding(4) var<storage, read_write> small_items: array<SmallItem>;
@group(0) @binding(5) var<storage, read_write> large_items: array<LargeItem>;
// Counters, as atomics.
@group(0) @binding(6) var<storage, read_write> counters: array<atomic<u32>, 8>;

const CELLS_PER_LANE = 4u;
const CELLS_PER_BLOCK = 1024u;
const SLOTS = 1u;
const SMALL_ITEMS = 2u;
const LARGE_ITEMS = 3u;
const TESTS = 5u;
const TOO_MANY_TESTS = 7u;

var<workgroup> slot_base: u32;
var<workgroup> item_base: u32;
var<workgroup> large_count: atomic<u32>;
var<workgroup> large_seen: u32;
var<workgroup> large_cells: array<u32, CELLS_PER_BLOCK>;

// Returns the first entry of a cell.
fn start_of(index: u32) -> u32 {
    if index == 0u {
        return 0u;
    }
    return cells[index - 1u].visitors + block_start(2u * index - 1u);
}

// Returns the counts of a cell, from the ends of its entries.
fn counts_of(index: u32) -> Cell {
    let ends = cells[index];
    let before = start_of(index) - block_start(2u * index);
    return Cell(ends.residents - before, ends.visitors - ends.residents);
}

// Returns the number of pairs with at least one resident. In Avril's numbering these are the pairs of the first rows.
fn pairs_of(cell: Cell) -> u32 {
    let n = cell.residents + cell.visitors;
    return cell.residents * (2u * n - cell.residents - 1u) / 2u;
}

// Maximum number that `large_tests` returns, less one.
const MOST_TESTS = 1u << 30u;

// Returns about as many tests as a large cell needs, in units of LANES.
fn large_tests(cell: Cell) -> u32 {
    let partners = cell.residents + 2u * cell.visitors;
    let whole = partners / (2u * LANES);
    if whole > MOST_TESTS / cell.residents {
        return MOST_TESTS + 1u;
    }
    let rest = cell.residents * (partners % (2u * LANES)) / (2u * LANES);
    return min(cell.residents * whole + rest, MOST_TESTS) + 1u;
}

// Adds to the number of tests, by one lane.
fn add_tests(amount: u32) {
    let before = atomicAdd(&counters[TESTS], amount);
    if before + amount < before {
        atomicMax(&counters[TOO_MANY_TESTS], 1u);
    }
}

fn is_small(cell: Cell) -> bool {
    return cell.residents + cell.visitors <= params.small_cell;
}

// Returns the number of work items of the rows before `row`, for `columns` segments of columns. An item has
// `params.columns` segments and starts at a multiple of that, so the rows of one multiple have equally many items.
fn items_before(row: u32, columns: u32) -> u32 {
    let wide = params.columns;
    let most = (columns + wide - 1u) / wide;
    let group = row / wide;
    return wide * (group * most - group * (group - 1u) / 2u) + (row % wide) * (most - group);
}

@compute @workgroup_size(LANES)
fn schedule(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    if lane == 0u {
        atomicStore(&large_count, 0u);
    }
    workgroupBarrier();
    let block = linear(group);
    let first = (block * LANES + lane) * CELLS_PER_LANE;
    var pairs = 0u;
    var used = 0u;
    for (var i = 0u; i < CELLS_PER_LANE; i++) {
        if first + i >= params.cells {
            continue;
        }
        let cell = counts_of(first + i);
        if cell.residents == 0u || cell.residents + cell.visitors < 2u {
            continue;
        }
        if is_small(cell) {
            pairs += pairs_of(cell);
            used += 1u;
        } else {
            large_cells[atomicAdd(&large_count, 1u)] = first + i;
        }
    }
    var pair = block_scan(pairs, lane);
    let all_pairs = block_sum();
    let slot = block_scan(used, lane);
    let all_slots = block_sum();
    if lane == 0u {
        large_seen = atomicLoad(&large_count);
        slot_base = atomicAdd(&counters[SLOTS], all_slots);
        let all_items = (all_pairs + LANES - 1u) / LANES;
        item_base = atomicAdd(&counters[SMALL_ITEMS], all_items);
        add_tests(all_items);
    }
    let base = workgroupUniformLoad(&slot_base);
    let items = workgroupUniformLoad(&item_base);
    var rank = slot;
    for (var i = 0u; i < CELLS_PER_LANE; i++) {
        if first + i >= params.cells {
            continue;
        }
        let cell = counts_of(first + i);
        let n = cell.residents + cell.visitors;
        if cell.residents == 0u || n < 2u || !is_small(cell) {
            continue;
        }
        if base + rank < params.slot_capacity {
            slots[base + rank] = Slot(start_of(first + i), n | (cell.residents << 16u), pair);
        }
        let end = pair + pairs_of(cell);
        // Writes the items that begin in this cell.
        for (var k = (pair + LANES - 1u) / LANES; k * LANES < end; k++) {
            if items + k < params.small_capacity {
                let left = min(LANES, all_pairs - k * LANES);
                small_items[items + k] =
                    SmallItem(base + rank, min(LANES, all_slots - rank), k * LANES, left);
            }
        }
        pair = end;
        rank += 1u;
    }
    schedule_large(lane);
}

// Schedules the large cells of the block, one after the other. Each lane takes a row of segments.
fn schedule_large(lane: u32) {
    let count = workgroupUniformLoad(&large_seen);
    for (var i = 0u; i < count; i++) {
        let index = large_cells[i];
        let cell = counts_of(index);
        let n = cell.residents + cell.visitors;
        let rows = (cell.residents + LANES - 1u) / LANES;
        let columns = (n + LANES - 1u) / LANES;
        if lane == 0u {
            item_base = atomicAdd(&counters[LARGE_ITEMS], items_before(rows, columns));
            add_tests(large_tests(cell));
        }
        let items = workgroupUniformLoad(&item_base);
        let start = start_of(index);
        for (var row = lane; row < rows; row += LANES) {
            var at = items + items_before(row, columns);
            for (var column = row - row % params.columns; column < columns; column += params.columns) {
                if at < params.large_capacity {
                    large_items[at] = LargeItem(start, n, cell.residents, row,
                        max(column, row), min(column + params.columns, columns));
                }
                at += 1u;
            }
        }
    }
}
