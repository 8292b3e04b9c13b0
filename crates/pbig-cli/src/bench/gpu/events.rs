//! Updates by the share that moves. The bytes that go up and come back should follow the number of changed boxes, not the
//! number of all boxes.

use pbig_core::GpuFinder;
use pbig_harness::boxes::BoxSet;
use pbig_harness::cells;
use pbig_harness::gpu_race::race;
use pbig_harness::output::{Failure, progress};
use pbig_harness::table::Table;

/// Distance of a move along each axis at most, in edges.
const DISTANCE: f32 = 0.1;

const SHARES: [f64; 4] = [0.001, 0.01, 0.1, 1.0];

const COLUMNS: [&str; 9] = [
    "boxes",
    "share",
    "pairs",
    "events",
    "cpu_ms",
    "gpu_ms",
    "cpu_over_gpu",
    "uploaded_bytes",
    "downloaded_bytes",
];

/// Returns the medians of setting the boxes of the set `unit` that have moved, and the update.
pub(super) fn table(gpu: &GpuFinder, quick: bool) -> Result<Table, Failure> {
    let all: &[usize] = if quick { &[10_000] } else { &[10_000, 100_000, 1_000_000, 10_000_000] };
    let cases: Vec<_> = super::sizes(gpu, all).flat_map(|boxes| SHARES.map(|share| (boxes, share))).collect();
    let bar = progress(cases.len(), "shares");
    let mut table = Table::new("events", COLUMNS);
    for (boxes, share) in cases {
        let start = BoxSet::named("unit").expect("a set of the harness").boxes(boxes, 1);
        let raced = race(gpu, start, share, DISTANCE)?;
        let ([cpu, gpu], report) = (raced.ms, &raced.report);
        let counts = cells![boxes, share, raced.pairs, raced.events, cpu, gpu, cpu / gpu];
        table.row([counts, cells![report.uploaded, report.downloaded]].concat());
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(table)
}
