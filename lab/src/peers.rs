//! Pbig beside parry's tree and obvhs: the same boxes, in turn. Pair counts are compared in every case.
//!
//! Events: `set_many` of the boxes that moved and `update`; parry keeps its tree and gives all pairs (1% moved: those with a moved
//! box), no events. Not counted for the others: turning boxes into theirs, and the list of updates for parry's parallel frame.

use crate::UNSORTED;
use crate::trees::{Changed, Kept, Obvhs, Parry, Refit, for_parry, parry_rebuilt, partition};
use pbig_core::Finder;
use pbig_harness::motions::{Density, Motion, MovingBoxes};
use pbig_harness::prelude::*;

/// Boxes, and how many.
type PeerCase = (Density, usize);

const LARGE: [PeerCase; 4] = [
    (Density::Sparse, 100_000),
    (Density::Sparse, 1_000_000),
    (Density::Mixed, 100_000),
    (Density::Dense, 100_000),
];
const SMALL: [PeerCase; 3] = [(Density::Sparse, 10_000), (Density::Mixed, 10_000), (Density::Dense, 10_000)];

/// Measures all cases. Fails if the sides have different numbers of pairs.
pub fn run(quick: bool) -> Result<BenchReport, Failure> {
    let (effort, mut table) = (Effort::new(quick), Table::new("peers", COMPARED));
    let cases: &[PeerCase] = if quick { &SMALL } else { &LARGE };
    let parts = &cases[..if quick { 1 } else { 2 }];
    for (what, motion, cases) in [
        ("events, all moved", Motion::Swing, cases),
        ("events, all drift", Motion::Drift, &parts[..1]),
        ("events, 1% moved", Motion::Few, parts),
    ] {
        tracked(cases, what).try_for_each(|case| frames(what, *case, motion, effort, &mut table))?;
    }
    tracked(cases, "from scratch").try_for_each(|case| from_scratch(*case, effort, &mut table))?;
    Ok(BenchReport::new("peers", vec![table]))
}

/// Returns the name of a case. Sparse boxes are those of the set `unit`.
fn named(what: &str, density: Density) -> String {
    format!("{what}, {}", if density == Density::Sparse { "unit" } else { density.name() })
}

fn agree(name: &str, ours: usize, others: &[usize]) -> Result<u64, Failure> {
    let is_equal = others.iter().all(|&other| other == ours);
    check(is_equal, || format!("{name}: {ours} pairs, the others have {others:?}")).map(|()| ours as u64)
}

/// Pbig and parry's trees through the same frames.
struct PeerFrames {
    boxes: MovingBoxes,
    changed: Changed,
    ours: Kept,
    trees: Vec<Parry>,
}

impl PeerFrames {
    fn prepare(&mut self, _: usize) {
        let moved = self.boxes.step().to_vec();
        self.trees.iter_mut().for_each(|tree| tree.prepare(self.boxes.boxes(), &moved));
        self.changed = partition(self.boxes.boxes(), &moved);
    }

    fn run(&mut self, side: usize) -> Result<f64, Failure> {
        match side {
            0 | 1 => self.ours.update(side, self.boxes.boxes(), &self.changed),
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
    (density, n): PeerCase,
    motion: Motion,
    effort: Effort,
    table: &mut Table,
) -> Result<(), Failure> {
    let (name, boxes) = (named(what, density), MovingBoxes::new(motion, density, n, 1));
    let refits = if motion == Motion::Few { &REFITS[..1] } else { &REFITS[1..] };
    let trees: Vec<Parry> = refits.iter().map(|(_, refit)| Parry::new(boxes.boxes(), *refit)).collect();
    let sides = 2 + trees.len();
    let changed = ((0..n as u32).collect(), vec![]);
    let mut state = PeerFrames { boxes, changed, ours: Kept::new(UNSORTED)?, trees };
    for side in [0, 1] {
        state.run(side)?;
    }
    let times = measured(&mut state, sides, effort, PeerFrames::prepare, PeerFrames::run)?;
    let PeerFrames { ours, mut trees, .. } = state;
    let [all, lone] = ours.pairs();
    let theirs: Vec<usize> = trees.iter_mut().map(Parry::all_pairs).collect();
    let pairs = agree(&name, all, &[vec![lone], theirs].concat())?;
    for ((tree, _), &theirs) in refits.iter().zip(&times[2..]) {
        table.row(compared(&name, n, pairs, MS, times[0], (tree, theirs)));
    }
    let alone = format!("{name}, ours on one thread");
    table.row(compared(&alone, n, pairs, MS, times[1], (refits[0].0, times[2])));
    Ok(())
}

/// Measures all pairs from nothing, of boxes that are elsewhere in each round.
fn from_scratch((density, n): PeerCase, effort: Effort, table: &mut Table) -> Result<(), Failure> {
    let name = named("from scratch", density);
    let (mut ours, mut found, mut pairs) = (Finder::new(UNSORTED), vec![], [0; 3]);
    let mut state = (MovingBoxes::new(Motion::Swing, density, n, 1), vec![], Obvhs::default());
    let prepare = |(moving, parry, obvhs): &mut (MovingBoxes, Vec<_>, Obvhs), _| {
        moving.step();
        *parry = moving.boxes().iter().map(for_parry).collect();
        obvhs.prepare(moving.boxes());
    };
    let times = measured(&mut state, 3, effort, prepare, |(moving, parry, obvhs), side| {
        let (count, ms) = match side {
            0 => timed(|| ours.find(moving.boxes()).map(<[_]>::len)),
            1 => timed(|| Ok(parry_rebuilt(parry, &mut found))),
            _ => timed(|| Ok(obvhs.rebuilt(&mut found))),
        };
        pairs[side] = count?;
        Ok(ms)
    })?;
    let pairs = agree(&name, pairs[0], &pairs[1..])?;
    for (other, theirs) in [("parry 0.31 rebuilt", times[1]), ("obvhs 0.4 ploc", times[2])] {
        table.row(compared(&name, n, pairs, MS, times[0], (other, theirs)));
    }
    Ok(())
}
