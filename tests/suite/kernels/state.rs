//! The buffers that kernels bind, and the sets that they run on.

use super::*;

/// First value of the counts: just below 2^32, so that every test carries into the high half.
pub(super) const NEARLY: [u32; 2] = [u32::MAX - 2, 0];

/// The buffers that kernels bind.
#[derive(Clone, Debug, Default)]
pub(super) struct State {
    pub(super) params: Params,
    pub(super) chunk: Chunk,
    pub(super) boxes: Vec<Aabb>,
    pub(super) filters: Vec<ProxyFilter>,
    pub(super) located: Vec<Located>,
    pub(super) cells: Vec<Cell>,
    pub(super) sums: Vec<u32>,
    pub(super) counters: Counters,
    pub(super) slots: Vec<Slot>,
    pub(super) small_items: Vec<SmallItem>,
    pub(super) large_items: Vec<LargeItem>,
    pub(super) entries: Vec<u32>,
    pub(super) dispatches: [u32; 6],
    pub(super) totals: Totals,
    pub(super) out: Vec<u32>,
    pub(super) rows: Vec<u32>,
    pub(super) grouped: Vec<[u32; 2]>,
    pub(super) long_rows: Vec<u32>,
    pub(super) windows: Vec<u32>,
    pub(super) summary: Vec<u32>,
    pub(super) pair_count: PairCount,
}

/// A set of boxes, and the settings of the schedule.
pub(super) struct Case {
    pub(super) name: &'static str,
    pub(super) boxes: Vec<Aabb>,
    pub(super) small_cell: u32,
    pub(super) columns: u32,
}

pub(super) fn set(name: &str, n: usize) -> Vec<Aabb> {
    pbig_tests::set(name, n, 1)
}

pub(super) fn cases() -> Vec<Case> {
    let decades = corpus().into_iter().find(|case| case.name == "sizes over twelve decades");
    let case = |name, boxes, small_cell, columns| Case { name, boxes, small_cell, columns };
    vec![
        case("mixed", set("mixed", 3000), 32, 8),
        pile(),
        case("degenerate", set("degenerate", 500), 32, 8),
        case("identical", vec![Aabb::new([0.0; 3], [1.0; 3]); 600], 32, 1),
        case("decades", decades.expect("the corpus has it").boxes, 32, 2),
        crowd(),
    ]
}

/// Returns a set with cells of about four boxes, half of which count as large.
pub(super) fn pile() -> Case {
    Case { name: "pile", boxes: set("pile", 6000), small_cell: 4, columns: 8 }
}

/// Returns many identical boxes across the borders of cells: some large cells own none of their pairs.
pub(super) fn crowd() -> Case {
    let mut boxes = set("pile", 1000);
    boxes.extend(vec![boxes[500]; 700]);
    Case { name: "crowd in a pile", boxes, small_cell: 32, columns: 2 }
}

/// Returns filters that allow some pairs, and forbid others for each possible reason.
pub(super) fn filter(i: u32) -> ProxyFilter {
    ProxyFilter {
        body: if i.is_multiple_of(4) { ProxyFilter::NO_BODY } else { i % 50 },
        kind: 1 << (i % 3),
        accepted_kinds: 1 << (i % 2) | 1,
        test_mode: (i / 2 % 2) as u16,
        memberships: 1 << (i % 5),
        mask: !(1 << (i % 3)),
    }
}

impl State {
    /// Returns the buffers of a call before its first kernel, with exactly the needed capacities.
    pub(super) fn new(case: &Case) -> Self {
        let n = case.boxes.len();
        let (small_cell, columns) = (case.small_cell, case.columns);
        let plan = plan_params(&case.boxes, &GpuOptions::DEFAULT, 1 << 20);
        validate(&plan);
        let (flags, most_tests) = (COUNTED, u32::MAX);
        let params = Params { boxes: n as u32, small_cell, columns, flags, most_tests, ..plan };
        let mut state = Self {
            params,
            chunk: Chunk {
                small_items: 1 << 16,
                large_items: 1 << 16,
                pairs_left: [u32::MAX; 2],
                ..Chunk::default()
            },
            boxes: case.boxes.clone(),
            filters: (0..n as u32).map(filter).collect(),
            summary: vec![0; SUMMARY_WORDS as usize],
            located: vec![Located::default(); n],
            cells: vec![Cell::default(); params.cells as usize],
            sums: vec![0; (2 * params.cells).div_ceil(COUNTS_PER_BLOCK) as usize],
            totals: Totals { words: [0; 2], made: NEARLY, redundant: NEARLY, overlaps: NEARLY },
            ..Self::default()
        };
        state.set_exact_capacities();
        state
    }

    /// Sets the capacities to the lengths of the twins' lists, so that any surplus is noticed.
    pub(super) fn set_exact_capacities(&mut self) {
        let mut dry = self.clone();
        set_capacities(&mut dry.params, &[u32::MAX; 4]);
        TWINS.iter().take_while(|twin| twin.kernel.name != "scatter").for_each(|twin| (twin.run)(&mut dry));
        let Counters { entries, slots, small_items, large_items, .. } = dry.counters;
        set_capacities(&mut self.params, &[entries, slots, small_items, large_items]);
        self.entries = vec![0; entries as usize];
        self.slots = vec![Slot::default(); slots as usize];
        self.small_items = vec![SmallItem::default(); small_items as usize];
        self.large_items = vec![LargeItem::default(); large_items as usize];
    }

    /// Returns the state before a kernel, made by the twins of the kernels before it.
    pub(super) fn before(kernel: &str, case: &Case) -> Self {
        if kernel == "index_pairs" {
            return indices(1000, 77, 4000);
        }
        let mut state = Self::new(case);
        // Without a grid no box is located.
        for twin in TWINS.iter().take_while(|twin| twin.kernel.name != kernel) {
            if kernel == "check_all" && twin.kernel.name == "locate" {
                break;
            }
            // The checks do not depend on each other.
            if twin.kernel.stage != Stage::Check {
                (twin.run)(&mut state);
            }
        }
        state
    }

    pub(super) fn with(mut self, flags: u32) -> Self {
        self.params.flags = flags | COUNTED;
        self
    }

    pub(super) fn has(&self, flag: u32) -> bool {
        self.params.flags & flag != 0
    }

    /// Returns the end of a list of entries, after the scan.
    pub(super) fn end_at(&self, list: usize) -> u32 {
        let cell = &self.cells[list / 2];
        let end = if list.is_multiple_of(2) { cell.residents } else { cell.visitors };
        end + self.sums[list / COUNTS_PER_BLOCK as usize]
    }

    /// Returns the first entry of a cell, after the scan.
    pub(super) fn start_of(&self, cell: usize) -> u32 {
        if cell == 0 { 0 } else { self.end_at(2 * cell - 1) }
    }

    /// Returns the counts of a cell, after the scan.
    pub(super) fn counts_of(&self, cell: usize) -> Cell {
        let (start, residents, visitors) =
            (self.start_of(cell), self.end_at(2 * cell), self.end_at(2 * cell + 1));
        Cell { residents: residents - start, visitors: visitors - residents }
    }

    /// Returns the bytes of a buffer.
    pub(super) fn bytes(&mut self, buffer: Buffer) -> &mut [u8] {
        match buffer {
            Buffer::Params => bytes_of_mut(&mut self.params),
            Buffer::Chunk => bytes_of_mut(&mut self.chunk),
            Buffer::Boxes => cast_slice_mut(&mut self.boxes),
            Buffer::Filters => cast_slice_mut(&mut self.filters),
            Buffer::Located => cast_slice_mut(&mut self.located),
            Buffer::Cells => cast_slice_mut(&mut self.cells),
            Buffer::Sums => cast_slice_mut(&mut self.sums),
            Buffer::Counters => bytes_of_mut(&mut self.counters),
            Buffer::Slots => cast_slice_mut(&mut self.slots),
            Buffer::SmallItems => cast_slice_mut(&mut self.small_items),
            Buffer::LargeItems => cast_slice_mut(&mut self.large_items),
            Buffer::Entries => cast_slice_mut(&mut self.entries),
            Buffer::Dispatches => bytes_of_mut(&mut self.dispatches),
            Buffer::Totals => bytes_of_mut(&mut self.totals),
            Buffer::Out => cast_slice_mut(&mut self.out),
            Buffer::Rows => cast_slice_mut(&mut self.rows),
            Buffer::Grouped => cast_slice_mut(&mut self.grouped),
            Buffer::LongRows => cast_slice_mut(&mut self.long_rows),
            Buffer::Windows => cast_slice_mut(&mut self.windows),
            Buffer::Summary => cast_slice_mut(&mut self.summary),
            Buffer::PairCount => bytes_of_mut(&mut self.pair_count),
        }
    }
}

/// Sets the capacities for entries, slots, small and large items.
pub(super) fn set_capacities(params: &mut Params, capacities: &[u32; 4]) {
    [params.entry_capacity, params.slot_capacity, params.small_capacity, params.large_capacity] = *capacities;
}
