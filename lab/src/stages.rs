//! Pbig alone, stage by stage, against what a scene can be: cubes with edges around 1 and about one pair a box that all move by up
//! to 0.1, unless that is varied.

use crate::UNSORTED;
use pbig_core::{Aabb, BroadPhase, Finder, ProxyFilter};
use pbig_harness::prelude::*;
use std::collections::BTreeMap;

/// Distance of a move along each axis at most.
const DISTANCE: f32 = 0.1;

/// The whole call, `set_many` (incremental only), and the stages of the report.
pub(crate) const NAMES: [&str; 7] = ["whole", "set", "plan", "map", "check", "emit", "diff"];

type Times = [f64; NAMES.len()];

/// Pbig with nothing beside it.
struct Alone {
    finder: Finder,
    /// Makes events for what has moved; without it each round is a search from nothing.
    broad_phase: Option<BroadPhase>,
    wander: Wander,
    moved: Vec<u32>,
    /// Times and algorithm of each round.
    rounds: Vec<(Times, &'static str)>,
}

/// The times of the rounds, and their algorithms.
pub(crate) struct Measured {
    median: Times,
    pub(crate) mean: Times,
    pub(crate) pairs: u64,
    /// The algorithms, and the number of rounds of each.
    pub(crate) chosen: String,
}

/// Measures searches from nothing, or with `events` the events, if a share moves by up to `distance`.
pub(crate) fn alone(
    events: bool,
    boxes: Vec<Aabb>,
    (share, distance): (f64, f32),
    effort: Effort,
) -> Result<Measured, Failure> {
    let (finder, moved) = (Finder::new(UNSORTED), (0..boxes.len() as u32).collect());
    let broad_phase = events.then(|| BroadPhase::new(UNSORTED)).transpose()?;
    let wander = Wander::new(boxes, share, distance);
    let mut alone = Alone { finder, broad_phase, wander, moved, rounds: vec![] };
    measured(&mut alone, 1, effort, Alone::prepare, |alone, _| alone.find())?;
    let rounds = &alone.rounds[effort.warm_up..];
    let of = |k: usize| rounds.iter().map(move |(times, _)| times[k]);
    let median = std::array::from_fn(|k| Spread::of(of(k)).median);
    let mean = std::array::from_fn(|k| of(k).sum::<f64>() / rounds.len().max(1) as f64);
    let mut counts = BTreeMap::<_, usize>::new();
    rounds.iter().for_each(|(_, name)| *counts.entry(*name).or_default() += 1);
    let chosen: Vec<String> = counts.iter().map(|(name, count)| format!("{name} {count}")).collect();
    Ok(Measured { median, mean, pairs: alone.report().pairs, chosen: chosen.join(", ") })
}

impl Alone {
    fn prepare(&mut self, round: usize) {
        let moved = self.wander.step(round);
        // In the first round all are new.
        if round > 0 {
            self.moved = moved;
        }
    }

    fn report(&self) -> &pbig_core::Report {
        self.broad_phase.as_ref().map_or_else(|| self.finder.report(), BroadPhase::report)
    }

    fn find(&mut self) -> Result<f64, Failure> {
        let boxes = &self.wander.boxes;
        let mut set = 0.0;
        let (done, ms) = match &mut self.broad_phase {
            None => timed(|| self.finder.find(boxes).map(|_| ())),
            Some(broad_phase) => {
                let of = |id: u32| Some((boxes[id as usize], ProxyFilter::ALL));
                let (done, ms) = timed(|| broad_phase.set_many(&self.moved, of));
                done?;
                set = ms;
                timed(|| broad_phase.update().map(|_| ()))
            }
        };
        done?;
        let (whole, report) = (set + ms, self.report());
        let [plan, map, check, emit, diff] = report.stages.named().map(|(_, time)| milliseconds(time));
        let algorithm = report.plan.algorithm.name();
        self.rounds.push(([whole, set, plan, map, check, emit, diff], algorithm));
        Ok(whole)
    }
}

/// The quantity that is varied, its value, the number of boxes, and their share that moves, spread of sizes and pairs a box.
type Point = (&'static str, f64, usize, [f64; 3]);

/// Returns the points of each varied quantity; `scratch`: of searches from nothing.
fn points(scratch: bool, quick: bool) -> impl Iterator<Item = Point> {
    let (n, most) = if quick { (10_000, if scratch { 5 } else { 4 }) } else { (100_000, 7) };
    let sizes = (2..=most).map(|k| ("boxes", 10f64.powi(k), 10usize.pow(k as u32), [1.0; 3]));
    let vary = move |what: &'static str, place: usize, values: [f64; 7]| {
        values.map(|x| (what, x, n, std::array::from_fn(|k| if k == place { x } else { 1.0 })))
    };
    let shares = vary("share moved", 0, [0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0]);
    let densities = vary("pairs a box", 2, [0.01, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0]);
    let spreads = vary("largest edge / smallest", 1, [1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0]);
    let shares = shares.into_iter().filter(move |_| !scratch);
    sizes.chain(shares).chain(densities).chain(spreads)
}

/// Measures all points. Stages are medians from nothing and means of events: updates differ, and a median shows only one kind
/// of them.
pub fn run(quick: bool) -> Result<Report, Failure> {
    let effort = Effort::new(quick);
    let columns = "case | boxes | pairs | median_ms | mean_ms | set_ms | plan_ms | map_ms | check_ms | emit_ms | diff_ms | \
        algorithms";
    let mut tables = vec![];
    for (name, scratch) in [("from scratch", true), ("events", false)] {
        let mut table = Table::new(name, columns);
        for (what, x, n, [share, spread, pairs]) in tracked(points(scratch, quick), "scenes") {
            let boxes = cubes(n, spread as f32, pairs as f32, 1);
            let Measured { median, mean, pairs, chosen } = alone(!scratch, boxes, (share, DISTANCE), effort)?;
            let stages = if scratch { &median } else { &mean }[1..].iter();
            let stages = stages.map(|&ms| (ms > 0.0).then_some(ms));
            table.row(cells![format!("{what} {x}"), n, pairs, median[0], mean[0], ..stages, chosen]);
        }
        tables.push(table);
    }
    Ok(Report::new("stages", tables))
}
