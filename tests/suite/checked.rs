//! A world whose every call of the broad phase is checked beside stock and the oracle.

use pbig_core::{Backend, Config, Engine};
use pbig_harness::runner::Timed;
use pbig_harness::world::World;
use pbig_tests::Way;
use rapier_pbig::{PbigBroadPhase, PbigConfig};
use rapier3d::prelude::*;

/// The world, and the broad phase with its checker around it.
pub(crate) struct Checked {
    pub(crate) world: World,
    pub(crate) broad_phase: Timed<PbigBroadPhase>,
    pub(crate) way: Way,
}

/// The backends on which rapier's semantics are tested: the CPU as it comes, which tests all pairs of a small world or looks boxes
/// up, the CPU with its grid and a GPU with its grid, however small the world.
pub(crate) fn backends() -> Vec<(&'static str, Way)> {
    let [cpu, grid] = on_cpu().map(Way::from);
    let all = [("cpu", cpu), ("cpu grid", grid), ("gpu", on_gpu())];
    all.into_iter().filter(|(_, way)| pbig_tests::may_run(way)).collect()
}

/// Ours, with any settings of the core.
pub(crate) fn pbig(way: impl Into<Way>) -> PbigBroadPhase {
    let way = way.into();
    on_its_device(way, PbigBroadPhase::with_core_config(way.config).expect("a length"))
}

/// Gives a broad phase its device, if it needs one. A restored one has none.
pub(crate) fn on_its_device(way: Way, mut pbig: PbigBroadPhase) -> PbigBroadPhase {
    if let Some(device) = way.device() {
        pbig.set_device(device);
    }
    pbig
}

/// As it comes, and with its grid.
pub(crate) fn on_cpu() -> [Config; 2] {
    let cpu = Config { backend: Backend::Cpu, ..PbigConfig::DEFAULT.into() };
    [cpu, Config { engine: Some(Engine::Grid), ..cpu }]
}

/// With its grid.
pub(crate) fn on_gpu() -> Way {
    pbig_tests::gpu().with(|it| it.margin = PbigConfig::DEFAULT.margin)
}

/// Runs a test on every backend, each time with a new world.
pub(crate) fn everywhere(test: impl Fn(Checked)) {
    for (name, way) in backends() {
        println!("on {name}");
        test(Checked::new(way));
    }
}

impl Checked {
    /// Things stay where they are put: no gravity, and [`Checked::ball`]s that contacts cannot push.
    pub(crate) fn new(way: impl Into<Way>) -> Self {
        let way = way.into();
        let world = World::with_gravity(glam::Vec3::ZERO);
        let broad_phase = Timed::new(pbig(way)).checked(way.margin, 1);
        Self { world, broad_phase, way }
    }

    /// A ball of radius 0.5 on a body of its own that never sleeps.
    pub(crate) fn ball(&mut self, x: f32) -> (RigidBodyHandle, ColliderHandle) {
        let body = RigidBodyBuilder::dynamic().translation(vector![x, 0.0, 0.0]);
        let body = self.world.bodies.insert(body.can_sleep(false).lock_translations().lock_rotations());
        (body, self.attach(body))
    }

    /// A second ball of radius 0.5 on a body, at its origin.
    pub(crate) fn attach(&mut self, body: RigidBodyHandle) -> ColliderHandle {
        let World { bodies, colliders, .. } = &mut self.world;
        colliders.insert_with_parent(ColliderBuilder::ball(0.5), body, bodies)
    }

    pub(crate) fn move_to(&mut self, body: RigidBodyHandle, x: f32) {
        self.world.bodies[body].set_translation(vector![x, 0.0, 0.0], true);
    }

    /// Steps, checks every call, and returns how many pairs the broad phase keeps.
    pub(crate) fn step(&mut self) -> usize {
        self.world.step(&mut self.broad_phase);
        self.assert_no_difference();
        self.broad_phase.inner.pair_count()
    }

    /// Pairs that the narrow phase has, apart from those with sensors.
    pub(crate) fn contacts(&self) -> usize {
        self.world.narrow_phase.contact_pairs().count()
    }

    fn assert_no_difference(&self) {
        if let Some(first) = self.broad_phase.first_difference() {
            panic!("{first}");
        }
        let report = self.broad_phase.inner.stats().report;
        assert_eq!(report.fallback, None, "a GPU's work is not done by the CPU");
        let searched = report.changed > 0 && report.boxes - report.invalid > 1;
        assert_eq!(
            report.device.is_some(),
            searched && self.way.backend == Backend::Device,
            "{}",
            report.plan
        );
    }
}
