//! A test of an app's physics, without a window: a ball that drops on a plank comes to rest there, and no pair is missed.
//!
//! `cargo test --release --example headless_test`, or `cargo run --release --example headless_test` to see the reasons.

use rapier_pbig::PbigBroadPhase;
use rapier_pbig::shadow::Shadow;
use rapier3d::prelude::*;

#[derive(Default)]
struct World {
    broad_phase: PbigBroadPhase,
    pipeline: PhysicsPipeline,
    islands: IslandManager,
    narrow_phase: NarrowPhase,
    bodies: RigidBodySet,
    colliders: ColliderSet,
    joints: (ImpulseJointSet, MultibodyJointSet),
    ccd_solver: CCDSolver,
}

impl World {
    #[rustfmt::skip]
    fn step(&mut self) {
        let Self { broad_phase, pipeline, islands, narrow_phase, bodies, colliders, joints, ccd_solver } = self;
        let (gravity, params) = (vector![0.0, -9.81, 0.0], IntegrationParameters::default());
        pipeline.step(&gravity, &params, islands, broad_phase, narrow_phase, bodies, colliders,
            &mut joints.0, &mut joints.1, ccd_solver, &(), &());
    }

    /// Returns a world whose broad phase is compared with rapier's own and with brute force in every update.
    fn checked() -> Self {
        let broad_phase = PbigBroadPhase::new().with_shadow(Shadow::Stock).with_shadow(Shadow::Oracle);
        Self { broad_phase, ..Self::default() }
    }

    /// Inserts a plank and a ball above it.
    fn drop_ball(&mut self) -> [ColliderHandle; 2] {
        let plank = self.colliders.insert(ColliderBuilder::cuboid(5.0, 0.1, 5.0));
        let ball = RigidBodyBuilder::dynamic().translation(vector![0.3, 4.0, 0.0]);
        let ball = self.bodies.insert(ball);
        let ball = self.colliders.insert_with_parent(ColliderBuilder::ball(0.5), ball, &mut self.bodies);
        [plank, ball]
    }
}

fn main() {
    let mut world = World::checked();
    let [plank, ball] = world.drop_ball();
    for seconds in 0..5 {
        (0..60).for_each(|_| world.step());
        let height = world.colliders[ball].translation().y;
        println!("after {} s at {height:.3}; {}", seconds + 1, world.broad_phase.why(ball, plank));
    }
    let compared = world.broad_phase.shadow().map_or(0, |shadow| shadow.compared);
    println!("{compared} updates compared, {} differences", world.broad_phase.differences().len());
}

#[test]
fn a_ball_comes_to_rest_on_a_plank_and_no_pair_is_missed() {
    let mut world = World::checked();
    let [_, ball] = world.drop_ball();
    (0..300).for_each(|_| world.step());
    let height = world.colliders[ball].translation().y;
    assert!((height - 0.6).abs() < 0.01, "the ball is at {height}");
    assert!(world.broad_phase.differences().is_empty(), "{}", world.broad_phase.differences()[0]);
}
