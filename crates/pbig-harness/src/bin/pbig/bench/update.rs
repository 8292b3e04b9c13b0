//! `pbig bench update`: a broad phase's call through rapier, ours and stock's in turn on the same world.

use super::measure::{Contest, Effort, Took, measured, medians, timed};
use super::table::{Row, Target, Unit};
use super::{Outcome, memory, requests};
use crate::output::{Failure, progress};
use pbig_core::Aabb;
use pbig_harness::boxes::{BoxSet, Movers};
use pbig_harness::chart::{Line, LogLog};
use pbig_harness::field::Field;
use rapier_pbig::PbigBroadPhase;
use rapier3d::prelude::*;
use rayon::prelude::*;
use std::hint::black_box;

/// The distance that boxes of these sets, with edges of 1 to 100, move in a frame: far beyond any margin.
const DISTANCE: f32 = 1.0;

/// Calls in which nothing has moved are measured together: one is shorter than a clock can tell.
const STILL_CALLS: usize = 1000;

/// Ours and stock's broad phase beside the same world; and the floor below both, merely computing the
/// boxes of what has moved, on one thread and on all.
struct Calls {
    field: Field,
    movers: Option<Movers>,
    modified: Vec<ColliderHandle>,
    ours: PbigBroadPhase,
    stock: DefaultBroadPhase,
    events: Vec<BroadPhasePairEvent>,
    boxes: Vec<rapier3d::parry::bounding_volume::Aabb>,
    with_floor: bool,
}

const OURS: usize = 0;
const STOCK: usize = 1;
const FLOOR: usize = 2;
const FLOOR_PARALLEL: usize = 3;

impl Calls {
    /// A world with two broad phases that know it. Without movers nothing moves.
    fn new(boxes: &[Aabb], share: Option<f64>, with_floor: bool) -> Self {
        let mut calls = Self {
            field: Field::new(boxes),
            movers: share.map(|share| Movers::new(boxes.len(), share)),
            modified: vec![],
            ours: PbigBroadPhase::new(),
            stock: DefaultBroadPhase::new(),
            events: vec![],
            boxes: vec![],
            with_floor,
        };
        calls.modified.clone_from(&calls.field.colliders);
        calls.update(OURS);
        calls.update(STOCK);
        calls.modified.clear();
        calls
    }

    fn update(&mut self, side: usize) {
        let broad_phase: &mut dyn BroadPhase = if side == OURS { &mut self.ours } else { &mut self.stock };
        self.events.clear();
        self.field.call(broad_phase, &self.modified, &mut self.events);
    }

    fn floor(&mut self, parallel: bool) {
        let world = &self.field.world;
        let reach = world.params.prediction_distance() / 2.0;
        let aabb = |&handle: &ColliderHandle| world.colliders[handle].compute_collision_aabb(reach);
        if parallel {
            self.modified.par_iter().map(aabb).collect_into_vec(&mut self.boxes);
        } else {
            self.boxes.clear();
            self.boxes.extend(self.modified.iter().map(aabb));
        }
        black_box(&mut self.boxes);
    }
}

impl Contest for Calls {
    fn sides(&self) -> usize {
        if self.with_floor { 4 } else { 2 }
    }

    fn prepare(&mut self, round: usize) {
        if let Some(movers) = &self.movers {
            self.modified = self.field.shift(&movers.of(round), DISTANCE);
        }
    }

    fn run(&mut self, side: usize) -> Result<f64, Failure> {
        let calls = if self.movers.is_none() { STILL_CALLS } else { 1 };
        let ((), time) = timed(|| {
            for _ in 0..calls {
                match side {
                    OURS | STOCK => self.update(side),
                    _ => self.floor(side == FLOOR_PARALLEL),
                }
            }
        });
        Ok(time / calls as f64)
    }
}

/// Which boxes move, and how fast that should be.
struct Case {
    set: &'static str,
    boxes: usize,
    /// None: nothing moves.
    share: Option<f64>,
    target: Option<Target>,
}

fn cases(quick: bool) -> Vec<Case> {
    let case =
        |set, boxes, share, times: Option<f64>| Case { set, boxes, share, target: times.map(Target::Faster) };
    let sizes: &[(usize, f64)] = if quick {
        &[(1000, 1.5), (10_000, 3.0)]
    } else {
        &[(1000, 1.5), (10_000, 3.0), (100_000, 5.0), (1_000_000, 8.0)]
    };
    let mut cases: Vec<Case> =
        sizes.iter().map(|&(n, times)| case("uniform", n, Some(1.0), Some(times))).collect();
    if quick {
        cases.extend([case("gaussian", 10_000, Some(1.0), None), case("uniform", 10_000, Some(0.01), None)]);
    } else {
        cases.push(case("gaussian", 100_000, Some(1.0), Some(5.0)));
        cases.push(case("uniform", 100_000, Some(0.01), Some(15.0)));
        cases.push(case("uniform", 1_000_000, Some(0.01), Some(30.0)));
    }
    cases.extend(sizes.iter().map(|&(n, _)| {
        let target = Some(Target::Below(0.002));
        Case { set: "uniform", boxes: n, share: None, target }
    }));
    cases
}

pub(super) fn run(quick: bool) -> Result<Outcome, Failure> {
    let cases = cases(quick);
    let bar = progress(cases.len() + 1, "cases");
    let mut rows = Vec::new();
    let mut chart =
        ["ours", "stock", "floor, one thread"].map(|name| Line { name: name.into(), points: Vec::new() });
    for case in &cases {
        let all_moved = case.set == "uniform" && case.share == Some(1.0);
        let (own, times) = measure(case, all_moved, Effort::new(quick))?;
        if all_moved {
            let point = |took: &Took| (case.boxes as f64, took.median);
            chart.iter_mut().zip(&times).for_each(|(line, took)| line.points.push(point(took)));
        }
        rows.extend(own);
        bar.inc(1);
    }
    rows.extend(memory::rows(quick)?);
    rows.extend(requests::rows(quick)?);
    bar.finish_and_clear();
    let chart = LogLog {
        name: "update-boxes".into(),
        title: "a call through rapier, uniform boxes, all moved".into(),
        x: "boxes",
        y: "ms",
        lines: chart.into(),
        exponents: true,
    };
    Ok(Outcome { rows, notes: notes(), charts: vec![chart] })
}

fn notes() -> Vec<String> {
    let features = [("parallel", cfg!(feature = "parallel")), ("simd-stable", cfg!(feature = "simd"))];
    let on: Vec<&str> = features.into_iter().filter(|(_, on)| *on).map(|(name, _)| name).collect();
    vec![
        format!(
            "stock is rapier 0.27's DefaultBroadPhase (rapier's features: {}); both are called in turn with the same \
             list on the same world, and events are discarded",
            on.join(", ")
        ),
        "x and the target are about medians; the means, beside, have their part of work that one call does for many"
            .into(),
        "floor: reading each moved collider and computing its box, and nothing else; the target is about the floor on \
         one thread, while ours runs on all"
            .into(),
    ]
}

/// The row of a case, with those of the floor, and the times of all sides.
fn measure(case: &Case, with_floor: bool, effort: Effort) -> Result<(Vec<Row>, Vec<Took>), Failure> {
    let boxes = BoxSet::named(case.set).expect("a set of the harness").boxes(case.boxes, 1);
    let mut calls = Calls::new(&boxes, case.share, with_floor);
    let times = measured(&mut calls, effort)?;
    let pairs = calls.ours.pair_count() as u64;
    let moved = match case.share {
        None => "nothing".into(),
        Some(1.0) => "all".into(),
        Some(share) => format!("{}%", share * 100.0),
    };
    let unit = if case.share.is_none() { Unit::Us } else { Unit::Ms };
    let row = |name: &'static str, side: usize| {
        let row = Row::new(format!("{}, {moved} moved", case.set), case.boxes, pairs).unit(unit);
        row.compare(times[OURS], name, times[side])
    };
    let mut rows = vec![row("stock", STOCK).target(case.target)];
    if with_floor {
        let target = (case.boxes >= 10_000).then_some(Target::Within(2.0));
        rows.push(row("floor, one thread", FLOOR).target(target));
        rows.push(row("floor, all threads", FLOOR_PARALLEL));
    }
    Ok((rows, times))
}

/// Ours and stock's milliseconds when a share of some boxes moves, and the pairs.
pub(super) fn shares(boxes: &[Aabb], share: f64, effort: Effort) -> Result<(f64, f64, u64), Failure> {
    let mut calls = Calls::new(boxes, Some(share), false);
    let times = medians(&mut calls, effort)?;
    Ok((times[OURS], times[STOCK], calls.ours.pair_count() as u64))
}
