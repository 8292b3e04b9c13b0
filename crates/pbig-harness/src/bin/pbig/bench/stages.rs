//! `pbig bench stages`: ours alone, stage by stage, against what a scene can be.

use super::Outcome;
use super::measure::{Contest, Effort, medians, timed};
use super::table::Row;
use crate::output::{Failure, progress};
use pbig_core::{Aabb, BroadPhase, Config, Error, Finder, Limits, Order, ProxyFilter, Report, StageTimes};
use pbig_harness::boxes::{Wander, cubes};
use pbig_harness::chart::{Line, LogLog};
use pbig_harness::runner::{Spread, milliseconds};
use pbig_harness::study::algorithm;

/// The distance that a box moves between two frames, along each axis; edges are around 1.
const DISTANCE: f32 = 0.1;

const CONFIG: Config = Config { limits: Limits::UNLIMITED, order: Order::Unspecified, ..Config::DEFAULT };

/// Ours: the whole call, `set_many` (incremental only), and the stages of the report.
pub(super) const NAMES: [&str; 7] = ["whole", "set", "plan", "map", "check", "emit", "diff"];

pub(super) type Times = [f64; NAMES.len()];

/// From nothing in each round, or events for what has moved.
enum Way {
    Scratch(Box<Finder>),
    Events(Box<BroadPhase>),
}

/// Ours with nothing beside it.
pub(super) struct Alone {
    way: Way,
    wander: Wander,
    moved: Vec<u32>,
    times: Vec<Times>,
    /// The algorithm of each round.
    chosen: Vec<&'static str>,
}

/// The times of the rounds, and their algorithms.
pub(super) struct Measured {
    pub(super) median: Times,
    pub(super) mean: Times,
    pub(super) pairs: u64,
    /// The algorithms, and the number of rounds of each.
    pub(super) chosen: String,
}

/// Counts each name, and lists the most frequent first.
pub(super) fn counted(names: &[&'static str]) -> String {
    let mut counts: Vec<(&str, usize)> = vec![];
    for name in names {
        match counts.iter_mut().find(|(known, _)| known == name) {
            Some((_, count)) => *count += 1,
            None => counts.push((name, 1)),
        }
    }
    counts.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    counts.iter().map(|(name, count)| format!("{name} {count}")).collect::<Vec<_>>().join(", ")
}

impl Alone {
    /// From nothing in each round, a share moved by up to `distance`.
    pub(super) fn scratch(boxes: Vec<Aabb>, share: f64, distance: f32) -> Self {
        Self::new(Way::Scratch(Box::new(Finder::new(CONFIG))), boxes, share, distance)
    }

    /// Events of such moves.
    pub(super) fn events(boxes: Vec<Aabb>, share: f64, distance: f32) -> Result<Self, Failure> {
        let broad_phase = BroadPhase::new(CONFIG).map_err(|error| Failure::Input(error.to_string()))?;
        Ok(Self::new(Way::Events(Box::new(broad_phase)), boxes, share, distance))
    }

    fn new(way: Way, boxes: Vec<Aabb>, share: f64, distance: f32) -> Self {
        let moved = (0..boxes.len() as u32).collect();
        Self { way, wander: Wander::new(boxes, share, distance), moved, times: vec![], chosen: vec![] }
    }

    pub(super) fn measure(mut self, effort: Effort) -> Result<Measured, Failure> {
        medians(&mut self, effort)?;
        let times = &self.times[effort.warm_up..];
        let of = |k: usize| times.iter().map(move |times| times[k]);
        let median = std::array::from_fn(|k| Spread::of(of(k)).median);
        let mean = std::array::from_fn(|k| of(k).sum::<f64>() / times.len().max(1) as f64);
        let (pairs, chosen) = (self.report().pairs, counted(&self.chosen[effort.warm_up..]));
        Ok(Measured { median, mean, pairs, chosen })
    }

    fn report(&self) -> &Report {
        match &self.way {
            Way::Scratch(finder) => finder.report(),
            Way::Events(broad_phase) => broad_phase.report(),
        }
    }

    fn find(&mut self) -> Result<Times, Error> {
        let Self { way, wander, moved, .. } = self;
        let boxes = &wander.boxes;
        match way {
            Way::Scratch(finder) => {
                let (done, whole) = timed(|| finder.find(boxes).map(|_| ()));
                done.map(|()| in_order(whole, 0.0, &finder.report().stages))
            }
            Way::Events(broad_phase) => {
                let (done, set) =
                    timed(|| broad_phase.set_many(moved, |id| Some((boxes[id as usize], ProxyFilter::ALL))));
                done?;
                let (done, update) = timed(|| broad_phase.update().map(|_| ()));
                done.map(|()| in_order(set + update, set, &broad_phase.report().stages))
            }
        }
    }
}

fn in_order(whole: f64, set: f64, stages: &StageTimes) -> Times {
    let StageTimes { plan, map, check, emit, diff, .. } = *stages;
    let [plan, map, check, emit, diff] = [plan, map, check, emit, diff].map(milliseconds);
    [whole, set, plan, map, check, emit, diff]
}

impl Contest for Alone {
    fn sides(&self) -> usize {
        1
    }

    fn prepare(&mut self, round: usize) {
        let moved = self.wander.step(round);
        // In the first round all are new.
        if round > 0 {
            self.moved = moved;
        }
    }

    fn run(&mut self, _: usize) -> Result<f64, Failure> {
        let times = self.find().map_err(|error| Failure::Input(error.to_string()))?;
        self.times.push(times);
        self.chosen.push(algorithm(&self.report().plan));
        Ok(times[0])
    }
}

/// The varied quantity, and the boxes at each value.
struct Sweep {
    name: &'static str,
    /// Along the x axis; also in the rows' case.
    x: &'static str,
    scratch: bool,
    points: Vec<Point>,
}

impl Sweep {
    /// Medians from nothing, means of events: updates differ, and a median shows only one kind of them.
    fn shown<'a>(&self, measured: &'a Measured) -> &'a Times {
        if self.scratch { &measured.median } else { &measured.mean }
    }
}

struct Point {
    x: f64,
    boxes: usize,
    share: f64,
    spread: f64,
    pairs: f64,
}

const fn point(x: f64, boxes: usize) -> Point {
    Point { x, boxes, share: 1.0, spread: 1.0, pairs: 1.0 }
}

fn sweeps(quick: bool) -> Vec<Sweep> {
    let sizes = |most: u32| (2..=most).map(|k| 10usize.pow(k)).map(|n| point(n as f64, n)).collect();
    let n = if quick { 10_000 } else { 100_000 };
    let share = |x: f64| Point { share: x, ..point(x, n) };
    let density = |x: f64| Point { pairs: x, ..point(x, n) };
    let spread = |x: f64| Point { spread: x, ..point(x, n) };
    let shares = [0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0].map(share).into();
    let densities = || [0.01, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0].map(density).into();
    let spreads = || [1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0].map(spread).into();
    let sweep = |name, x, scratch, points| Sweep { name, x, scratch, points };
    vec![
        sweep("boxes-scratch", "boxes", true, sizes(if quick { 5 } else { 7 })),
        sweep("boxes", "boxes", false, sizes(if quick { 4 } else { 7 })),
        sweep("share", "share moved", false, shares),
        sweep("density-scratch", "pairs a box", true, densities()),
        sweep("density", "pairs a box", false, densities()),
        sweep("spread-scratch", "largest edge / smallest", true, spreads()),
        sweep("spread", "largest edge / smallest", false, spreads()),
    ]
}

pub(super) fn run(quick: bool) -> Result<Outcome, Failure> {
    let effort = Effort::new(quick);
    let sweeps = sweeps(quick);
    let bar = progress(sweeps.iter().map(|sweep| sweep.points.len()).sum(), "scenes");
    let (mut rows, mut charts) = (Vec::new(), Vec::new());
    for sweep in &sweeps {
        let mut lines = NAMES.map(|name| Line { name: name.into(), points: Vec::new() });
        for point in &sweep.points {
            let measured = at(sweep, point, effort)?;
            let times = sweep.shown(&measured);
            lines.iter_mut().zip(times).for_each(|(line, &ms)| line.points.push((point.x, ms)));
            rows.push(row(sweep, point, &measured));
            bar.inc(1);
        }
        charts.push(chart(sweep, lines.into()));
    }
    bar.finish_and_clear();
    Ok(Outcome { rows, notes: notes(), charts })
}

fn at(sweep: &Sweep, point: &Point, effort: Effort) -> Result<Measured, Failure> {
    let boxes = cubes(point.boxes, point.spread as f32, point.pairs as f32, 1);
    let alone = if sweep.scratch {
        Alone::scratch(boxes, point.share, DISTANCE)
    } else {
        Alone::events(boxes, point.share, DISTANCE)?
    };
    alone.measure(effort)
}

fn what(sweep: &Sweep) -> &'static str {
    if sweep.scratch { "from scratch" } else { "events" }
}

fn row(sweep: &Sweep, point: &Point, measured: &Measured) -> Row {
    let times = sweep.shown(measured);
    let stages = NAMES.into_iter().zip(*times).skip(1).filter(|(_, time)| *time > 0.0).collect();
    let case = format!("{}, {} {}", what(sweep), sweep.x, point.x);
    let row = Row::new(case, point.boxes, measured.pairs).ours(measured.median[0]).mean(measured.mean[0]);
    row.stages(stages).note(measured.chosen.clone())
}

/// Stages that this way does not have are left out.
fn chart(sweep: &Sweep, lines: Vec<Line>) -> LogLog {
    let used = |line: &Line| line.points.iter().any(|(_, ms)| *ms > 0.0);
    LogLog {
        name: format!("stages-{}", sweep.name),
        title: format!("{}: time by stage", what(sweep)),
        x: sweep.x,
        y: if sweep.scratch { "ms" } else { "ms, means" },
        lines: lines.into_iter().filter(used).collect(),
        exponents: true,
    }
}

fn notes() -> Vec<String> {
    vec![
        "cubes, edges around 1, about one pair a box unless that is varied; all move by up to 0.1 unless that is varied"
            .into(),
        "from scratch: `Finder` with `Order::Unspecified`; events: `BroadPhase`, `set_many` of the moved boxes (the \
         stage `set`) and `update`"
            .into(),
        "ours is a median, its mean beside it; stages from scratch are medians, stages of events and their charts are \
         means; last, the algorithms that the plan chose, each with its number of calls"
            .into(),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stages_add_up_to_at_most_the_whole_and_algorithms_are_counted() {
        let effort = Effort { warm_up: 12, rounds: 40, budget: std::time::Duration::MAX };
        let alone = Alone::events(cubes(2000, 1.0, 1.0, 1), 1.0, DISTANCE).expect("a good margin");
        let Measured { mean, pairs, chosen, .. } = alone.measure(effort).expect("measured");
        let parts: f64 = mean[1..].iter().sum();
        assert!(parts > 0.0 && parts <= mean[0] * 1.001, "{mean:?}");
        assert!(pairs > 0 && chosen.chars().any(|c| c.is_ascii_digit()), "{chosen}");
    }

    #[test]
    fn names_are_counted() {
        assert_eq!(counted(&["grid", "edit", "edit"]), "edit 2, grid 1");
        assert_eq!(counted(&[]), "");
    }
}
