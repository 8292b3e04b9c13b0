//! A rapier world whose broad phase is compared with brute force and with rapier's own in every update.

use crate::Fault;
use rapier_pbig::PbigBroadPhase;
use rapier_pbig::shadow::{Call, Shadow, Watcher};
use rapier3d::prelude::*;

const BODIES: usize = 200;
const STEPS: usize = 60;

/// Drops a column of bodies and returns what happened in words, or the first difference.
pub(crate) fn check(fault: Fault) -> Result<String, String> {
    let mut broad_phase = Watched::new(fault);
    let bodies = fall(&mut broad_phase);
    let checkers = [&broad_phase.watcher.checker, broad_phase.inner.shadow().ok_or("there is no checker")?];
    if let Some(first) = checkers.iter().find_map(|checker| checker.differences.first()) {
        return Err(format!("rapier world: {first}"));
    }
    let (compared, pairs) = (checkers[1].compared, broad_phase.inner.pair_count());
    let lowest = bodies.iter().map(|(_, body)| body.translation().y).fold(f32::MAX, f32::min);
    if compared == 0 || pairs == 0 || !(0.3..1.0).contains(&lowest) {
        return Err(format!("rapier world: {compared} updates, {pairs} pairs, the lowest body at {lowest}"));
    }
    Ok(format!(
        "rapier world: {BODIES} bodies, {STEPS} steps, {pairs} pairs, the lowest body at {lowest:.3}; \
         {compared} updates compared, no difference"
    ))
}

/// A column of balls and cuboids, in layers of nine, above a half-space.
fn column(bodies: &mut RigidBodySet, colliders: &mut ColliderSet) {
    colliders.insert(ColliderBuilder::halfspace(Vector::y_axis()));
    for i in 0..BODIES {
        let [x, y, z] = [i % 3, i / 9, i / 3 % 3].map(|k| k as f32);
        let body = RigidBodyBuilder::dynamic().translation(vector![0.9 * x, 0.6 + 1.1 * y, 0.9 * z]);
        let shape = [ColliderBuilder::ball(0.5), ColliderBuilder::cuboid(0.4, 0.5, 0.4)][i % 2].clone();
        let body = bodies.insert(body);
        colliders.insert_with_parent(shape, body, bodies);
    }
}

fn fall(broad_phase: &mut Watched) -> RigidBodySet {
    let (mut bodies, mut colliders) = (RigidBodySet::new(), ColliderSet::new());
    column(&mut bodies, &mut colliders);
    let (mut pipeline, mut islands) = (PhysicsPipeline::new(), IslandManager::new());
    let (mut narrow_phase, mut ccd_solver) = (NarrowPhase::new(), CCDSolver::new());
    let (mut impulse_joints, mut multibody_joints) = (ImpulseJointSet::new(), MultibodyJointSet::new());
    for _ in 0..STEPS {
        pipeline.step(
            &vector![0.0, -9.81, 0.0],
            &IntegrationParameters::default(),
            &mut islands,
            broad_phase,
            &mut narrow_phase,
            &mut bodies,
            &mut colliders,
            &mut impulse_joints,
            &mut multibody_joints,
            &mut ccd_solver,
            &(),
            &(),
        );
    }
    bodies
}

/// pbig with its own checker, and a second checker that sees the events after a planted fault.
struct Watched {
    inner: PbigBroadPhase,
    watcher: Watcher,
    fault: Fault,
}

impl Watched {
    fn new(fault: Fault) -> Self {
        let inner = PbigBroadPhase::new().with_shadow(Shadow::Stock).with_shadow(Shadow::Oracle);
        Self { inner, watcher: Watcher::new(0.01).with(Shadow::Oracle), fault }
    }
}

impl BroadPhase for Watched {
    fn update(
        &mut self,
        params: &IntegrationParameters,
        colliders: &ColliderSet,
        bodies: &RigidBodySet,
        modified: &[ColliderHandle],
        removed: &[ColliderHandle],
        events: &mut Vec<BroadPhasePairEvent>,
    ) {
        self.inner.update(params, colliders, bodies, modified, removed, events);
        self.fault.lose(Fault::WorldLoses, events);
        self.watcher.watch(&Call { params, colliders, bodies, modified, removed }, events);
    }
}
