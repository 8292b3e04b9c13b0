//! Avril's table 6 and figures 5 and 6: steps with everything and with a part in motion.
//!
//! Ours: cubes with a pair each that move by up to a tenth of their edge: `BroadPhase::set_many`, then `update`, events included.
//! Times on the CPU are means, those on a device medians of a few updates with the same events as on the CPU.

use super::Scale;
use super::device::Device;
use super::printed::AVRIL_6;
use crate::stages::{Alone, Measured, NAMES};
use pbig_harness::bench::Effort;
use pbig_harness::boxes::cubes;
use pbig_harness::cells;
use pbig_harness::gpu_race::race;
use pbig_harness::output::Failure;
use pbig_harness::table::{Cell, Table};

/// The distance that cubes with edges of 1 move in a step, along each axis.
pub(super) const DISTANCE: f32 = 0.1;

pub(super) fn tables(scale: &Scale, device: &Device) -> Result<Vec<Table>, Failure> {
    Ok(vec![steps(scale, device)?, movers(scale, device)?])
}

/// Table 6 and figure 5: a step in which all move.
fn steps(scale: &Scale, device: &Device) -> Result<Table, Failure> {
    let columns = [
        "objects",
        "side",
        "pairs",
        "boxes up to date, ms",
        "grid (ours: plan and map), ms",
        "search (ours: check, emit, diff), ms",
        "whole, ms",
        "updates",
    ];
    let mut table = Table::new("Avril table 6 and figure 5: a step, all moving", columns);
    for (n, printed) in AVRIL_6.into_iter().filter(|(n, _)| !scale.quick || *n <= 100_000) {
        table.row(
            [cells![n, "printed", None::<u64>], printed.map(Cell::from).into(), vec![Cell::Nothing]].concat(),
        );
        let boxes = || cubes(n, 1.0, 1.0, 1);
        let ours = Alone::events(boxes(), 1.0, DISTANCE)?.measure(Effort::new(scale.quick))?;
        table.row(row(n, &ours));
        if let Some(gpu) = device.for_boxes(n) {
            let raced = race(gpu, boxes(), 1.0, DISTANCE)?;
            let times = [vec![Cell::Nothing; 3], cells![raced.ms[1]], vec![Cell::Nothing]].concat();
            table.row([cells![n, "ours, GPU", raced.pairs], times].concat());
        }
    }
    Ok(table)
}

fn row(n: usize, ours: &Measured) -> Vec<Cell> {
    let of = |wanted: &[&str]| {
        NAMES.iter().zip(ours.mean).filter(|(name, _)| wanted.contains(name)).map(|(_, ms)| ms).sum::<f64>()
    };
    let (map, search) = (of(&["plan", "map"]), of(&["check", "emit", "diff"]));
    cells![n, "ours, CPU", ours.pairs, of(&["set"]), map, search, ours.mean[0], &ours.chosen]
}

/// Figure 6: a step in which a share moves. A program that plays a device has fewer boxes.
fn movers(scale: &Scale, device: &Device) -> Result<Table, Failure> {
    let n = if scale.quick { 10_000 } else { 100_000 };
    let columns = [
        "share moved",
        "boxes",
        "pairs",
        "ms, events",
        "ms, from nothing",
        "updates",
        "boxes, GPU",
        "ms, events, GPU",
        "ms, events, CPU with as many",
    ];
    let mut table = Table::new("Avril figure 6: share of moving objects", columns);
    let fewer = if device.for_boxes(n).is_some() { n } else { n.min(10_000) };
    for share in [0.01, 0.1, 0.25, 0.5, 0.75, 1.0] {
        let (boxes, effort) = (|n| cubes(n, 1.0, 1.0, 1), Effort::new(scale.quick));
        let events = Alone::events(boxes(n), share, DISTANCE)?.measure(effort)?;
        let scratch = Alone::scratch(boxes(n), share, DISTANCE).measure(effort)?;
        let ours = cells![share, n, events.pairs, events.mean[0], scratch.mean[0], &events.chosen];
        let beside = match device.for_boxes(fewer) {
            Some(gpu) => {
                let [cpu, gpu] = race(gpu, boxes(fewer), share, DISTANCE)?.ms;
                cells![fewer, gpu, cpu]
            }
            None => vec![Cell::Nothing; 3],
        };
        table.row([ours, beside].concat());
    }
    Ok(table)
}
