//! A rapier world whose broad phase is compared with brute force and with rapier's own in every update.

use crate::Fault;
use pbig_scenes::scenes::Scene;
use pbig_scenes::world::World;
use rapier_pbig::PbigBroadPhase;
use rapier_pbig::shadow::{Call, Checker, Shadow, Watcher};
use rapier3d::prelude::*;

const BODIES: usize = 200;
const STEPS: usize = 60;

/// Drops a column of bodies and returns what happened in words, or the first difference.
pub(crate) fn check(fault: Fault) -> Result<String, String> {
    let mut broad_phase = Watched::new(fault);
    let mut world = Scene::named("column")?.build(BODIES, 1);
    let start = lowest(&world);
    (0..STEPS).for_each(|_| world.step(&mut broad_phase));
    let checkers = [&broad_phase.watcher.checker, broad_phase.inner.shadow().ok_or("there is no checker")?];
    if let Some(first) = checkers.iter().find_map(|checker| checker.differences.first()) {
        return Err(format!("rapier world: {first}"));
    }
    let (compared, pairs, lowest) = (checkers[1].compared, broad_phase.inner.pair_count(), lowest(&world));
    if compared == 0 || pairs == 0 || !(0.0..start).contains(&lowest) {
        return Err(format!("rapier world: {compared} updates, {pairs} pairs, the lowest body at {lowest}"));
    }
    Ok(format!(
        "rapier world: {BODIES} bodies, {STEPS} steps, {pairs} pairs, the lowest body at {lowest:.3}; \
         {compared} updates compared, no difference"
    ))
}

/// Returns the height of the lowest body that can move.
fn lowest(world: &World) -> f32 {
    let movers = world.bodies.iter().filter(|(_, body)| body.is_dynamic());
    movers.map(|(_, body)| body.translation().y).fold(f32::MAX, f32::min)
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
        Self { inner, watcher: Watcher::new(0.01, Checker::default().with(Shadow::Oracle)), fault }
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
