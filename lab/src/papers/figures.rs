//! PBIG's figures 8 and 9: number of boxes, size of cells. They have no printed numbers but what the text says. And table IV: each
//! optimisation on and off.

use super::model::{GAUSSIAN, Model, UNIFORM};
use super::printed::*;
use super::sides::{SearchCall, Setup, Way, effort, once, race};
use super::table_iii::{expected_checks, options_for};
use crate::UNSORTED;
use pbig_core::{Aabb, Report};
use pbig_gpu::GpuOptions;
use pbig_harness::prelude::*;

/// Maximum number of boxes for PBIG's grid on one thread.
const MOST_PLAIN: usize = 1_000_000;

pub(super) fn tables(setup: &Setup) -> Result<Vec<Table>, Failure> {
    let n = setup.on_device();
    let ways =
        TABLE_IV.iter().filter(|(setting, ..)| has_way(setting)).map(|(setting, ..)| optimised(setting));
    let runs = setup.run(&ways.collect::<Vec<_>>(), &crowded(n).draw(n, 1), 1.0)?;
    Ok(vec![by_number(setup)?, by_length(setup)?, optimisations(&runs)])
}

/// Figure 8: whole calls from nothing, all boxes moved since the call before.
fn by_number(setup: &Setup) -> Result<Table, Failure> {
    let columns = "boxes | pairs expected | pairs | off, standard deviations | ms printed | ms, our grid, CPU | \
        ms, PBIG's grid, CPU, one thread | ms, GPU";
    let mut table = Table::new("PBIG figure 8: number of boxes", columns);
    for &n in setup.numbers {
        let (times, pairs) = sides(n, setup)?;
        let printed = (n == MOST_BOXES).then_some("< 1000");
        table.row(cells![n, UNIFORM.pairs(n).round() as u64, pairs, UNIFORM.off(n, pairs), printed, ..times]);
    }
    Ok(table)
}

/// Returns the milliseconds of each side that takes part, and the pairs.
fn sides(n: usize, setup: &Setup) -> Result<([Option<f64>; 3], u64), Failure> {
    let gpu = setup.for_boxes(n);
    let pbig = (n <= MOST_PLAIN).then_some(Way::Pbig(GpuOptions::DEFAULT));
    let sides = [Some(Way::Finder(UNSORTED)), pbig, gpu.map(|_| Way::Gpu(GpuOptions::DEFAULT))];
    let ways: Vec<Way> = sides.into_iter().flatten().collect();
    let raced = race(&ways, gpu, UNIFORM.draw(n, 1), 1.0, effort(n))?;
    let mut ms = raced.iter().map(|call| call.median);
    Ok((sides.map(|side| side.and_then(|_| ms.next())), raced[0].report.pairs))
}

/// Maximum number of checks for a size of cells to be tried: about three minutes on one thread, at 9 ns each.
const MOST_CHECKS: f64 = 2e10;

/// Figure 9: the lengths of the figure, and equation 6 as we use it and as the paper does. Cells that would hold less than a
/// box, which the rule does not give, or take too long, have only their expected checks.
fn by_length(setup: &Setup) -> Result<Table, Failure> {
    let columns =
        "boxes | cell wanted | cell | checks | unnecessary | redundant | ms, PBIG's grid, CPU, one thread";
    let mut table = Table::new("PBIG figure 9: size of cells", columns);
    for &n in setup.numbers.iter().filter(|n| **n >= 10_000) {
        let boxes = UNIFORM.draw(n, 1);
        let pairs = once(Way::Finder(UNSORTED), &boxes)?.report.pairs;
        for cell in CELLS {
            let expected = expected_checks(&UNIFORM, n, cell);
            let is_tried = n as f64 * (cell / SPACE).powi(3) >= 0.3 && expected <= MOST_CHECKS;
            let options = is_tried.then(|| options_for(&boxes, cell));
            let of_cells = options.map(|options| cells_of(&boxes, pairs, options)).transpose()?;
            let of_cells = of_cells.unwrap_or_else(|| cells![(), expected.round() as u64]);
            table.row(cells![n, cell.to_string(), ..of_cells]);
        }
        for boxes_per_cell in [GpuOptions::DEFAULT.boxes_per_cell, WARP as f32] {
            let options = GpuOptions { boxes_per_cell, ..GpuOptions::DEFAULT };
            let of_cells = cells_of(&boxes, pairs, options)?;
            table.row(cells![n, format!("equation 6, W = {boxes_per_cell}"), ..of_cells]);
        }
    }
    Ok(table)
}

/// Returns the row of some cells, in which this number of pairs must be found. The time is the shortest of three; of one if that makes
/// the run too long.
fn cells_of(boxes: &[Aabb], pairs: u64, options: GpuOptions) -> Result<Vec<Value>, Failure> {
    let mut call = once(Way::Pbig(options), boxes)?;
    let found = call.report.pairs;
    check(found == pairs, || format!("cells of {:?}: {found} pairs, not {pairs}", call.cell))?;
    for _ in 0..if call.ms < 10_000.0 { 2 } else { 0 } {
        call.ms = call.ms.min(once(Way::Pbig(options), boxes)?.ms);
    }
    Ok(cells![call.cell, ..call.checks(), call.ms])
}

/// Returns boxes of section 6.3 that pair as often as 10^7 do in its space: pairs a box follow `N e^3`.
fn crowded(n: usize) -> Model {
    let larger = (MOST_BOXES as f64 / n as f64).cbrt();
    Model { lengths: LENGTHS.map(|length| length * larger), ..GAUSSIAN }
}

/// Returns true if ours has a setting: it does not compress.
fn has_way(setting: &str) -> bool {
    !setting.contains('C')
}

/// Returns the way of a setting. Chunks are as small as gives several at this size: one alone leaves nothing to overlap.
fn optimised(setting: &str) -> Way {
    let has = |letter: char| setting.contains(letter);
    let (pipelining, load_balancing, chunk) = (has('P'), has('B'), [1 << 13, 1 << 7]);
    Way::Gpu(GpuOptions { pipelining, load_balancing, chunk, ..GpuOptions::DEFAULT })
}

/// Table IV: each setting's total, and what it sends. Ours: section 6.3 with fewer boxes, as crowded.
fn optimisations(runs: &[SearchCall]) -> Table {
    let columns = "setting | side | speed-up printed | total, ms | speed-up by the totals | pairs | checks | \
        bytes fetched | bytes fetched a pair | chunks";
    let mut table = Table::new("PBIG table IV: optimisations on and off, GPU", columns);
    let mut calls = runs.iter().peekable();
    for (setting, speed_up, total) in TABLE_IV {
        table.row(cells![setting, "printed", speed_up, total, TABLE_IV[0].2 / total]);
        if let Some(call) = calls.next_if(|_| has_way(setting)) {
            table.row(cells![setting, "ours", (), call.ms, runs[0].ms / call.ms, ..sent(call)]);
        }
    }
    table
}

fn sent(call: &SearchCall) -> Vec<Value> {
    let Report { pairs, checks, device: gpu, .. } = &call.report;
    let bytes = gpu.as_ref().map(|gpu| gpu.downloaded);
    let a_pair = bytes.map(|bytes| bytes as f64 / *pairs as f64);
    cells![*pairs, checks.made, bytes, a_pair, gpu.as_ref().map(|gpu| gpu.chunks)]
}
