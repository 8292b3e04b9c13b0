//! `pbig bench peers`: the finder alone beside parry's newer tree and obvhs, same boxes, in turn.

pub(super) mod trees;

use super::Outcome;
use super::measure::{Contest, Effort, measured, medians, timed};
use super::table::{Row, Target, Unit};
use crate::output::{Failure, progress};
use pbig_core::{Aabb, BroadPhase, Config, Finder, Limits, Order, ProxyFilter};
use pbig_harness::boxes::{BoxSet, Wander};
use rayon::{ThreadPool, ThreadPoolBuilder};
use trees::{Obvhs, Parry, Refit, parry_rebuilt};

/// Returns the distance that a box of a set moves between two frames, along each axis. Settled boxes hardly move.
fn distance(set: &str) -> f32 {
    if set == "pile" { 0.02 } else { 0.1 }
}

/// Unlimited, as the others know no limits.
const CONFIG: Config = Config { limits: Limits::UNLIMITED, order: Order::Unspecified, ..Config::DEFAULT };

/// A set of boxes at a size, and its targets in the order of the sides that they are about.
struct Case {
    set: &'static str,
    boxes: usize,
    targets: &'static [f64],
}

const fn case(set: &'static str, boxes: usize, targets: &'static [f64]) -> Case {
    Case { set, boxes, targets }
}

/// All moved: against parry on one thread, and on all.
const FRAMES: [Case; 4] = [
    case("unit", 100_000, &[7.0, 4.0]),
    case("unit", 1_000_000, &[7.0, 4.0]),
    case("mixed", 100_000, &[6.0, 3.0]),
    case("pile", 100_000, &[8.0, 4.0]),
];

/// All drift, and none returns: the same, without targets.
const DRIFT: [Case; 2] = [case("unit", 100_000, &[]), case("pile", 100_000, &[])];

/// 1% moved: against both of parry's ways to refit a part.
const PARTS: [Case; 2] = [case("unit", 100_000, &[10.0, 10.0]), case("unit", 1_000_000, &[20.0, 20.0])];

/// From nothing: against parry, and obvhs.
const SCRATCH: [Case; 4] = [
    case("unit", 100_000, &[20.0, 10.0]),
    case("unit", 1_000_000, &[20.0, 10.0]),
    case("mixed", 100_000, &[10.0]),
    case("pile", 100_000, &[20.0]),
];

const SMALL: [Case; 3] = [case("unit", 10_000, &[]), case("mixed", 10_000, &[]), case("pile", 10_000, &[])];

pub(super) fn run(quick: bool) -> Result<Outcome, Failure> {
    let effort = Effort::new(quick);
    let (frames, drift, parts, scratch): (&[Case], &[Case], &[Case], &[Case]) =
        if quick { (&SMALL, &[], &SMALL[..1], &SMALL) } else { (&FRAMES, &DRIFT, &PARTS, &SCRATCH) };
    let bar = progress(frames.len() + drift.len() + parts.len() + scratch.len(), "cases");
    let mut rows = Vec::new();
    let all_moved =
        [("events, all moved", Motion::Swing(1.0), frames), ("events, all drift", Motion::Drift, drift)];
    for (what, motion, cases) in
        all_moved.into_iter().chain([("events, 1% moved", Motion::Swing(0.01), parts)])
    {
        for case in cases {
            rows.extend(frame_rows(what, case, motion, effort)?);
            bar.inc(1);
        }
    }
    for case in scratch {
        rows.extend(scratch_rows(case, effort)?);
        bar.inc(1);
    }
    bar.finish_and_clear();
    let sizes: Vec<Row> = ["events, all moved", "from scratch"]
        .into_iter()
        .filter_map(|what| sizes_row(what, &rows, quick))
        .collect();
    rows.extend(sizes);
    Ok(Outcome { rows, notes: notes(), charts: vec![] })
}

fn notes() -> Vec<String> {
    vec![
        "events: `set_many` of the boxes that moved and `update`; parry 0.31 keeps its tree and gives all pairs (1% \
         moved: those with a moved box), no events; ours runs on all threads where a row does not say otherwise"
            .into(),
        "boxes that move go to and fro, by up to 0.1 on each axis (pile: 0.02); those that drift go on, as far in \
         each frame"
            .into(),
        "x and the targets are about medians; the means, beside, have their part of work that one frame does for many"
            .into(),
        "not counted for the others: turning boxes into theirs, and the list of updates for parry's parallel frame"
            .into(),
        "pair counts were compared in every case, and agree".into(),
    ]
}

/// The motion of boxes.
#[derive(Clone, Copy)]
enum Motion {
    /// A share of them, to and fro.
    Swing(f64),
    /// All, on and on.
    Drift,
}

/// Ours and parry's trees through the same frames.
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
    fn new(case: &Case, motion: Motion) -> Result<Self, Failure> {
        let boxes = named(case);
        let share = if let Motion::Swing(share) = motion { share } else { 1.0 };
        let refits: &[Refit] =
            if share < 1.0 { &[Refit::Whole, Refit::Part] } else { &[Refit::Whole, Refit::Parallel] };
        let empty = || BroadPhase::new(CONFIG).map_err(|error| Failure::Input(error.to_string()));
        let pool = ThreadPoolBuilder::new().num_threads(1).build();
        let mut frames = Self {
            moved: (0..boxes.len() as u32).collect(),
            ours: empty()?,
            lone: empty()?,
            pool: pool.map_err(|error| Failure::Input(error.to_string()))?,
            trees: refits.iter().map(|&refit| Parry::new(&boxes, refit, share < 1.0)).collect(),
            wander: match motion {
                Motion::Swing(share) => Wander::new(boxes, share, distance(case.set)),
                Motion::Drift => Wander::drifting(boxes, distance(case.set)),
            },
        };
        update(&mut frames.ours, &frames.wander.boxes, &frames.moved)?;
        update(&mut frames.lone, &frames.wander.boxes, &frames.moved)?;
        Ok(frames)
    }

    /// Once per case, after the last round: all have the same pairs.
    fn check(&mut self, name: &str) -> Result<u64, Failure> {
        let ours = self.ours.pair_count();
        let mut others: Vec<usize> = self.trees.iter_mut().map(Parry::all_pairs).collect();
        others.push(self.lone.pair_count());
        agree(name, ours, &others)
    }
}

fn agree(name: &str, ours: usize, others: &[usize]) -> Result<u64, Failure> {
    if others.iter().all(|&other| other == ours) {
        return Ok(ours as u64);
    }
    Err(Failure::Check(format!("{name}: {ours} pairs, the others have {others:?}")))
}

fn update(broad_phase: &mut BroadPhase, boxes: &[Aabb], moved: &[u32]) -> Result<(), Failure> {
    let set = broad_phase.set_many(moved, |id| Some((boxes[id as usize], ProxyFilter::ALL)));
    let done = set.and_then(|()| broad_phase.update().map(|_| ()));
    done.map_err(|error| Failure::Input(error.to_string()))
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

fn frame_rows(what: &str, case: &Case, motion: Motion, effort: Effort) -> Result<Vec<Row>, Failure> {
    let name = format!("{what}, {}", case.set);
    let mut frames = Frames::new(case, motion)?;
    let times = measured(&mut frames, effort)?;
    let pairs = frames.check(&name)?;
    let row = |name: &str| Row::new(name, case.boxes, pairs);
    let mut rows: Vec<Row> = frames
        .trees
        .iter()
        .enumerate()
        .map(|(i, tree)| {
            let target = case.targets.get(i).map(|&times| Target::Faster(times));
            row(&name).compare(times[0], tree.name(), times[2 + i]).target(target)
        })
        .collect();
    let alone = row(&format!("{name}, ours on one thread"));
    rows.push(alone.compare(times[1], frames.trees[0].name(), times[2]));
    Ok(rows)
}

fn named(case: &Case) -> Vec<Aabb> {
    BoxSet::named(case.set).expect("a set of the harness").boxes(case.boxes, 1)
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
        self.for_parry = trees::for_parry(&self.wander.boxes);
        self.obvhs.prepare(&self.wander.boxes);
    }

    fn run(&mut self, side: usize) -> Result<f64, Failure> {
        let Self { wander, for_parry, ours, obvhs, found, .. } = self;
        let (pairs, time) = match side {
            0 => timed(|| ours.find(&wander.boxes).map(<[_]>::len)),
            1 => timed(|| Ok(parry_rebuilt(for_parry, found))),
            _ => timed(|| Ok(obvhs.rebuilt(found))),
        };
        self.pairs[side] = pairs.map_err(|error| Failure::Input(error.to_string()))?;
        Ok(time)
    }
}

fn scratch_rows(case: &Case, effort: Effort) -> Result<Vec<Row>, Failure> {
    let name = format!("from scratch, {}", case.set);
    let (ours, obvhs) = (Finder::new(CONFIG), Obvhs::default());
    let wander = Wander::new(named(case), 1.0, distance(case.set));
    let mut scratch = Scratch { wander, for_parry: vec![], ours, obvhs, pairs: [0; 3], found: vec![] };
    let times = medians(&mut scratch, effort)?;
    let pairs = agree(&name, scratch.pairs[0], &scratch.pairs[1..])?;
    let row = |i: usize, other| {
        let target = case.targets.get(i).map(|&times| Target::Faster(times));
        Row::new(&name, case.boxes, pairs).ours(times[0]).against(other, times[i + 1]).target(target)
    };
    Ok(vec![row(0, "parry 0.31 rebuilt"), row(1, "obvhs 0.4 ploc")])
}

/// The set of many sizes beside that of one, at the same number of boxes: what a box or pair costs.
fn sizes_row(what: &str, rows: &[Row], quick: bool) -> Option<Row> {
    let of = |set: &str| rows.iter().find(|row| row.case == format!("{what}, {set}"));
    let (mixed, unit) = (of("mixed")?, of("unit")?);
    let row = Row::new(format!("{what}, mixed, per box and pair"), mixed.boxes, mixed.pairs).unit(Unit::Ns);
    let row = row.ours(mixed.cost()?).against("unit", unit.cost()?);
    Some(row.target((!quick).then_some(Target::Within(2.5))))
}
