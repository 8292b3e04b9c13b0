//! Pbig beside parry's tree and obvhs: the same boxes, in turn. Pair counts are compared in every case.
//!
//! Events: `set_many` of the boxes that moved and `update`; parry keeps its tree and gives all pairs (1% moved: those with a moved
//! box), no events. Not counted for the others: turning boxes into theirs, and the list of updates for parry's parallel frame.

use crate::UNSORTED;
use crate::trees::{Changed, Kept, Obvhs, Parry, Refit, for_parry, parry_rebuilt, partition};
use pbig_core::{Aabb, Finder};
use pbig_harness::prelude::*;

/// Returns the distance that a box of a set moves between two frames, along each axis. Settled boxes hardly move.
fn distance(set: &str) -> f32 {
    if set == "pile" { 0.02 } else { 0.1 }
}

/// A set of boxes, and how many.
type PeerCase = (&'static str, usize);

const LARGE: [PeerCase; 4] = [("unit", 100_000), ("unit", 1_000_000), ("mixed", 100_000), ("pile", 100_000)];
const SMALL: [PeerCase; 3] = [("unit", 10_000), ("mixed", 10_000), ("pile", 10_000)];

/// The share of boxes that swing to and fro; none: all drift, on and on.
type MovedShare = Option<f64>;

/// Measures all cases. Fails if the sides have different numbers of pairs.
pub fn run(quick: bool) -> Result<BenchReport, Failure> {
    let (effort, mut table) = (Effort::new(quick), Table::new("peers", COMPARED));
    let cases: &[PeerCase] = if quick { &SMALL } else { &LARGE };
    let drift: &[PeerCase] = if quick { &[] } else { &[LARGE[0], LARGE[3]] };
    let parts = if quick { &SMALL[..1] } else { &LARGE[..2] };
    for (what, motion, cases) in [
        ("events, all moved", Some(1.0), cases),
        ("events, all drift", None, drift),
        ("events, 1% moved", Some(0.01), parts),
    ] {
        tracked(cases, what).try_for_each(|case| frames(what, *case, motion, effort, &mut table))?;
    }
    tracked(cases, "from scratch").try_for_each(|case| from_scratch(*case, effort, &mut table))?;
    Ok(BenchReport::new("peers", vec![table]))
}

fn named((set, boxes): PeerCase) -> Vec<Aabb> {
    BoxSet::named(set).expect("a set of the harness").boxes(boxes, 1)
}

fn agree(name: &str, ours: usize, others: &[usize]) -> Result<u64, Failure> {
    let is_equal = others.iter().all(|&other| other == ours);
    check(is_equal, || format!("{name}: {ours} pairs, the others have {others:?}")).map(|()| ours as u64)
}

/// Pbig and parry's trees through the same frames.
struct PeerFrames {
    wander: Wander,
    changed: Changed,
    ours: Kept,
    trees: Vec<Parry>,
}

impl PeerFrames {
    fn prepare(&mut self, round: usize) {
        let moved = self.wander.step(round);
        self.trees.iter_mut().for_each(|tree| tree.prepare(&self.wander.boxes, &moved));
        self.changed = partition(&self.wander.boxes, &moved);
    }

    fn run(&mut self, side: usize) -> Result<f64, Failure> {
        match side {
            0 | 1 => self.ours.update(side, &self.wander.boxes, &self.changed),
            _ => Ok(timed(|| self.trees[side - 2].frame()).1),
        }
    }
}

/// Parry's trees: of frames in which few move, and of others.
const REFITS: [(&str, Refit); 3] = [
    ("parry 0.31, changed pairs", Refit::Changed),
    ("parry 0.31, one thread", Refit::Whole),
    ("parry 0.31, all threads", Refit::Parallel),
];

/// Measures a case frame by frame.
fn frames(
    what: &str,
    case: PeerCase,
    motion: MovedShare,
    effort: Effort,
    table: &mut Table,
) -> Result<(), Failure> {
    let (name, boxes) = (format!("{what}, {}", case.0), named(case));
    let is_partial = motion.is_some_and(|share| share < 1.0);
    let refits = if is_partial { &REFITS[..1] } else { &REFITS[1..] };
    let trees: Vec<Parry> = refits.iter().map(|(_, refit)| Parry::new(&boxes, *refit)).collect();
    let sides = 2 + trees.len();
    let wander = match motion {
        Some(share) => Wander::new(boxes, share, distance(case.0)),
        None => Wander::drifting(boxes, distance(case.0)),
    };
    let changed = ((0..case.1 as u32).collect(), vec![]);
    let mut state = PeerFrames { wander, changed, ours: Kept::new(UNSORTED)?, trees };
    for side in [0, 1] {
        state.run(side)?;
    }
    let times = measured(&mut state, sides, effort, PeerFrames::prepare, PeerFrames::run)?;
    let PeerFrames { ours, mut trees, .. } = state;
    let [all, lone] = ours.pairs();
    let theirs: Vec<usize> = trees.iter_mut().map(Parry::all_pairs).collect();
    let pairs = agree(&name, all, &[vec![lone], theirs].concat())?;
    for ((tree, _), &theirs) in refits.iter().zip(&times[2..]) {
        table.row(compared(&name, case.1, pairs, MS, times[0], (tree, theirs)));
    }
    let alone = format!("{name}, ours on one thread");
    table.row(compared(&alone, case.1, pairs, MS, times[1], (refits[0].0, times[2])));
    Ok(())
}

/// Measures all pairs from nothing, of boxes that are elsewhere in each round.
fn from_scratch(case: PeerCase, effort: Effort, table: &mut Table) -> Result<(), Failure> {
    let name = format!("from scratch, {}", case.0);
    let (mut ours, mut found, mut pairs) = (Finder::new(UNSORTED), vec![], [0; 3]);
    let wander = Wander::new(named(case), 1.0, distance(case.0));
    let mut state = (wander, vec![], Obvhs::default());
    let prepare = |(wander, parry, obvhs): &mut (Wander, Vec<_>, Obvhs), round| {
        wander.step(round);
        *parry = wander.boxes.iter().map(for_parry).collect();
        obvhs.prepare(&wander.boxes);
    };
    let times = measured(&mut state, 3, effort, prepare, |(wander, parry, obvhs), side| {
        let (count, ms) = match side {
            0 => timed(|| ours.find(&wander.boxes).map(<[_]>::len)),
            1 => timed(|| Ok(parry_rebuilt(parry, &mut found))),
            _ => timed(|| Ok(obvhs.rebuilt(&mut found))),
        };
        pairs[side] = count?;
        Ok(ms)
    })?;
    let pairs = agree(&name, pairs[0], &pairs[1..])?;
    for (other, theirs) in [("parry 0.31 rebuilt", times[1]), ("obvhs 0.4 ploc", times[2])] {
        table.row(compared(&name, case.1, pairs, MS, times[0], (other, theirs)));
    }
    Ok(())
}
