//! Pbig alone beside parry's newer tree and obvhs: the same boxes, in turn. Pair counts are compared in every case.
//!
//! Events: `set_many` of the boxes that moved and `update`; parry keeps its tree and gives all pairs (1% moved: those with a moved
//! box), no events. Not counted for the others: turning boxes into theirs, and the list of updates for parry's parallel frame.

use crate::trees::{Obvhs, Parry, Refit, for_parry, parry_rebuilt};
use pbig_core::{Aabb, BroadPhase, Config, Finder, Limits, Order, ProxyFilter};
use pbig_harness::bench::{COMPARED, Contest, Effort, MS, Took, compared, measured, timed};
use pbig_harness::boxes::{BoxSet, Wander};
use pbig_harness::output::{Failure, progress};
use pbig_harness::report::Report;
use pbig_harness::table::Table;
use rayon::{ThreadPool, ThreadPoolBuilder};

/// Returns the distance that a box of a set moves between two frames, along each axis. Settled boxes hardly move.
fn distance(set: &str) -> f32 {
    if set == "pile" { 0.02 } else { 0.1 }
}

/// Unlimited, as the others know no limits.
const CONFIG: Config = Config { limits: Limits::UNLIMITED, order: Order::Unspecified, ..Config::DEFAULT };

/// A set of boxes, and how many.
type Case = (&'static str, usize);

const LARGE: [Case; 4] = [("unit", 100_000), ("unit", 1_000_000), ("mixed", 100_000), ("pile", 100_000)];
const SMALL: [Case; 3] = [("unit", 10_000), ("mixed", 10_000), ("pile", 10_000)];

/// The motion of boxes.
#[derive(Clone, Copy)]
enum Motion {
    /// A share of them, to and fro.
    Swing(f64),
    /// All, on and on.
    Drift,
}

/// Measures all cases.
///
/// # Errors
/// A failed check, if the sides have different numbers of pairs.
pub fn run(quick: bool) -> Result<Report, Failure> {
    let (effort, mut table) = (Effort::new(quick), Table::new("peers", COMPARED));
    let cases: &[Case] = if quick { &SMALL } else { &LARGE };
    let drift: &[Case] = if quick { &[] } else { &[LARGE[0], LARGE[3]] };
    let parts = if quick { &SMALL[..1] } else { &LARGE[..2] };
    let bar = progress(2 * cases.len() + drift.len() + parts.len(), "cases");
    for (what, motion, cases) in [
        ("events, all moved", Motion::Swing(1.0), cases),
        ("events, all drift", Motion::Drift, drift),
        ("events, 1% moved", Motion::Swing(0.01), parts),
    ] {
        for &case in cases {
            frames(what, case, motion, effort, &mut table)?;
            bar.inc(1);
        }
    }
    for &case in cases {
        from_scratch(case, effort, &mut table)?;
        bar.inc(1);
    }
    bar.finish_and_clear();
    mixed_beside_unit("events, all moved", &mut table);
    mixed_beside_unit("from scratch", &mut table);
    Ok(Report::new("peers", vec![table]))
}

fn named((set, boxes): Case) -> Vec<Aabb> {
    BoxSet::named(set).expect("a set of the harness").boxes(boxes, 1)
}

/// Pbig and parry's trees through the same frames.
struct Frames {
    wander: Wander,
    moved: Vec<u32>,
    ours: BroadPhase,
    /// Ours once more, on one thread.
    lone: BroadPhase,
    pool: ThreadPool,
    trees: Vec<Parry>,
}

impl Frames {
    fn new(case: Case, motion: Motion) -> Result<Self, Failure> {
        let boxes = named(case);
        let share = if let Motion::Swing(share) = motion { share } else { 1.0 };
        let refits = if share < 1.0 { [Refit::Whole, Refit::Part] } else { [Refit::Whole, Refit::Parallel] };
        let pool = ThreadPoolBuilder::new().num_threads(1).build();
        let mut frames = Self {
            moved: (0..boxes.len() as u32).collect(),
            ours: BroadPhase::new(CONFIG)?,
            lone: BroadPhase::new(CONFIG)?,
            pool: pool.map_err(|error| Failure::Input(error.to_string()))?,
            trees: refits.map(|refit| Parry::new(&boxes, refit, share < 1.0)).into(),
            wander: match motion {
                Motion::Swing(share) => Wander::new(boxes, share, distance(case.0)),
                Motion::Drift => Wander::drifting(boxes, distance(case.0)),
            },
        };
        update(&mut frames.ours, &frames.wander.boxes, &frames.moved)?;
        update(&mut frames.lone, &frames.wander.boxes, &frames.moved)?;
        Ok(frames)
    }

    /// Returns the pairs, of which all sides must have as many.
    fn pairs(&mut self, name: &str) -> Result<u64, Failure> {
        let mut others: Vec<usize> = self.trees.iter_mut().map(Parry::all_pairs).collect();
        others.push(self.lone.pair_count());
        agree(name, self.ours.pair_count(), &others)
    }
}

fn agree(name: &str, ours: usize, others: &[usize]) -> Result<u64, Failure> {
    if others.iter().all(|&other| other == ours) {
        return Ok(ours as u64);
    }
    Err(Failure::Check(format!("{name}: {ours} pairs, the others have {others:?}")))
}

fn update(broad_phase: &mut BroadPhase, boxes: &[Aabb], moved: &[u32]) -> Result<(), Failure> {
    broad_phase.set_many(moved, |id| Some((boxes[id as usize], ProxyFilter::ALL)))?;
    Ok(broad_phase.update().map(|_| ())?)
}

impl Contest for Frames {
    fn sides(&self) -> usize {
        2 + self.trees.len()
    }

    fn prepare(&mut self, round: usize) {
        self.moved = self.wander.step(round);
        self.trees.iter_mut().for_each(|tree| tree.prepare(&self.wander.boxes, &self.moved));
    }

    fn run(&mut self, side: usize) -> Result<f64, Failure> {
        let Self { wander, moved, ours, lone, pool, trees } = self;
        let boxes = &wander.boxes;
        let (done, time) = match side {
            0 => timed(|| update(ours, boxes, moved)),
            1 => timed(|| pool.install(|| update(lone, boxes, moved))),
            other => timed(|| {
                trees[other - 2].frame();
                Ok(())
            }),
        };
        done.map(|()| time)
    }
}

fn frames(what: &str, case: Case, motion: Motion, effort: Effort, table: &mut Table) -> Result<(), Failure> {
    let name = format!("{what}, {}", case.0);
    let mut frames = Frames::new(case, motion)?;
    let times = measured(&mut frames, effort)?;
    let pairs = frames.pairs(&name)?;
    for (tree, &theirs) in frames.trees.iter().zip(&times[2..]) {
        table.row(compared(&name, case.1, pairs, MS, times[0], (tree.name(), theirs)));
    }
    let alone = format!("{name}, ours on one thread");
    table.row(compared(&alone, case.1, pairs, MS, times[1], (frames.trees[0].name(), times[2])));
    Ok(())
}

/// All pairs from nothing, of boxes that are elsewhere in each round.
struct Scratch {
    wander: Wander,
    for_parry: Vec<parry_peer::bounding_volume::Aabb>,
    ours: Finder,
    obvhs: Obvhs,
    /// Number of pairs that each side found last.
    pairs: [usize; 3],
    found: Vec<(u32, u32)>,
}

impl Contest for Scratch {
    fn sides(&self) -> usize {
        3
    }

    fn prepare(&mut self, round: usize) {
        self.wander.step(round);
        self.for_parry = for_parry(&self.wander.boxes);
        self.obvhs.prepare(&self.wander.boxes);
    }

    fn run(&mut self, side: usize) -> Result<f64, Failure> {
        let Self { wander, for_parry, ours, obvhs, found, .. } = self;
        let (pairs, time) = match side {
            0 => timed(|| ours.find(&wander.boxes).map(<[_]>::len)),
            1 => timed(|| Ok(parry_rebuilt(for_parry, found))),
            _ => timed(|| Ok(obvhs.rebuilt(found))),
        };
        self.pairs[side] = pairs?;
        Ok(time)
    }
}

fn from_scratch(case: Case, effort: Effort, table: &mut Table) -> Result<(), Failure> {
    let name = format!("from scratch, {}", case.0);
    let (ours, obvhs) = (Finder::new(CONFIG), Obvhs::default());
    let wander = Wander::new(named(case), 1.0, distance(case.0));
    let mut scratch = Scratch { wander, for_parry: vec![], ours, obvhs, pairs: [0; 3], found: vec![] };
    let times = measured(&mut scratch, effort)?;
    let pairs = agree(&name, scratch.pairs[0], &scratch.pairs[1..])?;
    for (other, theirs) in [("parry 0.31 rebuilt", times[1]), ("obvhs 0.4 ploc", times[2])] {
        table.row(compared(&name, case.1, pairs, MS, times[0], (other, theirs)));
    }
    Ok(())
}

/// Appends pbig's cost of a box or pair of the set of many sizes, beside that of the set of one.
fn mixed_beside_unit(what: &str, table: &mut Table) {
    let of = |set: &str| {
        let row = table.rows.iter().find(|row| row[0].text() == format!("{what}, {set}"))?;
        let number = |k: usize| row[k].number();
        let count = number(1)? + number(2)?;
        Some((count, number(2)? as u64, Took { median: number(4)? / count, mean: number(5)? / count }))
    };
    if let Some((mixed, unit)) = of("mixed").zip(of("unit")) {
        let boxes = (mixed.0 - mixed.1 as f64) as usize;
        let case = format!("{what}, mixed, per box and pair");
        table.row(compared(&case, boxes, mixed.1, ("ns", 1e6), mixed.2, ("unit", unit.2)));
    }
}
