//! Avril's tables 6 and 7, with figures 4 and 5: steps, brute force and a grid.

use super::OUR_GRID;
use super::printed::*;
use super::sides::{ON_GPU, Setup, Way, effort, race};
use crate::UNSORTED;
use pbig_core::{Backend, BroadPhase, Config, Finder, ProxyFilter};
use pbig_harness::motions::{Density, Motion, MovingBoxes};
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
        let boxes = BoxSet::named("unit").expect("a set of the harness").boxes(n, 1);
        let ways = [BRUTE, Way::Finder(OUR_GRID), Way::Avril];
        let cpu = race(&ways, None, boxes, DISTANCE, effort(n))?;
        let ms = cpu.iter().map(|call| call.median);
        let printed = AVRIL_7.iter().find(|row| row.0 == n);
        let printed = [printed.map(|row| row.1), printed.map(|row| row.2)];
        table.row(cells![n, cpu[0].report.pairs, ..ms, ..printed]);
    }
    Ok(table)
}

/// The sides of a step.
const SIDES: [&str; 3] = ["ours, CPU", "ours, CPU, from nothing", "ours, GPU"];

/// Table 6 and figure 5: a step in which all move. Ours: cubes with a pair each that move by up to a tenth of their edge:
/// `BroadPhase::set_many`, then `update`, events included, beside a search from nothing; means.
fn steps(setup: &Setup) -> Result<Table, Failure> {
    let mut table = Table::new("Avril table 6 and figure 5: a step", "objects | side | pairs | whole, ms");
    let most = if setup.quick { 100_000 } else { usize::MAX };
    for (n, printed) in AVRIL_6.into_iter().filter(|(n, _)| *n <= most) {
        table.row(cells![n, "printed", (), printed]);
        let (pairs, times) = step(n, setup)?;
        for (side, took) in SIDES.into_iter().zip(times) {
            table.row(cells![n, side, pairs, took.mean]);
        }
    }
    Ok(table)
}

/// Measures an update, a search from nothing, and an update on the device, if there is one for this number, in turn. Returns the pairs,
/// too.
fn step(n: usize, setup: &Setup) -> Result<(usize, Vec<Took>), Failure> {
    let mut finder = Finder::new(UNSORTED);
    let mut kept = vec![BroadPhase::new(UNSORTED)?];
    if let Some(gpu) = setup.for_boxes(n) {
        kept.push(BroadPhase::with_device(ON_GPU, Box::new(gpu.clone()))?);
    }
    // In the first round all are new.
    let mut state = (MovingBoxes::new(Motion::Swing, Density::Sparse, n, 1), (0..n as u32).collect());
    let prepare = |(moving, moved): &mut (MovingBoxes, Vec<u32>), round| {
        if round > 0 {
            moved.clear();
            moved.extend(moving.step());
        }
    };
    let took =
        measured(&mut state, 1 + kept.len(), Effort::new(setup.quick), prepare, |(moving, moved), side| {
            let of = |id: u32| Some((moving.boxes()[id as usize], ProxyFilter::ALL));
            let (done, ms) = timed(|| match side {
                1 => finder.find(moving.boxes()).map(|_| ()),
                _ => kept[side / 2].set_many(moved, of).and_then(|()| kept[side / 2].update().map(|_| ())),
            });
            Ok(done.map(|()| ms)?)
        })?;
    for one in &kept {
        let fallback = one.report().fallback.clone();
        check(fallback.is_none(), || fallback.unwrap_or_default())?;
        check(one.pair_count() == finder.pairs().len(), || "an update and a search differ".into())?;
    }
    Ok((finder.pairs().len(), took))
}
