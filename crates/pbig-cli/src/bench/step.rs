//! `pbig bench step`: every scene at every size, stock beside ours in each step, without and with a ray, and every share of
//! moved boxes.

use super::update;
use pbig_harness::duel::Duel;
use pbig_harness::frames::FrameKind;
use pbig_harness::prelude::*;
use pbig_harness::scenes::Scene;
use std::time::Duration;

pub(super) fn run(quick: bool) -> Result<Report, Failure> {
    let mut table = Table::new("step", "case | boxes | pairs | steps | pbig_ms | stock_ms | stock_over_pbig");
    let sizes: &[usize] = if quick { &[1, 10, 100, 1000] } else { &[1, 10, 100, 1000, 10_000, 100_000] };
    scenes(quick, sizes, FrameKind::None, "", &mut table);
    let sizes: &[usize] = if quick { &[100] } else { &[1000, 10_000] };
    scenes(quick, sizes, FrameKind::Ray, ", one ray a frame", &mut table);
    shares(quick, &mut table)?;
    Ok(Report::new("step", vec![table]))
}

/// Appends the medians of every scene at some sizes: the broad phase's call and the scene queries. `name` says which queries.
fn scenes(quick: bool, sizes: &[usize], kind: FrameKind, name: &str, table: &mut Table) {
    let (rounds, budget) = if quick { (40, 50) } else { (1000, 4000) };
    let effort = Effort { warm_up: 2, rounds, budget: Duration::from_millis(budget) };
    let cases = Scene::ALL.into_iter().flat_map(|scene| sizes.iter().map(move |bodies| (scene, *bodies)));
    for (scene, bodies) in tracked(cases, "scenes") {
        let duel = Duel::run(scene, bodies, kind, effort);
        let [ours, stock] = duel.medians(effort.warm_up);
        let (case, boxes) = (format!("{}, {bodies} bodies{name}", scene.name), duel.world.colliders.len());
        let steps = duel.times.len() - effort.warm_up;
        table.row(cells![case, boxes, duel.pairs(), steps, ours, stock, stock.max(1e-9) / ours.max(1e-9)]);
    }
}

/// Appends the medians of shares of the uniform set that move: the broad phase's call alone.
fn shares(quick: bool, table: &mut Table) -> Result<(), Failure> {
    let sizes: &[usize] = if quick { &[100, 1000] } else { &[10, 100, 1000, 10_000, 100_000] };
    let budget = Duration::from_millis(if quick { 50 } else { 2000 });
    let effort = Effort { budget, ..Effort::new(quick) };
    for &n in sizes {
        let boxes = BoxSet::named("uniform").expect("a set of the harness").boxes(n, 1);
        for share in [0.001, 0.01, 0.03, 0.1, 0.3, 1.0].into_iter().filter(|share| share * n as f64 >= 1.0) {
            let (ours, stock, pairs) = update::shares(&boxes, share, effort)?;
            let case = format!("uniform, {}% moved", share * 100.0);
            table.row(cells![case, n, pairs, None::<u64>, ours, stock, stock / ours.max(1e-9)]);
        }
    }
    Ok(())
}
