//! PBIG's figures 8, 9 and 11: number of boxes, size of cells, distribution. They have no printed numbers but what the text says.

use super::density::{expected_checks, settings_for};
use super::device::{Device, on_gpu};
use super::finders::{Finders, Way};
use super::model::{Edges, Model, Place, Space};
use super::printed::{CELLS, LENGTHS, MOST_BOXES, NORMAL, SPACE, TABLE_VI, WARP};
use super::{Scale, UNSORTED, effort, once};
use crate::study::{PbigSettings, SETTINGS, with_gpu_grid};
use pbig_core::{Aabb, Finder, GpuOptions};
use pbig_harness::bench::timed;
use pbig_harness::boxes::moved;
use pbig_harness::cells;
use pbig_harness::output::Failure;
use pbig_harness::table::{Cell, Table};

/// Section 6.1 as it is printed.
const UNIFORM: Model =
    Model { space: Space::Even(SPACE), place: Place::Centre, edges: Edges::boxes(LENGTHS[0], LENGTHS[1]) };

/// Section 6.3 as it is printed.
pub(super) const GAUSSIAN: Model = Model { space: Space::Normal(NORMAL), ..UNIFORM };

/// Section 6.3 by the reading that gives table III: lower corners, lengths from 0.
pub(super) const GAUSSIAN_READ: Model =
    Model { place: Place::LowerCorner, edges: Edges::boxes(0.0, LENGTHS[1]), ..GAUSSIAN };

/// Most pairs of a call here: their list and its copy stay below 4 GB.
const MOST_PAIRS: f64 = 2e8;
/// Most boxes for PBIG's grid on one thread.
const MOST_PLAIN: usize = 1_000_000;

pub(super) fn tables(scale: &Scale, device: &Device) -> Result<Vec<Table>, Failure> {
    let gaussian_ms = TABLE_VI[7].total as f64 / 1e3;
    Ok(vec![
        by_number("PBIG figure 8: number of boxes", &UNIFORM, "< 1000".into(), scale, device)?,
        by_length(scale, device)?,
        by_number("PBIG figure 11: distribution of boxes", &GAUSSIAN, gaussian_ms.into(), scale, device)?,
    ])
}

/// Whole calls from nothing, all boxes moved since the call before. `printed`: what the paper has for most boxes.
fn by_number(
    name: &str,
    model: &Model,
    printed: Cell,
    scale: &Scale,
    device: &Device,
) -> Result<Table, Failure> {
    let columns = [
        "boxes",
        "pairs expected",
        "pairs",
        "off, standard deviations",
        "ms printed",
        "ms, our grid, CPU",
        "ms, PBIG's grid, CPU, one thread",
        "ms, GPU",
    ];
    let mut table = Table::new(name, columns);
    for &n in scale.numbers {
        let (times, pairs) = sides(model, n, device)?;
        let counts = cells![n, model.pairs(n).round() as u64, pairs, model.off(n, pairs)];
        let printed = if n == MOST_BOXES { printed.clone() } else { Cell::Nothing };
        table.row([counts, vec![printed], times.map(Cell::from).into()].concat());
    }
    Ok(table)
}

/// Returns the milliseconds of each side that takes part, and the pairs.
fn sides(model: &Model, n: usize, device: &Device) -> Result<([Option<f64>; 3], u64), Failure> {
    let boxes = model.boxes(n, 1);
    if model.pairs(n) > MOST_PAIRS {
        let (pairs, ms) = in_slabs(&boxes, (model.pairs(n) / 2e7).ceil() as usize)?;
        return Ok(([Some(ms), None, None], pairs));
    }
    let gpu = device.for_boxes(n);
    let mut takes_part: Vec<(usize, Way)> = vec![(0, UNSORTED.into())];
    takes_part.extend((n <= MOST_PLAIN).then_some((1, SETTINGS.into())));
    takes_part.extend(gpu.map(|_| (2, on_gpu(GpuOptions::DEFAULT).into())));
    let ways = takes_part.iter().map(|(_, way)| *way);
    let mut finders = Finders::new(ways, gpu, [moved(&boxes, 1.0, 2), boxes]);
    let mut times = [None; 3];
    for ((side, _), ms) in takes_part.iter().zip(finders.times(effort(n))?) {
        times[*side] = Some(ms);
    }
    Ok((times, finders.pairs()?))
}

/// Pairs that are too many for one list, counted slab by slab: each slab searches the boxes that reach into
/// it and counts pairs whose higher lower corner is its own. And the milliseconds of the searches.
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

/// Most checks of cells that are tried: about three minutes on one thread, at 9 ns each.
const MOST_CHECKS: f64 = 2e10;

/// Returns the number of calls if the first took so long: one for the longest, which would make the run too long.
fn calls(first_ms: f64) -> usize {
    if first_ms < 2000.0 {
        3
    } else if first_ms < 40_000.0 {
        2
    } else {
        1
    }
}

/// Figure 9: the lengths of the figure, and equation 6 as we use it and as the paper does. Cells that would hold less than a
/// box, which the rule does not give, or take too long, have only their expected checks.
fn by_length(scale: &Scale, device: &Device) -> Result<Table, Failure> {
    let columns = [
        "boxes",
        "cell wanted",
        "cell",
        "checks",
        "unnecessary",
        "redundant",
        "ms, PBIG's grid, CPU, one thread",
        "calls",
        "longest call / shortest",
        "cell, GPU",
        "checks, GPU",
        "ms, GPU",
    ];
    let mut table = Table::new("PBIG figure 9: size of cells", columns);
    for &n in scale.numbers.iter().filter(|n| **n >= 10_000) {
        let (boxes, mut known) = (UNIFORM.boxes(n, 1), None);
        for cell in CELLS {
            let checks = expected_checks(&UNIFORM, n, cell);
            if n as f64 * (cell / SPACE).powi(3) < 0.3 || checks > MOST_CHECKS {
                let expected = cells![n, cell.to_string(), None::<f64>, checks.round() as u64];
                table.row([expected, vec![Cell::Nothing; 8]].concat());
            } else {
                let settings = settings_for(&boxes, cell);
                table.row(cells_of(&boxes, cell.to_string(), settings, &mut known, device)?);
            }
        }
        for boxes_per_cell in [SETTINGS.boxes_per_cell, WARP as f32] {
            let settings = PbigSettings { boxes_per_cell, ..SETTINGS };
            table.row(cells_of(
                &boxes,
                format!("equation 6, W = {boxes_per_cell}"),
                settings,
                &mut known,
                device,
            )?);
        }
    }
    Ok(table)
}

/// Returns the row of some cells, in which `known` pairs must be found. The time is the median; of two the shorter.
fn cells_of(
    boxes: &[Aabb],
    wanted: String,
    settings: PbigSettings,
    known: &mut Option<u64>,
    device: &Device,
) -> Result<Vec<Cell>, Failure> {
    let first = once(settings, boxes)?;
    if *known.get_or_insert(first.pairs) != first.pairs {
        return Err(Failure::Check(format!("cells {wanted}: {} pairs, not {known:?}", first.pairs)));
    }
    let mut times = vec![first.ms];
    while times.len() < calls(first.ms) {
        times.push(once(settings, boxes)?.ms);
    }
    times.sort_by(f64::total_cmp);
    let spread = (times.len() > 1).then(|| times[times.len() - 1] / times[0]);
    let ours = cells![boxes.len(), wanted, first.cell, first.checks.made, first.checks.unnecessary];
    let times = cells![first.checks.redundant, times[(times.len() - 1) / 2], times.len(), spread];
    let config = with_gpu_grid(on_gpu(GpuOptions::DEFAULT), &settings, 0);
    let on_device = match device.run_for(config, boxes, 1.0, first.pairs)? {
        Some((ms, report)) => cells![report.plan.gpu.as_ref().map(|plan| plan.cell), report.checks.made, ms],
        None => vec![Cell::Nothing; 3],
    };
    Ok([ours, times, on_device].concat())
}

#[cfg(test)]
mod tests {
    use super::*;
    use pbig_core::oracle;

    #[test]
    fn slabs_count_each_pair_once() {
        for model in [UNIFORM, GAUSSIAN, GAUSSIAN_READ] {
            let boxes = Model { edges: Edges::boxes(0.0, 900.0), ..model }.boxes(3000, 5);
            let pairs = oracle::pairs(&boxes).len() as u64;
            for slabs in [1, 7, 50] {
                assert_eq!(in_slabs(&boxes, slabs).expect("found").0, pairs, "{slabs} slabs");
            }
        }
    }

    #[test]
    fn at_most_boxes_only_the_longest_cells_are_not_run_and_short_calls_are_repeated() {
        let is_run = |cell: &f64| expected_checks(&UNIFORM, MOST_BOXES, *cell) <= MOST_CHECKS;
        assert_eq!(CELLS.map(|cell| is_run(&cell)), [true, true, true, true, false]);
        assert_eq!([1.0, 3e3, 5e4].map(calls), [3, 2, 1]);
    }
}
