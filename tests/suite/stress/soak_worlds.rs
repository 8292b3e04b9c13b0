//! Churn for ever through rapier: bodies fall, come to rest, change and go while others come. The broad phase holds no more
//! memory as time goes on, and no pair is missed.

use super::memory::Weighed;
use glam::Vec3;
use pbig_harness::runner::Timed;
use pbig_harness::world::World;
use pbig_tests::on_threads;
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use rapier_pbig::{PbigBroadPhase, PbigConfig};
use rapier3d::prelude::*;
use std::collections::VecDeque;

/// Steps, a few hundred without `PBIG_SOAK`.
fn steps() -> usize {
    super::soak::given().unwrap_or(600)
}

/// Bodies that come above a tray with a rim, the oldest of which go.
struct Tray {
    world: World,
    rng: StdRng,
    there: VecDeque<RigidBodyHandle>,
}

impl Tray {
    fn new() -> Self {
        let mut world = World::default();
        world.colliders.insert(ColliderBuilder::cuboid(4.0, 0.5, 4.0));
        for (x, z) in [(4.0, 0.0), (-4.0, 0.0), (0.0, 4.0), (0.0, -4.0)] {
            let (wide, deep) = if x == 0.0 { (4.0, 0.2) } else { (0.2, 4.0) };
            world.colliders.insert(ColliderBuilder::cuboid(wide, 2.0, deep).translation(vector![x, 2.0, z]));
        }
        Self { world, rng: StdRng::seed_from_u64(3), there: VecDeque::new() }
    }

    fn spawn(&mut self) {
        let mut along = || self.rng.random_range(-3.0..3.0);
        let at = Vec3::new(along(), 5.0 + along(), along());
        let body = World::dynamic(at);
        let collider = match self.rng.random_range(0..3) {
            0 => ColliderBuilder::ball(0.3),
            1 => ColliderBuilder::cuboid(0.3, 0.2, 0.4),
            _ => ColliderBuilder::ball(0.5).sensor(true),
        };
        self.there.push_back(self.world.add(body, collider));
    }

    /// A collider of a body that is there is changed in a way that broad phases must notice.
    fn touch(&mut self) {
        let body = self.there[self.rng.random_range(0..self.there.len())];
        let handle = self.world.bodies[body].colliders()[0];
        let enabled = self.rng.random_ratio(3, 4);
        let groups = InteractionGroups::new(
            Group::GROUP_1 | Group::GROUP_2,
            Group::from_bits_truncate(self.rng.random_range(1..4)),
        );
        let collider = &mut self.world.colliders[handle];
        if self.rng.random_ratio(1, 2) {
            collider.set_enabled(enabled);
        } else {
            collider.set_collision_groups(groups);
        }
    }

    /// Every third step one comes; of more than 60 the oldest goes. Now and then all go at once.
    fn churn(&mut self, step: usize) {
        if step.is_multiple_of(3) {
            self.spawn();
        }
        if step.is_multiple_of(5) && !self.there.is_empty() {
            self.touch();
        }
        let most = if step.is_multiple_of(211) { 0 } else { 60 };
        while self.there.len() > most
            && let Some(oldest) = self.there.pop_front()
        {
            self.world.remove(oldest);
        }
    }
}

/// On one thread, whose memory is counted.
#[test]
fn soak_of_a_rapier_world_that_comes_and_goes() {
    on_threads(1, || {
        let steps = steps();
        let mut tray = Tray::new();
        let weighed = Weighed { inner: PbigBroadPhase::new(), bytes: 0, largest: vec![] };
        let mut broad_phase = Timed::new(weighed).checked(PbigConfig::DEFAULT.margin, (steps / 5000).max(1));
        let mut early = 0;
        for step in 0..steps {
            tray.churn(step);
            tray.world.step(&mut broad_phase);
            let bytes = broad_phase.inner.bytes;
            early = if step < steps / 5 { bytes.max(early) } else { early };
            assert!(bytes <= early * 5 / 4 + 8000, "step {step}: {bytes} bytes are held, at first {early}");
            let differences = &broad_phase.checker().expect("it is checked").differences;
            assert!(differences.is_empty(), "step {step}: {differences:?}");
        }
        let checker = broad_phase.checker().expect("it is checked");
        assert!(checker.compared > 0 && checker.oracle_pairs as usize > 10 * checker.compared, "few pairs");
        println!(
            "{steps} steps, {} compared, {} bytes held, at first {early}",
            checker.compared, broad_phase.inner.bytes
        );
    });
}
