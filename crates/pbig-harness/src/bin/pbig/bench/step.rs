//! `pbig bench step`: every scene at every size, stock beside ours in each step, and every share of
//! moved boxes: where is ours slower?

use super::measure::{Effort, mean_of_medians};
use super::table::{Row, Target};
use super::{Outcome, update};
use crate::output::{Failure, progress};
use pbig_harness::boxes::BoxSet;
use pbig_harness::chart::{Line, LogLog};
use pbig_harness::runner::{Timed, milliseconds};
use pbig_harness::scenes::Scene;
use pbig_harness::world::World;
use rapier_pbig::PbigBroadPhase;
use rapier3d::prelude::*;
use std::time::{Duration, Instant};

/// A step longer than this ends the measurement of its scene.
const LONGEST: Duration = Duration::from_secs(5);

/// Never slower.
const TARGET: Option<Target> = Some(Target::Faster(1.0));

/// Both broad phases in one world, in turn: they see the same boxes in every step, with caches as cold as the
/// rest of the step leaves them, or as warm as the other has made them. The world gets our events.
struct Both {
    ours: Timed<PbigBroadPhase>,
    stock: Timed<DefaultBroadPhase>,
    ours_first: bool,
    discarded: Vec<BroadPhasePairEvent>,
}

impl BroadPhase for Both {
    fn update(
        &mut self,
        params: &IntegrationParameters,
        colliders: &ColliderSet,
        bodies: &RigidBodySet,
        modified: &[ColliderHandle],
        removed: &[ColliderHandle],
        events: &mut Vec<BroadPhasePairEvent>,
    ) {
        let Self { ours, stock, ours_first, discarded } = self;
        discarded.clear();
        if *ours_first {
            ours.update(params, colliders, bodies, modified, removed, events);
        }
        stock.update(params, colliders, bodies, modified, removed, discarded);
        if !*ours_first {
            ours.update(params, colliders, bodies, modified, removed, events);
        }
    }
}

pub(super) fn run(quick: bool) -> Result<Outcome, Failure> {
    let sizes: &[usize] = if quick { &[1, 10, 100, 1000] } else { &[1, 10, 100, 1000, 10_000, 100_000] };
    let effort = if quick {
        Effort { warm_up: 2, rounds: 40, budget: Duration::from_millis(50) }
    } else {
        Effort { warm_up: 2, rounds: 1000, budget: Duration::from_secs(4) }
    };
    let bar = progress(Scene::ALL.len() * sizes.len(), "scenes");
    let mut rows = Vec::new();
    for scene in Scene::ALL {
        for &bodies in sizes {
            rows.push(measure(scene, bodies, effort));
            bar.inc(1);
        }
    }
    bar.finish_and_clear();
    let chart = shares(quick, &mut rows)?;
    let notes = notes(&rows);
    Ok(Outcome { rows, notes, charts: vec![chart] })
}

fn notes(rows: &[Row]) -> Vec<String> {
    let ratio = |row: &&Row| row.ratio().unwrap_or(f64::MAX);
    let worst = rows.iter().min_by(|a, b| ratio(a).total_cmp(&ratio(b)));
    let worst = worst.map(|row| format!("worst: {} of {}, {:.2}x", row.case, row.boxes, ratio(&row)));
    let how = "scenes: both broad phases in one world, which ours drives; the times are all of a step's calls, \
               from the third step on, first called in every other step; the steps are those that fit into some \
               seconds";
    let moved = "uniform: as in `update`, the broad phase's call alone";
    [how.to_owned(), moved.to_owned()].into_iter().chain(worst).collect()
}

/// One scene under way.
pub(super) struct Duel {
    world: World,
    both: Both,
    /// Ours and stock's milliseconds, by step; in even steps ours is called first.
    pub(super) times: Vec<[f64; 2]>,
    too_long: bool,
}

impl Duel {
    /// Runs a scene for as many steps as the effort allows.
    pub(super) fn run(scene: Scene, bodies: usize, effort: Effort) -> Self {
        let (ours, stock) = (Timed::new(PbigBroadPhase::new()), Timed::new(DefaultBroadPhase::new()));
        let both = Both { ours, stock, ours_first: false, discarded: vec![] };
        let mut duel = Self { world: scene.build(bodies, 1), both, times: vec![], too_long: false };
        let start = Instant::now();
        while !duel.is_done(effort, start.elapsed()) {
            duel.step();
        }
        duel
    }

    fn step(&mut self) {
        let both = &mut self.both;
        both.ours_first = self.times.len().is_multiple_of(2);
        let clock = Instant::now();
        self.world.step(both);
        self.too_long = clock.elapsed() > LONGEST;
        self.times.push([both.ours.take(), both.stock.take()].map(milliseconds));
    }

    fn is_done(&self, effort: Effort, elapsed: Duration) -> bool {
        let counted = self.times.len().saturating_sub(effort.warm_up);
        counted >= effort.rounds
            || (counted >= 6 && elapsed > effort.budget)
            || (counted >= 2 && self.too_long)
    }

    /// Returns the pairs that ours has now.
    pub(super) fn pairs(&self) -> u64 {
        self.both.ours.inner.pair_count() as u64
    }

    /// Returns the median of ours and of stock from a step on: the mean of the medians of even and odd steps.
    fn medians(&self, from: usize) -> [f64; 2] {
        [0, 1].map(|side| {
            let of = |parity: usize| -> Vec<f64> {
                let steps = self.times.iter().enumerate().skip(from);
                steps.filter(|(step, _)| step % 2 == parity).map(|(_, ms)| ms[side]).collect()
            };
            mean_of_medians([of(0), of(1)].iter().map(Vec::as_slice))
        })
    }
}

/// One scene at one size.
fn measure(scene: Scene, bodies: usize, effort: Effort) -> Row {
    let duel = Duel::run(scene, bodies, effort);
    let [ours, stock] = duel.medians(effort.warm_up);
    let case = format!("{}, {bodies} bodies", scene.name);
    let row = Row::new(case, duel.world.colliders.len(), duel.pairs()).ours(ours).against("stock", stock);
    let cut = if duel.too_long { ", the last over 5 s" } else { "" };
    row.target(TARGET).note(format!("{} steps{cut}", duel.times.len() - effort.warm_up))
}

/// Shares of the uniform set that move; the largest size as a chart.
fn shares(quick: bool, rows: &mut Vec<Row>) -> Result<LogLog, Failure> {
    let sizes: &[usize] = if quick { &[100, 1000] } else { &[10, 100, 1000, 10_000, 100_000] };
    let effort =
        Effort { budget: Duration::from_millis(if quick { 50 } else { 2000 }), ..Effort::new(quick) };
    let mut lines = ["ours", "stock"].map(|name| Line { name: name.into(), points: vec![] });
    for &n in sizes {
        let boxes = BoxSet::named("uniform").expect("a set of the harness").boxes(n, 1);
        for share in [0.001, 0.01, 0.03, 0.1, 0.3, 1.0].into_iter().filter(|share| share * n as f64 >= 1.0) {
            let (ours, stock, pairs) = update::shares(&boxes, share, effort)?;
            let row = Row::new(format!("uniform, {}% moved", share * 100.0), n, pairs);
            rows.push(row.ours(ours).against("stock", stock).target(TARGET));
            if Some(&n) == sizes.last() {
                lines.iter_mut().zip([ours, stock]).for_each(|(line, ms)| line.points.push((share, ms)));
            }
        }
    }
    let title = format!("a call through rapier, uniform, {} boxes", sizes.last().unwrap_or(&0));
    let (name, lines) = ("step-share".into(), lines.into());
    Ok(LogLog { name, title, x: "share moved", y: "ms", lines, exponents: true })
}
