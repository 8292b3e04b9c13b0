//! `pbig bench update`: a broad phase's call through rapier, ours and stock's in turn on the same world.

use super::memory;
use pbig_harness::motions::{Density, Motion, MovingBoxes};
use pbig_harness::prelude::*;
use pbig_harness::world::World;
use rapier_pbig::PbigBroadPhase;
use rapier3d::prelude::*;

/// Calls in which nothing has moved are measured together: one is shorter than a clock can tell.
const STILL_CALLS: usize = 1000;

/// Boxes as cuboids of a rapier world, which are moved by hand, beside pbig's and rapier's own broad phase.
struct Calls {
    boxes: MovingBoxes,
    is_still: bool,
    world: World,
    /// By box.
    bodies: Vec<RigidBodyHandle>,
    modified: Vec<ColliderHandle>,
    ours: PbigBroadPhase,
    stock: DefaultBroadPhase,
    events: Vec<BroadPhasePairEvent>,
}

const OURS: usize = 0;
const STOCK: usize = 1;

impl Calls {
    /// A world with two broad phases that know it. Without a motion nothing moves.
    fn new(motion: Option<Motion>, density: Density, n: usize) -> Self {
        let mut calls = Self {
            boxes: MovingBoxes::new(motion.unwrap_or(Motion::Few), density, n, 1),
            is_still: motion.is_none(),
            world: World::default(),
            bodies: vec![],
            modified: vec![],
            ours: PbigBroadPhase::new(),
            stock: DefaultBroadPhase::new(),
            events: vec![],
        };
        for aabb in calls.boxes.boxes() {
            let [x, y, z] = aabb.extents().map(|edge| 0.5 * edge);
            let body = RigidBodyBuilder::dynamic().translation(centre(aabb));
            calls.bodies.push(calls.world.add(body, ColliderBuilder::cuboid(x, y, z)));
        }
        calls.modified = calls.world.colliders.iter().map(|(handle, _)| handle).collect();
        calls.update(OURS);
        calls.update(STOCK);
        calls.modified.clear();
        calls
    }

    fn update(&mut self, side: usize) {
        let broad_phase: &mut dyn BroadPhase = if side == OURS { &mut self.ours } else { &mut self.stock };
        let World { params, colliders, bodies, .. } = &self.world;
        self.events.clear();
        broad_phase.update(params, colliders, bodies, &self.modified, &[], &mut self.events);
    }

    /// Moves boxes, and lists their colliders as a step does.
    fn prepare(&mut self, _: usize) {
        if self.is_still {
            return;
        }
        self.modified.clear();
        let World { colliders, bodies, .. } = &mut self.world;
        for id in self.boxes.step().to_vec() {
            let body = &mut bodies[self.bodies[id as usize]];
            body.set_translation(centre(&self.boxes.boxes()[id as usize]), false);
            self.modified.push(body.colliders()[0]);
        }
        bodies.propagate_modified_body_positions_to_colliders(colliders);
    }

    fn run(&mut self, side: usize) -> Result<f64, Failure> {
        let calls = if self.is_still { STILL_CALLS } else { 1 };
        let ((), time) = timed(|| (0..calls).for_each(|_| self.update(side)));
        Ok(time / calls as f64)
    }
}

fn centre(aabb: &pbig_core::Aabb) -> Vector<Real> {
    Vector::from_fn(|k, _| 0.5 * (aabb.min[k] + aabb.max[k]))
}

/// Motions with their names; none: nothing moves.
const MOTIONS: [(&str, Option<Motion>); 3] =
    [("all", Some(Motion::Swing)), ("1%", Some(Motion::Few)), ("nothing", None)];

pub(super) fn run(quick: bool) -> Result<BenchReport, Failure> {
    let mut table = Table::new("update", COMPARED);
    let sizes: &[usize] = if quick { &[1000, 10_000] } else { &[1000, 10_000, 100_000, 1_000_000] };
    let cases = MOTIONS.iter().flat_map(|motion| sizes.iter().map(move |n| (*motion, *n)));
    for ((name, motion), n) in tracked(cases, "cases") {
        let mut calls = Calls::new(motion, Density::Sparse, n);
        let times = measured(&mut calls, 2, Effort::new(quick), Calls::prepare, Calls::run)?;
        let (case, pairs) = (format!("unit, {name} moved"), calls.ours.pair_count() as u64);
        let unit = if calls.is_still { ("us", 1e3) } else { MS };
        table.row(compared(&case, n, pairs, unit, times[OURS], ("stock", times[STOCK])));
    }
    memory::peaks(quick, &mut table)?;
    Ok(BenchReport::new("update", vec![table]))
}
