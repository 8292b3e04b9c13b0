//! A physics test that runs headless: a ball dropped on a plank must come to rest on it, with no
//! pair missed on the way.
//!
//! `cargo run --release --example headless_test`

use pbig_harness::world::World;
use rapier_pbig::PbigBroadPhase;
use rapier_pbig::shadow::Shadow;
use rapier3d::prelude::*;

fn main() {
    let mut world = World::default();
    let plank = world.colliders.insert(ColliderBuilder::cuboid(5.0, 0.1, 5.0));
    let ball = world
        .add(RigidBodyBuilder::dynamic().translation(vector![0.3, 4.0, 0.0]), ColliderBuilder::ball(0.5));
    let on_ball = world.bodies[ball].colliders()[0];

    // Rapier's own broad phase and brute force beside pbig, compared in every update.
    let mut broad_phase = PbigBroadPhase::new().with_shadow(Shadow::Stock).with_shadow(Shadow::Oracle);
    world.step(&mut broad_phase);
    println!("at first:  {}", broad_phase.why(on_ball, plank));
    for _ in 0..300 {
        world.step(&mut broad_phase);
    }
    println!("at last:   {}", broad_phase.why(on_ball, plank));

    let height = world.bodies[ball].translation().y;
    assert!((height - 0.6).abs() < 0.01, "the ball rests on the plank, not at {height}");
    assert!(broad_phase.differences().is_empty(), "{}", broad_phase.differences()[0]);
    let compared = broad_phase.shadow().map_or(0, |shadow| shadow.compared);
    println!("the ball rests at {height:.3}; {compared} updates compared, nothing missing");
}
