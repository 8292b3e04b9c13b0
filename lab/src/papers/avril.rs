//! Avril's tables 6 and 7, with figures 4 and 5: steps, brute force and a grid.

use super::OUR_GRID;
use super::printed::*;
use super::sides::{Setup, Way, effort, race};
use crate::UNSORTED;
use pbig_core::{Backend, BroadPhase, Config, Finder, ProxyFilter};
use pbig_harness::gpu_race;
use pbig_harness::prelude::*;

/// The distance that cubes with edges of 1 move in a step, along each axis.
const DISTANCE: f32 = 0.1;

pub(super) fn tables(setup: &Setup) -> Result<Vec<Table>, Failure> {
    Ok(vec![brute_force_and_grid()?, steps(setup)?])
}

const BRUTE: Way = Way::Finder(Config { backend: Backend::Brute, ..UNSORTED });

/// Figure 4, brute force by number of objects, and table 7, with and without a grid: whole calls from nothing, all moved.
fn brute_force_and_grid() -> Result<Table, Failure> {
    let columns = "objects | pairs | ms, CPU: brute force | ms, CPU: our grid | ms, CPU: Avril's cells, one thread | \
        ms printed: without grid | ms printed: with grid";
    let mut table = Table::new("Avril figure 4 and table 7: brute force, with and without a grid", columns);
    for n in [100usize, 500, 1000, 2500, 5000, 10_000] {
        let ways = [BRUTE, Way::Finder(OUR_GRID), Way::Avril];
        let cpu = race(&ways, None, cubes(n, 1.0, 1.0, 1), DISTANCE, effort(n))?;
        let ms = cpu.iter().map(|call| call.median);
        let printed = AVRIL_7.iter().find(|row| row.0 == n);
        let printed = [printed.map(|row| row.1), printed.map(|row| row.2)];
        table.row(cells![n, cpu[0].report.pairs, ..ms, ..printed]);
    }
    Ok(table)
}

/// Table 6 and figure 5: a step in which all move. Ours: cubes with a pair each that move by up to a tenth of
/// their edge: `BroadPhase::set_many`, then `update`, events included, beside a search from nothing; on the CPU means, on a
/// device medians of a few updates.
fn steps(setup: &Setup) -> Result<Table, Failure> {
    let mut table = Table::new("Avril table 6 and figure 5: a step", "objects | side | pairs | whole, ms");
    let most = if setup.quick { 100_000 } else { usize::MAX };
    for (n, printed) in AVRIL_6.into_iter().filter(|(n, _)| *n <= most) {
        table.row(cells![n, "printed", (), printed]);
        let boxes = || cubes(n, 1.0, 1.0, 1);
        let (pairs, ms) = step(Wander::new(boxes(), 1.0, DISTANCE), Effort::new(setup.quick))?;
        for (side, ms) in ["ours, CPU", "ours, CPU, from nothing"].into_iter().zip(ms) {
            table.row(cells![n, side, pairs, ms.mean]);
        }
        if let Some(gpu) = setup.for_boxes(n) {
            let raced = gpu_race::race(gpu, boxes(), 1.0, DISTANCE)?;
            table.row(cells![n, "ours, GPU", raced.pairs, raced.ms[1]]);
        }
    }
    Ok(table)
}

/// Measures an update, and a search from nothing, in turn. Returns the pairs, too.
fn step(wander: Wander, effort: Effort) -> Result<(usize, Vec<Took>), Failure> {
    let (mut finder, mut broad_phase) = (Finder::new(UNSORTED), BroadPhase::new(UNSORTED)?);
    let all: Vec<u32> = (0..wander.boxes.len() as u32).collect();
    let prepare = |(wander, moved): &mut (Wander, Vec<u32>), round| {
        let now = wander.step(round);
        // In the first round all are new.
        if round > 0 {
            *moved = now;
        }
    };
    let took = measured(&mut (wander, all), 2, effort, prepare, |(wander, moved), side| {
        let of = |id: u32| Some((wander.boxes[id as usize], ProxyFilter::ALL));
        let (done, ms) = timed(|| match side {
            0 => broad_phase.set_many(moved, of).and_then(|()| broad_phase.update().map(|_| ())),
            _ => finder.find(&wander.boxes).map(|_| ()),
        });
        Ok(done.map(|()| ms)?)
    })?;
    check(broad_phase.pair_count() == finder.pairs().len(), || "an update and a search differ".into())?;
    Ok((finder.pairs().len(), took))
}
