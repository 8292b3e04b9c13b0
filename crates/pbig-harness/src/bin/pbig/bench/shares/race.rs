//! Ways to events through the same frames.

use super::super::measure::{Contest, Effort, Took, measured, timed};
use crate::output::Failure;
use pbig_core::plan::{Chosen, Plan};
use pbig_core::{
    Aabb, BroadPhase, Config, Error, Events, Finder, Limits, Order, Pair, ProxyFilter, Strategy, Study,
    Updates,
};
use pbig_harness::boxes::Wander;
use std::cmp::Ordering;

const CONFIG: Config = Config { limits: Limits::UNLIMITED, order: Order::Sorted, ..Config::DEFAULT };

/// The ways, in the order of a race; in a row the first is ours.
pub(super) const NAMES: [&str; 6] =
    ["as planned", "edits", "grid anew", "near pairs", "from scratch and diff", "PBIG's grid"];
pub(super) const MEANS: [&str; 6] = [
    "as planned, mean",
    "edits, mean",
    "grid anew, mean",
    "near pairs, mean",
    "from scratch and diff, mean",
    "PBIG's grid, mean",
];

/// Those that `BroadPhase` chooses from.
pub(super) const ASKED: std::ops::Range<usize> = 1..4;

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
    /// In the order of [`NAMES`]; PBIG's grid, which takes ten times as long as the others, only if wanted.
    fn all(with_pbig: bool) -> Result<Vec<Self>, Error> {
        let by = |updates| Config { study: Study { updates, ..Study::DEFAULT }, ..CONFIG };
        let of = |config| BroadPhase::new(config).map(Box::new).map(Self::Events);
        let asked = [Updates::Auto, Updates::Edits, Updates::Anew, Updates::Near];
        let mut all = asked.map(|updates| of(by(updates))).into_iter().collect::<Result<Vec<_>, _>>()?;
        let finder = Box::new(Finder::new(CONFIG));
        all.push(Self::Scratch { finder, before: vec![], events: Events::default() });
        if with_pbig {
            all.push(of(Config { strategy: Strategy::Pbig, ..CONFIG })?);
        }
        Ok(all)
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

    fn plan(&self) -> &Plan {
        match self {
            Self::Events(broad_phase) => &broad_phase.report().plan,
            Self::Scratch { finder, .. } => &finder.report().plan,
        }
    }
}

/// Whether an update has gone the way of that name: edits and lists cannot do each.
fn is_taken(side: usize, plan: &Plan) -> bool {
    match NAMES[side] {
        "edits" => plan.chosen == Chosen::Edit,
        "grid anew" => plan.chosen == Chosen::Grid && plan.near.is_none(),
        "near pairs" => plan.near.is_some(),
        _ => true,
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
pub(super) struct Race {
    ways: Vec<Way>,
    wander: Wander,
    moved: Vec<u32>,
    /// Events of each way so far.
    pub(super) events: Vec<[usize; 2]>,
    /// Of each way: what the plan chose, and whether it was the way asked for, round by round.
    pub(super) chosen: Vec<Vec<&'static str>>,
    taken: Vec<Vec<bool>>,
}

impl Race {
    pub(super) fn new(boxes: Vec<Aabb>, share: f64, distance: f32, with_pbig: bool) -> Result<Self, Failure> {
        let ways = Way::all(with_pbig).map_err(|error| Failure::Input(error.to_string()))?;
        let moved = (0..boxes.len() as u32).collect();
        let (wander, sides) = (Wander::new(boxes, share, distance), ways.len());
        let (chosen, taken) = (vec![vec![]; sides], vec![vec![]; sides]);
        Ok(Self { ways, wander, moved, events: vec![[0; 2]; sides], chosen, taken })
    }

    /// What each way took; none for one that less than half of the rounds went.
    pub(super) fn run_all(&mut self, effort: Effort) -> Result<Vec<Option<Took>>, Failure> {
        let took = measured(self, effort)?;
        let is_taken = |side: usize| {
            let counted = self.taken[side].get(effort.warm_up..).unwrap_or(&[]);
            2 * counted.iter().filter(|taken| **taken).count() >= counted.len()
        };
        Ok(took.into_iter().enumerate().map(|(side, took)| is_taken(side).then_some(took)).collect())
    }

    /// The pairs of all; an error where they do not have the same pairs and events in number.
    pub(super) fn pairs(&self) -> Result<u64, Failure> {
        let pairs: Vec<usize> = self.ways.iter().map(Way::pairs).collect();
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
        self.chosen[side].push(way.plan().chosen.name());
        self.taken[side].push(is_taken(side, way.plan()));
        Ok(ms)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pbig_harness::boxes::cubes;
    use std::time::Duration;

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
    fn all_ways_have_the_same_events_and_those_that_cannot_be_taken_have_no_times() {
        // Moves within cells by a few, and jumps of all, for which there is neither an edit nor a list.
        for (share, distance, taken) in
            [(0.1, 0.1, [true; 6]), (1.0, 3.0, [true, false, true, false, true, true])]
        {
            let mut race = Race::new(cubes(1500, 1.0, 1.0, 1), share, distance, true).expect("a good margin");
            let effort = Effort { warm_up: 2, rounds: 8, budget: Duration::MAX };
            let took = race.run_all(effort).expect("measured");
            assert!(race.pairs().expect("all agree") > 0 && race.events[0][1] > 0);
            assert_eq!(took.iter().map(Option::is_some).collect::<Vec<_>>(), taken, "{:?}", race.chosen);
        }
    }
}
