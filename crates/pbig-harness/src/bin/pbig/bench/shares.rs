//! Part of `pbig bench stages`: events by the share that moves, by each way that a caller can ask for; where each wins.

use super::measure::{Contest, Effort, Took, measured, timed};
use super::stages::counted;
use super::table::Row;
use crate::output::{Failure, progress};
use pbig_core::{
    Aabb, BroadPhase, Config, Error, Events, Finder, Limits, Order, Pair, ProxyFilter, Strategy,
};
use pbig_harness::boxes::{Wander, cubes};
use pbig_harness::chart::{Line, LogLog};
use std::cmp::Ordering;
use std::time::Duration;

/// How far boxes go, along each axis, in edges: a part of one, or so far that near pairs would be too many for a list.
const MOTIONS: [(&str, f32); 2] = [("small moves", 0.1), ("jumps", 3.0)];

const SHARES: [f64; 8] = [0.01, 0.03, 0.1, 0.15, 0.2, 0.3, 0.5, 1.0];

/// The ways; in a row the first is ours.
const NAMES: [&str; 3] = ["as planned", "PBIG's grid", "from scratch and diff"];
const MEANS: [&str; 3] = ["as planned, mean", "PBIG's grid, mean", "from scratch and diff, mean"];

const CONFIG: Config = Config { limits: Limits::UNLIMITED, order: Order::Sorted, ..Config::DEFAULT };

/// One way to events.
enum Way {
    Events(Box<BroadPhase>),
    /// Two lists of all pairs, one after the other.
    Scratch {
        finder: Box<Finder>,
        before: Vec<Pair>,
        events: Events,
    },
}

impl Way {
    fn all() -> Result<[Self; 3], Error> {
        let of = |strategy| BroadPhase::new(Config { strategy, ..CONFIG }).map(Box::new).map(Self::Events);
        let finder = Box::new(Finder::new(CONFIG));
        let scratch = Self::Scratch { finder, before: vec![], events: Events::default() };
        Ok([of(Strategy::Auto)?, of(Strategy::Pbig)?, scratch])
    }

    /// How many pairs came and went.
    fn update(&mut self, boxes: &[Aabb], moved: &[u32]) -> Result<[usize; 2], Error> {
        let events = match self {
            Self::Events(broad_phase) => {
                let fetch = |id: u32| boxes[id as usize];
                broad_phase.set_many(moved, fetch, |aabb| Some((aabb, ProxyFilter::ALL)))?;
                broad_phase.update()?
            }
            Self::Scratch { finder, before, events } => {
                let now = finder.find(boxes)?;
                difference(before, now, events);
                before.clear();
                before.extend_from_slice(now);
                events
            }
        };
        Ok([events.added.len(), events.removed.len()])
    }

    fn pairs(&self) -> usize {
        match self {
            Self::Events(broad_phase) => broad_phase.pair_count(),
            Self::Scratch { before, .. } => before.len(),
        }
    }
}

/// What is in one of two sorted lists only.
fn difference(before: &[Pair], now: &[Pair], events: &mut Events) {
    let Events { added, removed } = events;
    added.clear();
    removed.clear();
    let (mut i, mut j) = (0, 0);
    while i < before.len() && j < now.len() {
        let order = before[i].cmp(&now[j]);
        if order == Ordering::Less {
            removed.push(before[i]);
        }
        if order == Ordering::Greater {
            added.push(now[j]);
        }
        i += usize::from(order != Ordering::Greater);
        j += usize::from(order != Ordering::Less);
    }
    removed.extend_from_slice(&before[i..]);
    added.extend_from_slice(&now[j..]);
}

/// All ways through the same frames.
struct Race {
    ways: [Way; 3],
    wander: Wander,
    moved: Vec<u32>,
    /// Events of each way so far.
    events: [[usize; 2]; 3],
    /// What the plan of the first chose, round by round.
    chosen: Vec<&'static str>,
}

impl Race {
    fn new(boxes: Vec<Aabb>, share: f64, distance: f32) -> Result<Self, Failure> {
        let ways = Way::all().map_err(|error| Failure::Input(error.to_string()))?;
        let moved = (0..boxes.len() as u32).collect();
        let wander = Wander::new(boxes, share, distance);
        Ok(Self { ways, wander, moved, events: [[0; 2]; 3], chosen: vec![] })
    }

    /// The pairs of all; an error where they do not have the same pairs and events in number.
    fn pairs(&self) -> Result<u64, Failure> {
        let pairs = self.ways.each_ref().map(Way::pairs);
        let alike = pairs.iter().all(|&count| count == pairs[0])
            && self.events.iter().all(|&events| events == self.events[0]);
        let differ = || format!("ways to events differ: {pairs:?} pairs, {:?} events", self.events);
        if alike { Ok(pairs[0] as u64) } else { Err(Failure::Check(differ())) }
    }
}

impl Contest for Race {
    fn sides(&self) -> usize {
        self.ways.len()
    }

    fn prepare(&mut self, round: usize) {
        let moved = self.wander.step(round);
        // In the first round all are new.
        if round > 0 {
            self.moved = moved;
        }
    }

    fn run(&mut self, side: usize) -> Result<f64, Failure> {
        let (way, boxes) = (&mut self.ways[side], &self.wander.boxes);
        let (done, ms) = timed(|| way.update(boxes, &self.moved));
        let [added, removed] = done.map_err(|error| Failure::Input(error.to_string()))?;
        self.events[side][0] += added;
        self.events[side][1] += removed;
        if let (0, Way::Events(broad_phase)) = (side, way) {
            self.chosen.push(broad_phase.report().plan.chosen.name());
        }
        Ok(ms)
    }
}

/// Rows and a chart for each motion, and in words where each way wins.
pub(super) fn run(
    quick: bool,
    rows: &mut Vec<Row>,
    charts: &mut Vec<LogLog>,
) -> Result<Vec<String>, Failure> {
    let n = if quick { 5000 } else { 100_000 };
    let shares = if quick { &SHARES[5..] } else { &SHARES[..] };
    let effort =
        Effort { budget: Duration::from_millis(if quick { 100 } else { 2500 }), ..Effort::new(quick) };
    let bar = progress(MOTIONS.len() * shares.len(), "shares");
    let mut notes = vec![about()];
    for motion in MOTIONS {
        let mut took = Vec::new();
        for &share in shares {
            let mut race = Race::new(cubes(n, 1.0, 1.0, 1), share, motion.1)?;
            let sides = measured(&mut race, effort)?;
            rows.push(row(motion.0, share, n, &race, &sides, effort)?);
            took.push((share, sides));
            bar.inc(1);
        }
        notes.push(winners(motion.0, &took));
        charts.push(chart(motion.0, n, &took));
    }
    bar.finish_and_clear();
    Ok(notes)
}

fn about() -> String {
    let [small, jumps] = MOTIONS.map(|(name, distance)| format!("{name} are of up to {distance} edges"));
    format!(
        "events by share: {small}, {jumps}. Ours is `BroadPhase` as planned; beside it `BroadPhase` with \
         `Strategy::Pbig`, and `Finder` with sorted lists of which one is merged with the one before. Edits, a grid \
         built anew and a list of near pairs cannot be asked for: what the plan chose in how many updates comes last \
         (`Strategy::Grid` is the same from 1025 boxes on, where there is no bitmap). Pairs and events of all were \
         compared in number, and agree"
    )
}

fn row(
    motion: &str,
    share: f64,
    boxes: usize,
    race: &Race,
    sides: &[Took],
    effort: Effort,
) -> Result<Row, Failure> {
    let others = sides.iter().enumerate().skip(1);
    let stages = others.flat_map(|(k, took)| [(NAMES[k], took.median), (MEANS[k], took.mean)]).collect();
    let row = Row::new(format!("events by share, {motion}, {}% moved", share * 100.0), boxes, race.pairs()?);
    let chosen = counted(race.chosen.get(effort.warm_up..).unwrap_or(&[]));
    Ok(row.ours(sides[0].median).mean(sides[0].mean).stages(stages).note(chosen))
}

/// Which way takes least at which shares, by the means.
fn winners(motion: &str, took: &[(f64, Vec<Took>)]) -> String {
    let best = |sides: &[Took]| (0..sides.len()).min_by(|&a, &b| sides[a].mean.total_cmp(&sides[b].mean));
    let of = |k: usize| {
        let won = took.iter().filter(|(_, sides)| best(sides) == Some(k));
        let shares: Vec<String> = won.map(|(share, _)| format!("{}%", share * 100.0)).collect();
        (!shares.is_empty()).then(|| format!("{} at {}", NAMES[k], shares.join(", ")))
    };
    let won: Vec<String> = (0..NAMES.len()).filter_map(of).collect();
    format!("events by share, {motion}: least by the mean: {}", won.join("; "))
}

fn chart(motion: &str, boxes: usize, took: &[(f64, Vec<Took>)]) -> LogLog {
    let line = |name: &str, of: &dyn Fn(&[Took]) -> f64| {
        let points = took.iter().map(|(share, sides)| (*share, of(sides))).collect();
        Line { name: name.into(), points }
    };
    let means = (0..NAMES.len()).map(|k| line(MEANS[k], &|sides| sides[k].mean));
    LogLog {
        name: format!("stages-events-{}", motion.replace(' ', "-")),
        title: format!("events of {boxes} boxes, {motion}: where each way wins"),
        x: "share moved",
        y: "ms",
        lines: means.chain([line("as planned, median", &|sides| sides[0].median)]).collect(),
        exponents: true,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_difference_is_what_one_list_has_alone() {
        let pairs = |list: &[(u32, u32)]| list.iter().map(|&(a, b)| Pair::new(a, b)).collect::<Vec<_>>();
        let mut events = Events::default();
        difference(&pairs(&[(0, 1), (1, 2), (3, 4)]), &pairs(&[(0, 2), (1, 2), (5, 6)]), &mut events);
        assert_eq!(events.removed, pairs(&[(0, 1), (3, 4)]));
        assert_eq!(events.added, pairs(&[(0, 2), (5, 6)]));
        difference(&[], &pairs(&[(0, 2)]), &mut events);
        assert_eq!((events.removed.len(), events.added.len()), (0, 1));
    }

    #[test]
    fn all_ways_have_the_same_events() {
        for (_, distance) in MOTIONS {
            let mut race = Race::new(cubes(1500, 1.0, 1.0, 1), 0.3, distance).expect("a good margin");
            let effort = Effort { warm_up: 2, rounds: 8, budget: Duration::MAX };
            measured(&mut race, effort).expect("measured");
            assert!(race.pairs().expect("all agree") > 0 && race.events[0][1] > 0);
        }
    }

    #[test]
    fn winners_are_named_by_their_means() {
        let took = |median, mean| Took { median, mean };
        let sides = |first| vec![took(1.0, first), took(9.0, 9.0), took(2.0, 3.0)];
        let text = winners("jumps", &[(0.01, sides(1.0)), (0.5, sides(4.0)), (1.0, sides(5.0))]);
        assert!(text.ends_with("as planned at 1%; from scratch and diff at 50%, 100%"), "{text}");
    }
}
