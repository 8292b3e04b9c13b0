//! PBIG's figures 8, 9 and 11: number of boxes, size of cells, distribution. They have no printed numbers but what the text says.
//! And table IV: each optimisation on and off.

use super::OUR_GRID;
use super::model::{GAUSSIAN, GAUSSIAN_READ, Model, UNIFORM};
use super::printed::*;
use super::sides::{SearchCall, Setup, Way, effort, once, race};
use super::table_iii::{expected_checks, options_for};
use crate::UNSORTED;
use pbig_core::{Aabb, Config, Finder, Order, Report};
use pbig_gpu::GpuOptions;
use pbig_harness::prelude::*;

/// Maximum number of pairs of a call here: their list and its copy stay below 4 GB.
const MOST_PAIRS: f64 = 2e8;
/// Maximum number of boxes for PBIG's grid on one thread.
const MOST_PLAIN: usize = 1_000_000;

pub(super) fn tables(setup: &Setup) -> Result<Vec<Table>, Failure> {
    let n = setup.on_device();
    let ways =
        TABLE_IV.iter().filter(|(setting, ..)| has_way(setting)).map(|(setting, ..)| optimised(setting));
    let runs = setup.run(&ways.collect::<Vec<_>>(), &crowded(n).draw(n, 1), 1.0)?;
    Ok(vec![
        by_number("PBIG figure 8: number of boxes", &UNIFORM, "< 1000".into(), setup)?,
        by_length(setup)?,
        by_number("PBIG figure 11: distribution of boxes", &GAUSSIAN, TABLE_IV[7].2.into(), setup)?,
        optimisations(&runs),
        on_cpu(setup)?,
    ])
}

/// Measures whole calls from nothing, all boxes moved since the call before. `printed`: what the paper has for most boxes.
fn by_number(name: &str, model: &Model, printed: Value, setup: &Setup) -> Result<Table, Failure> {
    let columns = "boxes | pairs expected | pairs | off, standard deviations | ms printed | ms, our grid, CPU | \
        ms, PBIG's grid, CPU, one thread | ms, GPU";
    let mut table = Table::new(name, columns);
    for &n in setup.numbers {
        let (times, pairs) = sides(model, n, setup)?;
        let printed = if n == MOST_BOXES { printed.clone() } else { Value::Null };
        table.row(cells![n, model.pairs(n).round() as u64, pairs, model.off(n, pairs), printed, ..times]);
    }
    Ok(table)
}

/// Returns the milliseconds of each side that takes part, and the pairs.
fn sides(model: &Model, n: usize, setup: &Setup) -> Result<([Option<f64>; 3], u64), Failure> {
    let boxes = model.draw(n, 1);
    if model.pairs(n) > MOST_PAIRS {
        let (pairs, ms) = in_slabs(&boxes, (model.pairs(n) / 2e7).ceil() as usize)?;
        return Ok(([Some(ms), None, None], pairs));
    }
    let gpu = setup.for_boxes(n);
    let pbig = (n <= MOST_PLAIN).then_some(Way::Pbig(GpuOptions::DEFAULT));
    let sides = [Some(Way::Finder(UNSORTED)), pbig, gpu.map(|_| Way::Gpu(GpuOptions::DEFAULT))];
    let ways: Vec<Way> = sides.into_iter().flatten().collect();
    let raced = race(&ways, gpu, boxes, 1.0, effort(n))?;
    let mut ms = raced.iter().map(|call| call.median);
    Ok((sides.map(|side| side.and_then(|_| ms.next())), raced[0].report.pairs))
}

/// Counts pairs that are too many for one list, slab by slab: each slab searches the boxes that reach into
/// it and counts pairs whose higher lower corner is its own. Also returns the milliseconds of the searches.
fn in_slabs(boxes: &[Aabb], slabs: usize) -> Result<(u64, f64), Failure> {
    let mut corners: Vec<f32> = boxes.iter().map(|b| b.min[0]).collect();
    corners.sort_unstable_by(f32::total_cmp);
    let border = |slab: usize| corners.get(slab * corners.len() / slabs).copied().unwrap_or(f32::INFINITY);
    let mut finder = Finder::new(UNSORTED);
    let (mut pairs, mut ms) = (0, 0.0);
    for slab in 0..slabs {
        let (low, high) = (border(slab), border(slab + 1));
        let inside: Vec<Aabb> =
            boxes.iter().filter(|b| b.min[0] < high && b.max[0] >= low).copied().collect();
        let (found, time) = timed(|| finder.find(&inside));
        let corner = |id: u32| inside[id as usize].min[0];
        pairs += found?.iter().filter(|pair| corner(pair.a).max(corner(pair.b)) >= low).count() as u64;
        ms += time;
    }
    Ok((pairs, ms))
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

/// Returns the settings that can be switched on the CPU.
fn settings() -> [(&'static str, Way); 7] {
    let default = GpuOptions::DEFAULT;
    let wanted = |boxes_per_cell: f32| Way::Pbig(GpuOptions { boxes_per_cell, ..default });
    let small_cell = |small_cell: u32| Way::Pbig(GpuOptions { small_cell, ..default });
    let sorted = Way::Finder(Config { order: Order::Sorted, ..OUR_GRID });
    [
        ("PBIG's grid, equation 6, W = 32", wanted(32.0)),
        ("PBIG's grid, equation 6, W = 4", wanted(4.0)),
        ("PBIG's grid, Avril's cells of that many objects", Way::Avril),
        ("the same as the second, every cell by balanced rows", small_cell(0)),
        ("the same, every cell by Avril's mapping", small_cell(u32::MAX)),
        ("our grid, one entry a box", Way::Finder(OUR_GRID)),
        ("our grid, list sorted", sorted),
    ]
}

/// The counterpart on the CPU: which cells, which mapping, which entries. Section 6.3 as printed; PBIG's grid on one thread,
/// ours on all.
fn on_cpu(setup: &Setup) -> Result<Table, Failure> {
    let n = if setup.quick { 20_000 } else { 300_000 };
    let columns = "setting | ms | times as fast as the first | pairs | checks | unnecessary | redundant";
    let mut table = Table::new("PBIG table IV's counterpart on the CPU", columns);
    let settings = settings();
    let ways: Vec<Way> = settings.iter().map(|(_, way)| *way).collect();
    let raced = race(&ways, None, GAUSSIAN.draw(n, 1), 1.0, effort(n))?;
    for ((name, _), one) in settings.into_iter().zip(&raced) {
        let (ratio, pairs) = (raced[0].median / one.median, one.report.pairs);
        table.row(cells![name, one.median, ratio, pairs, ..one.checks()]);
    }
    Ok(table)
}

/// Section 6.4: the printed bytes of output against the pairs of the printed boxes, and of those that give table III.
pub(super) fn sizes() -> Table {
    let mut table = Table::new("what the papers print", "paper | place | quantity | value");
    let [printed, read] = [GAUSSIAN, GAUSSIAN_READ].map(|model| model.pairs(MOST_BOXES));
    let off = |pairs: f64| 100.0 * (8.0 * pairs / (GAUSSIAN_GB * 1e9) - 1.0);
    for (quantity, value) in [
        ("these off the bytes, %", off(printed)),
        ("pairs expected, by the reading of table III", read.round()),
        ("the pairs of that reading off the bytes, %", off(read)),
    ] {
        table.row(cells!["PBIG", "section 6.4", quantity, value]);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use pbig_core::oracle;

    #[test]
    fn the_printed_bytes_are_those_of_the_reading_of_table_iii() {
        let [printed, _, read] = sizes().numbers("value")[..] else { panic!("three values") };
        assert!(printed > 2.0 && read.abs() < 0.1, "{printed} {read}");
    }

    #[test]
    fn slabs_count_each_pair_once() {
        for model in [UNIFORM, GAUSSIAN] {
            let boxes = Model { lengths: [0.0, 900.0], ..model }.draw(3000, 5);
            let pairs = oracle::pairs(&boxes).len() as u64;
            for slabs in [1, 7, 50] {
                assert_eq!(in_slabs(&boxes, slabs).expect("found").0, pairs, "{slabs} slabs");
            }
        }
    }
}
