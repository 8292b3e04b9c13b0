//! A model of what a sorted search costs on a GPU: bytes of memory by kernel, operations at the hottest address, milliseconds. It
//! takes the counts of a call, and was never fitted to a device.
//!
//! A kernel streams bytes, and reaches places of tables in no order. A place that misses the cache costs a line, and one that
//! is changed costs its way back too. A table that fits the cache is free.

use pbig_core::Pair;
use pbig_gpu::layout::{CELLS_PER_BLOCK, Cell, DeviceBox, LANES, Located, SHORT_ROW, Slot, SmallItem};

/// The counts of a call, as the report has them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Counts {
    pub boxes: f64,
    pub cells: f64,
    pub entries: f64,
    pub tests: f64,
    pub pairs: f64,
    /// Pairs of the box with the most of them, such as a ground.
    pub longest_row: f64,
    /// True if boxes are counted in coarser levels than their own.
    pub has_visits: bool,
}

/// A GPU, by its data sheet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gpu {
    /// Name, as it occurs in an adapter's.
    pub name: &'static str,
    /// Memory bandwidth, in GB/s. The model reaches 60% of it.
    pub bandwidth: f64,
    /// Bandwidth between host and device in GB/s; none where they share their memory.
    pub bus: Option<f64>,
    /// Last cache of the GPU, in bytes.
    pub cache: f64,
    pub line: f64,
    /// Atomic operations on one address, in a second.
    pub atomics: f64,
}

/// GPUs from a large discrete one to a small integrated one.
pub const GPUS: [Gpu; 4] = [
    Gpu { name: "H100", bandwidth: 3350.0, bus: Some(50.0), cache: 50e6, line: 32.0, atomics: 1.7e9 },
    Gpu { name: "RTX 4070", bandwidth: 504.0, bus: Some(25.0), cache: 36e6, line: 32.0, atomics: 2.4e9 },
    Gpu { name: "M2", bandwidth: 100.0, bus: None, cache: 8e6, line: 64.0, atomics: 0.7e9 },
    Gpu { name: "Iris", bandwidth: 68.0, bus: None, cache: 4e6, line: 64.0, atomics: 0.3e9 },
];

/// Share of the bandwidth that kernels reach.
const REACHED: f64 = 0.6;
/// Milliseconds for a dispatch, and for a submission and its wait.
const DISPATCH_MS: f64 = 0.008;
const CALL_MS: f64 = 0.15;
/// Dispatches of a sorted search. wgpu adds one for each indirect one.
const DISPATCHES: f64 = 17.0 + 7.0;

/// Memory accesses of a kernel, or of a copy.
struct Traffic {
    /// Bytes read and written in order.
    streamed: f64,
    /// Accesses in no order.
    scattered: f64,
    /// Bytes of such an access, and of the table that it goes to.
    element: f64,
    table: f64,
    /// Ways of a line: 1 for reads, 2 for changes.
    ways: f64,
}

impl Traffic {
    fn streams(streamed: f64) -> Self {
        Self { streamed, scattered: 0.0, table: 0.0, element: 0.0, ways: 1.0 }
    }

    fn and_reads(self, scattered: f64, element: f64, table: f64) -> Self {
        Self { scattered, element, table, ..self }
    }

    fn and_changes(self, scattered: f64, element: f64, table: f64) -> Self {
        Self { ways: 2.0, ..self.and_reads(scattered, element, table) }
    }

    /// Returns the bytes that the memory of a GPU moves.
    fn bytes(&self, gpu: &Gpu) -> f64 {
        // An element at any multiple of its size may lie across two lines.
        let lines = 1.0 + (self.element - 4.0) / gpu.line;
        let misses = (1.0 - gpu.cache / self.table.max(1.0)).max(0.0);
        self.streamed + self.scattered * lines * gpu.line * self.ways * misses
    }
}

const fn size<T>() -> f64 {
    size_of::<T>() as f64
}

impl Counts {
    /// Returns the number of work items of small cells.
    pub fn items(&self) -> f64 {
        (self.tests / f64::from(LANES) + self.cells / f64::from(CELLS_PER_BLOCK)).ceil()
    }

    /// Returns the number of boxes that the items load: each box of a cell once, and once more for each item that begins in the
    /// cell.
    pub fn box_loads(&self) -> f64 {
        self.entries + self.items() * self.entries / self.cells.max(1.0)
    }

    /// Returns the number of atomic operations at the hottest address: the output's counter, the valid boxes, the first box with
    /// most pairs.
    pub fn hottest(&self) -> f64 {
        let groups = f64::from(LANES);
        self.items().max(self.boxes / groups).max((self.longest_row / groups).ceil())
    }

    /// Returns the accesses of the upload, each kernel and the readback, in their order.
    fn traffic(&self) -> [Traffic; 14] {
        let &Self { boxes: n, entries: e, pairs: p, .. } = self;
        let (cells, rows) = (self.cells * size::<Cell>(), 4.0 * n);
        let (boxes, located, pair) = (size::<DeviceBox>() * n, size::<Located>() * n, size::<Pair>());
        let visits = if self.has_visits { located } else { 0.0 };
        let lists = self.cells * size::<Slot>() + self.items() * size::<SmallItem>();
        let loads = self.box_loads();
        let long = if self.longest_row > f64::from(SHORT_ROW) { self.longest_row } else { 0.0 };
        let check = Traffic::streams(lists + 4.0 * loads + boxes + pair * p);
        [
            Traffic::streams(2.0 * boxes),
            // Clears.
            Traffic::streams(cells + rows),
            // The map: locate, visit, both kernels of the scan, schedule, scatter.
            Traffic::streams(boxes + located).and_changes(e, 4.0, cells),
            Traffic::streams(visits),
            Traffic::streams(2.0 * cells),
            Traffic::streams(2.0 * cells + lists),
            Traffic::streams(located + 4.0 * e).and_changes(e, 4.0, cells + 4.0 * e),
            check.and_reads(loads, size::<DeviceBox>(), boxes),
            // The sort: count_pairs, scan of rows, place_pairs, rank_pairs, long rows.
            Traffic::streams(pair * p).and_changes(p, 4.0, rows),
            Traffic::streams(2.0 * rows),
            Traffic::streams(2.0 * pair * p).and_changes(p, pair, pair * p),
            Traffic::streams(2.0 * pair * p + rows),
            Traffic::streams(3.0 * pair * long),
            Traffic::streams(pair * p),
        ]
    }

    /// Returns the bytes that the memory of a GPU moves in a call.
    pub fn bytes(&self, gpu: &Gpu) -> f64 {
        self.traffic().iter().map(|traffic| traffic.bytes(gpu)).sum()
    }

    /// Returns the predicted milliseconds of a call, without the host's part: memory, bus, the hottest address, and what each
    /// dispatch costs.
    pub fn predicted_ms(&self, gpu: &Gpu) -> f64 {
        let memory = self.bytes(gpu) / (REACHED * gpu.bandwidth * 1e6);
        let moved = size::<DeviceBox>() * self.boxes + size::<Pair>() * self.pairs;
        let bus = gpu.bus.map_or(0.0, |bus| moved / (bus * 1e6));
        let waiting = self.hottest() / (gpu.atomics / 1e3);
        memory + bus + waiting + DISPATCHES * DISPATCH_MS + CALL_MS
    }

    /// Returns the milliseconds if each box went in once and each pair came out once: what no pipeline can beat.
    pub fn floor_ms(&self, gpu: &Gpu) -> f64 {
        (size::<DeviceBox>() * self.boxes + size::<Pair>() * self.pairs) / (REACHED * gpu.bandwidth * 1e6)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A million unit cubes.
    const UNIT: Counts = Counts {
        boxes: 1e6,
        cells: 261_951.0,
        entries: 2.4e6,
        tests: 18e6,
        pairs: 991_097.0,
        longest_row: 9.0,
        has_visits: false,
    };

    #[test]
    fn a_box_costs_what_the_document_says() {
        let bytes_a_box = [GPUS[1], GPUS[3]].map(|gpu| (UNIT.bytes(&gpu) / UNIT.boxes).round());
        assert_eq!(bytes_a_box, [240.0, 722.0]);
        let rounded = |ms: f64| (100.0 * ms).round() / 100.0;
        assert_eq!(GPUS.map(|gpu| rounded(UNIT.predicted_ms(&gpu))), [1.14, 2.44, 8.91, 18.29]);
        assert_eq!(GPUS.map(|gpu| rounded(UNIT.floor_ms(&gpu))), [0.02, 0.11, 0.53, 0.78]);
    }

    /// A pair of a ground costs no more than another one: bytes and hottest address grow with the pairs.
    #[test]
    fn a_ground_costs_what_its_pairs_cost() {
        let ground = Counts {
            entries: UNIT.entries + UNIT.boxes,
            tests: UNIT.tests + UNIT.boxes,
            pairs: UNIT.pairs + UNIT.boxes,
            longest_row: UNIT.boxes,
            has_visits: true,
            ..UNIT
        };
        assert!(ground.bytes(&GPUS[3]) < 2.0 * UNIT.bytes(&GPUS[3]));
        assert!(ground.hottest() < 1.1 * UNIT.hottest());
    }

    #[test]
    fn ten_million_boxes_on_a_ground_stay_below_a_display_drivers_limit() {
        let n = 1e7;
        let counts = Counts {
            boxes: n,
            cells: 2.6e6,
            entries: 3.4 * n,
            tests: 19.0 * n,
            pairs: 2.0 * n,
            longest_row: n,
            has_visits: true,
        };
        let longest = |gpu: &Gpu| {
            let bytes = counts.traffic().iter().map(|traffic| traffic.bytes(gpu)).fold(0.0, f64::max);
            bytes / (REACHED * gpu.bandwidth * 1e6)
        };
        assert!(longest(&GPUS[3]) < 200.0, "{} ms", longest(&GPUS[3]));
    }
}
