//! `pbig bench update`: a broad phase's call through rapier, ours and stock's in turn on the same world.

use super::memory;
use pbig_core::Aabb;
use pbig_harness::field::Field;
use pbig_harness::prelude::*;
use rapier_pbig::PbigBroadPhase;
use rapier3d::prelude::*;

/// The distance that boxes of these sets, with edges of 1 to 100, move in a frame: far beyond any margin.
const DISTANCE: f32 = 1.0;

/// Calls in which nothing has moved are measured together: one is shorter than a clock can tell.
const STILL_CALLS: usize = 1000;

/// Pbig's and rapier's own broad phase beside the same world.
struct Calls {
    field: Field,
    movers: Option<Movers>,
    modified: Vec<ColliderHandle>,
    ours: PbigBroadPhase,
    stock: DefaultBroadPhase,
    events: Vec<BroadPhasePairEvent>,
}

const OURS: usize = 0;
const STOCK: usize = 1;

impl Calls {
    /// A world with two broad phases that know it. Without movers nothing moves.
    fn new(boxes: &[Aabb], share: Option<f64>) -> Self {
        let mut calls = Self {
            field: Field::new(boxes),
            movers: share.map(|share| Movers::new(boxes.len(), share)),
            modified: vec![],
            ours: PbigBroadPhase::new(),
            stock: DefaultBroadPhase::new(),
            events: vec![],
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

    fn prepare(&mut self, round: usize) {
        if let Some(movers) = &self.movers {
            self.modified = self.field.shift(&movers.of(round), DISTANCE);
        }
    }

    fn run(&mut self, side: usize) -> Result<f64, Failure> {
        let calls = if self.movers.is_none() { STILL_CALLS } else { 1 };
        let ((), time) = timed(|| {
            for _ in 0..calls {
                self.update(side);
            }
        });
        Ok(time / calls as f64)
    }
}

/// A set of boxes, and the share that moves; none: nothing moves.
type UpdateCase = (&'static str, usize, Option<f64>);

fn cases(quick: bool) -> impl Iterator<Item = UpdateCase> {
    let of = |share| [1000, 10_000, 100_000, 1_000_000].map(|boxes| ("uniform", boxes, share));
    let others = [("gaussian", 10_000, Some(1.0)), ("gaussian", 100_000, Some(1.0))];
    let all = of(Some(1.0)).into_iter().chain(others).chain(of(Some(0.01))).chain(of(None));
    all.filter(move |(_, boxes, _)| !quick || *boxes <= 10_000)
}

pub(super) fn run(quick: bool) -> Result<BenchReport, Failure> {
    let mut table = Table::new("update", COMPARED);
    for case in tracked(cases(quick), "cases") {
        measure(case, Effort::new(quick), &mut table)?;
    }
    memory::peaks(quick, &mut table)?;
    Ok(BenchReport::new("update", vec![table]))
}

/// Appends the row of a case.
fn measure((set, n, share): UpdateCase, effort: Effort, table: &mut Table) -> Result<(), Failure> {
    let boxes = BoxSet::named(set).expect("a set of the harness").boxes(n, 1);
    let mut calls = Calls::new(&boxes, share);
    let times = measured(&mut calls, 2, effort, Calls::prepare, Calls::run)?;
    let moved = match share {
        None => "nothing".into(),
        Some(1.0) => "all".into(),
        Some(share) => format!("{}%", share * 100.0),
    };
    let (case, pairs) = (format!("{set}, {moved} moved"), calls.ours.pair_count() as u64);
    let unit = if share.is_none() { ("us", 1e3) } else { MS };
    table.row(compared(&case, n, pairs, unit, times[OURS], ("stock", times[STOCK])));
    Ok(())
}
