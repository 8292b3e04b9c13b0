//! The twins: each computes the result of a kernel, one box, cell or pair after the other.

use super::*;

/// A kernel, its twin, its number of workgroups, and the comparison of their results where the device may choose an order. The
/// comparison gets the state before, the found one and the wanted one.
pub(super) struct Twin {
    pub(super) kernel: &'static Kernel,
    pub(super) run: fn(&mut State),
    pub(super) groups: fn(&State) -> u32,
    compare: Option<Compare>,
}

type Compare = fn(&State, &State, &State) -> Option<String>;

impl Twin {
    /// Returns the first difference of two results: in any buffer, unless the kernel has a comparison of its own.
    pub(super) fn compare(&self, before: &State, found: &State, wanted: &State) -> Option<String> {
        if let Some(compare) = self.compare {
            return compare(before, found, wanted);
        }
        let [mut found, mut wanted] = [found, wanted].map(State::clone);
        self.kernel.bindings.iter().find_map(|&buffer| {
            let words = |s: &mut State| s.bytes(buffer).as_chunks::<4>().0.to_vec();
            same(buffer.name(), &words(&mut found), &words(&mut wanted))
        })
    }
}

/// The twins, in the order in which the kernels run. The kernels of the sort have none.
pub(super) static TWINS: [Twin; 13] = [
    Twin { kernel: &shaders::MEASURE, run: measure, groups: by_box, compare: Some(compare_summaries) },
    Twin { kernel: &shaders::LOCATE, run: locate, groups: by_box, compare: None },
    Twin { kernel: &shaders::VISIT, run: visit, groups: by_box, compare: None },
    Twin { kernel: &shaders::SCAN_BLOCKS, run: scan_blocks, groups: by_block, compare: None },
    Twin { kernel: &shaders::SCAN_SUMS, run: scan_sums, groups: one, compare: None },
    Twin {
        kernel: &shaders::SCHEDULE,
        run: schedule,
        groups: by_cell_block,
        compare: Some(compare_schedules),
    },
    Twin { kernel: &shaders::SCATTER, run: scatter, groups: by_box, compare: Some(compare_entries) },
    Twin { kernel: &shaders::ARRANGE, run: arrange, groups: one, compare: None },
    Twin {
        kernel: &shaders::CHECK_SMALL,
        run: check_small,
        groups: by_small_item,
        compare: Some(compare_checks),
    },
    Twin {
        kernel: &shaders::CHECK_LARGE,
        run: check_large,
        groups: by_large_item,
        compare: Some(compare_checks),
    },
    Twin { kernel: &shaders::CHECK_ALL, run: check_all, groups: by_pair, compare: Some(compare_checks) },
    Twin { kernel: &shaders::CONCLUDE, run: conclude, groups: one, compare: None },
    Twin { kernel: &shaders::INDEX_PAIRS, run: index_pairs, groups: by_cell, compare: Some(compare_indices) },
];

pub(super) fn twin(kernel: &str) -> &'static Twin {
    TWINS.iter().find(|twin| twin.kernel.name == kernel).expect("a twin for each kernel")
}

pub(super) fn one(_: &State) -> u32 {
    1
}

pub(super) fn by_box(s: &State) -> u32 {
    s.params.boxes.div_ceil(LANES)
}

pub(super) fn by_cell(s: &State) -> u32 {
    s.params.cells.div_ceil(LANES)
}

pub(super) fn by_block(s: &State) -> u32 {
    (2 * s.params.cells).div_ceil(COUNTS_PER_BLOCK)
}

pub(super) fn by_cell_block(s: &State) -> u32 {
    s.params.cells.div_ceil(CELLS_PER_BLOCK)
}

pub(super) fn by_small_item(s: &State) -> u32 {
    s.counters.small_items.min(s.chunk.small_items)
}

pub(super) fn by_large_item(s: &State) -> u32 {
    s.counters.large_items.min(s.chunk.large_items)
}

pub(super) fn by_pair(s: &State) -> u32 {
    pair_count(s.params.boxes.into()).div_ceil(LANES.into()) as u32
}

pub(super) fn measure(s: &mut State) {
    let extent = |low: f32, high: f32| {
        let is_finite = low.is_finite() && high.is_finite();
        if is_finite { (high - low).to_bits() } else { f32::INFINITY.to_bits() }
    };
    for one in s.boxes.iter().filter(|one| one.is_valid()) {
        let extents = [0, 1, 2].map(|k| extent(one.min[k], one.max[k]));
        let class = 4 * (extents.into_iter().max().unwrap_or(0) >> 23) as usize;
        s.summary[class] += 1;
        for (largest, extent) in s.summary[class + 1..class + 4].iter_mut().zip(extents) {
            *largest = extent.max(*largest);
        }
    }
    let (count, sample) = (s.boxes.len(), 1000.min(s.boxes.len()));
    let (_, words) = s.summary.split_at_mut(CLASS_WORDS as usize);
    for (i, words) in words.chunks_mut(6).take(sample).enumerate() {
        let walk = (u64::from((i as u32).wrapping_mul(0x9E37_79B9)) * count as u64) >> 32;
        let one = s.boxes[if count <= 1000 { i } else { walk as usize }];
        words.copy_from_slice(&[one.min, one.max].concat().iter().map(|x| x.to_bits()).collect::<Vec<_>>());
    }
}

pub(super) fn locate(s: &mut State) {
    for id in 0..s.boxes.len() {
        let one = DeviceBox::new(&s.boxes[id]);
        if one.low[0] > one.high[0] {
            s.located[id].shape = NO_LEVEL;
            continue;
        }
        s.counters.valid += 1;
        let cells = |corner: [i32; 3]| corner.map(|key| finest_cell(&s.params, key));
        let (low, high) = (cells(one.low), cells(one.high));
        let level = level_of(&s.params, low, high);
        let at = located_at(&s.params, low, high, level);
        s.located[id] = at;
        for (cell, _) in cells_of(&s.params, &at, level) {
            s.cells[cell].residents += 1;
        }
    }
}

/// Returns the float of an ordered integer.
pub(super) fn float_of(key: i32) -> f32 {
    let bits = if key < 0 { key ^ i32::MAX } else { key };
    f32::from_bits(bits as u32)
}

/// Returns the cell of an ordered integer at the finest resolution. No step rounds but the two that round down.
pub(super) fn finest_cell(params: &Params, key: i32) -> i32 {
    const REACH: f64 = 1073741824.0;
    let ticks = (f64::from(float_of(key)) * 2f64.powi(150 - params.tick_exponent)).floor();
    let above = ticks.clamp(-REACH, REACH - 1.0) + REACH;
    ((above as u64 * u64::from(params.cells_per_tick)) >> 16) as i32
}

/// Returns the first level at which the box touches few cells on each axis, or the last level.
pub(super) fn level_of(params: &Params, low: [i32; 3], high: [i32; 3]) -> u32 {
    let steps = |l: &Level, k: usize| (high[k] >> l.shift) - (low[k] >> l.shift);
    let fits = |l: &Level| (0..3).all(|k| l.dims[k] == 1 || steps(l, k) < MAX_SPAN as i32);
    let last = params.levels - 1;
    (0..last).find(|&level| fits(&params.level[level as usize])).unwrap_or(last)
}

/// Returns the cells of a box at its level, from those at the finest resolution.
fn located_at(params: &Params, low: [i32; 3], high: [i32; 3], level: u32) -> Located {
    let shift = params.level[level as usize].shift;
    let first = low.map(|low| low >> shift);
    let steps = [0, 1, 2].map(|k| ((high[k] >> shift) - first[k]).min(3) as u32);
    let spans = steps[0] | steps[1] << 2 | steps[2] << 4;
    Located { low: first, shape: level | spans << SPAN_BITS }
}

/// Returns the level. For an invalid box it is larger than all levels.
fn own_level(at: &Located) -> u32 {
    at.shape & ((1 << SPAN_BITS) - 1)
}

/// Returns the cells that a box touches at a level, each with the axis bits of its entry.
pub(super) fn cells_of(params: &Params, at: &Located, level: u32) -> Vec<(usize, u32)> {
    let l = params.level[level as usize];
    // The last level, which is not divided, has no shift.
    let shift = l.shift.saturating_sub(params.level[own_level(at) as usize].shift);
    let high = |k: usize| at.low[k] + (at.shape >> (SPAN_BITS + 2 * k as u32) & 3) as i32;
    let range = |k: usize| if l.dims[k] == 1 { 0..=0 } else { at.low[k] >> shift..=high(k) >> shift };
    let lowest = [0, 1, 2].map(|k| *range(k).start());
    let mut cells = Vec::new();
    for z in range(2) {
        for y in range(1) {
            for x in range(0) {
                cells.push(cell_at(&l, [x, y, z], lowest));
            }
        }
    }
    cells
}

pub(super) fn cell_at(l: &Level, place: [i32; 3], lowest: [i32; 3]) -> (usize, u32) {
    let wrapped = |k: usize| place[k] as u32 % l.dims[k];
    let index = l.first_cell + (wrapped(2) * l.dims[1] + wrapped(1)) * l.dims[0] + wrapped(0);
    let axes: u32 = (0..3).map(|k| u32::from(place[k] == lowest[k]) << k).sum();
    (index as usize, axes << AXIS_BITS)
}

pub(super) fn visit(s: &mut State) {
    for at in s.located.iter().filter(|at| at.shape != NO_LEVEL) {
        for level in own_level(at) + 1..s.params.levels {
            for (cell, _) in cells_of(&s.params, at, level) {
                let cell = &mut s.cells[cell];
                cell.visitors += u32::from(cell.residents > 0);
            }
        }
    }
}

pub(super) fn entries_of(cell: &Cell) -> u32 {
    cell.residents + cell.visitors
}

/// Turns the counts of each block into the ends of the lists within it.
pub(super) fn scan_blocks(s: &mut State) {
    let counts: &mut [u32] = cast_slice_mut(&mut s.cells);
    for (block, sum) in counts.chunks_mut(COUNTS_PER_BLOCK as usize).zip(&mut s.sums) {
        *sum = 0;
        for count in block {
            *sum += *count;
            *count = *sum;
        }
    }
}

pub(super) fn scan_sums(s: &mut State) {
    let mut sum = 0;
    for block in &mut s.sums {
        let own = *block;
        *block = sum;
        sum += own;
    }
    s.counters.entries = sum;
}

pub(super) fn schedule(s: &mut State) {
    let (mut slots, mut small, mut large) = (Vec::new(), Vec::new(), Vec::new());
    let (small_cell, columns) = (s.params.small_cell, s.params.columns);
    let mut tests = 0u64;
    for first in (0..s.cells.len()).step_by(CELLS_PER_BLOCK as usize) {
        let block = first..(first + CELLS_PER_BLOCK as usize).min(s.cells.len());
        let cell = |i: usize| (s.counts_of(i), s.start_of(i));
        let cells = block.map(cell).filter(|(c, _)| has_work(c));
        let (few, many): (Vec<_>, Vec<_>) = cells.partition(|(c, _)| entries_of(c) <= small_cell);
        schedule_small(&few, &mut slots, &mut small);
        tests += many.iter().map(|(cell, _)| u64::from(large_tests(cell))).sum::<u64>();
        large.extend(many.iter().flat_map(|(cell, start)| large_items(cell, *start, columns)));
    }
    s.counters.slots = slots.len() as u32;
    s.counters.small_items = small.len() as u32;
    s.counters.large_items = large.len() as u32;
    tests += small.len() as u64;
    s.counters.tests = tests as u32;
    s.counters.too_many_tests = u32::from(tests > u32::MAX.into());
    (s.slots, s.small_items, s.large_items) = (slots, small, large);
}

/// Returns about as many tests as a large cell needs, in units of LANES.
fn large_tests(cell: &Cell) -> u32 {
    let all = u64::from(cell.residents) * u64::from(cell.residents + 2 * cell.visitors);
    (all / u64::from(2 * LANES)).min(1 << 30) as u32 + 1
}

pub(super) fn has_work(cell: &Cell) -> bool {
    cell.residents > 0 && entries_of(cell) > 1
}

/// Turns the small cells of a block into slots, and their pairs into items of LANES pairs.
pub(super) fn schedule_small(cells: &[(Cell, u32)], slots: &mut Vec<Slot>, items: &mut Vec<SmallItem>) {
    let base = slots.len();
    let mut pairs = 0;
    for &(cell, start) in cells {
        let n = entries_of(&cell);
        slots.push(Slot { start, shape: n | cell.residents << 16, first_pair: pairs });
        pairs += (0..cell.residents).map(|row| n - 1 - row).sum::<u32>();
    }
    for first_pair in (0..pairs).step_by(LANES as usize) {
        let within = slots[base..].iter().rposition(|slot| slot.first_pair <= first_pair);
        let slot = base + within.expect("the first slot begins with pair 0");
        let reach = LANES.min((slots.len() - slot) as u32);
        items.push(SmallItem {
            slot: slot as u32,
            slots: reach,
            first_pair,
            pairs: LANES.min(pairs - first_pair),
        });
    }
}

/// Returns the items of a large cell: each segment of rows with the segments of columns from its own on, cut at multiples of
/// `wide`.
pub(super) fn large_items(cell: &Cell, start: u32, wide: u32) -> Vec<LargeItem> {
    let (boxes, residents) = (entries_of(cell), cell.residents);
    let columns = boxes.div_ceil(LANES);
    let mut items = Vec::new();
    for row in 0..residents.div_ceil(LANES) {
        for from in (row / wide * wide..columns).step_by(wide as usize) {
            let (column, end_column) = (from.max(row), (from + wide).min(columns));
            items.push(LargeItem { start, boxes, residents, row, column, end_column });
        }
    }
    items
}

pub(super) fn scatter(s: &mut State) {
    if s.counters.entries > s.params.entry_capacity {
        return;
    }
    for id in 0..s.located.len() {
        let at = s.located[id];
        // The range of an invalid box is empty.
        let own = own_level(&at);
        for level in own..s.params.levels {
            for (cell, axes) in cells_of(&s.params, &at, level) {
                place(s, cell, id as u32 | axes, level == own);
            }
        }
    }
}

/// Writes an entry at the end of the residents or visitors of a cell, and moves that end down.
pub(super) fn place(s: &mut State, cell: usize, entry: u32, resident: bool) {
    let base = s.sums[2 * cell / COUNTS_PER_BLOCK as usize];
    let ends = &mut s.cells[cell];
    // A cell without residents has no visitors counted, so its ends are its start.
    let takes_visitors = ends.visitors > ends.residents;
    let end = if resident { &mut ends.residents } else { &mut ends.visitors };
    if resident || takes_visitors {
        *end -= 1;
        s.entries[(base + *end) as usize] = entry;
    }
}

/// Returns true if all lists fitted, and true if the tests are no more than the plan promised.
fn fits(s: &State) -> (bool, bool) {
    let (found, room) = (s.counters, s.params);
    let lists = found.entries <= room.entry_capacity
        && found.slots <= room.slot_capacity
        && found.small_items <= room.small_capacity
        && found.large_items <= room.large_capacity;
    (lists, room.most_tests == u32::MAX || found.tests <= room.most_tests && found.too_many_tests == 0)
}

pub(super) fn conclude(s: &mut State) {
    let (words, (lists_fit, tests_fit)) = (wide(s.totals.words), fits(s));
    let status = match (s.has(UNPLANNED), tests_fit, lists_fit && words <= s.chunk.word_capacity.into()) {
        (true, ..) => layout::NOT_PLANNED,
        (_, false, _) => layout::PLAN_REFUSED,
        (_, _, false) => layout::TOO_LARGE,
        _ => layout::COMPLETE,
    };
    let needed = u32::try_from(words / 2).unwrap_or(u32::MAX);
    let pairs = if status == layout::COMPLETE { needed } else { 0 };
    let groups = pairs.div_ceil(LANES);
    let dispatch = [groups.min(GROUPS_PER_ROW), groups.div_ceil(GROUPS_PER_ROW), 1];
    s.pair_count = PairCount { pairs, status, needed, dispatch, ..s.pair_count };
}

pub(super) fn arrange(s: &mut State) {
    let found = s.counters;
    let (lists_fit, tests_fit) = fits(s);
    let fits = lists_fit && tests_fit;
    let groups = |all: u32, first: u32, most: u32| {
        let items = if fits { all.saturating_sub(first).min(most) } else { 0 };
        [items.min(32_768), items.div_ceil(32_768)]
    };
    let Chunk { first_small, small_items, first_large, large_items, .. } = s.chunk;
    let [x, y] = groups(found.small_items, first_small, small_items);
    let [u, v] = groups(found.large_items, first_large, large_items);
    s.dispatches[..6].copy_from_slice(&[x, y, 1, u, v, 1]);
}
