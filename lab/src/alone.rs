//! Pbig alone, stage by stage.

use crate::UNSORTED;
use pbig_core::{Aabb, BroadPhase, Finder, ProxyFilter};
use pbig_harness::prelude::*;
use std::collections::BTreeMap;

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
    let mean = std::array::from_fn(|k| of(k).sum::<f64>() / rounds.len().max(1) as f64);
    let mut counts = BTreeMap::<_, usize>::new();
    rounds.iter().for_each(|(_, name)| *counts.entry(*name).or_default() += 1);
    let chosen: Vec<String> = counts.iter().map(|(name, count)| format!("{name} {count}")).collect();
    Ok(Measured { mean, pairs: alone.report().pairs, chosen: chosen.join(", ") })
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
