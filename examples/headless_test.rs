//! A physics test that runs headless: a ball dropped on a plank must come to rest on it, with no
//! pair missed on the way.
//!
//! `cargo run --release --example headless_test`

use pbig_harness::shadow::Shadowed;
use pbig_harness::world::World;
use rapier_pbig::PbigBroadPhase;
use rapier3d::prelude::*;

fn main() {
    let mut world = World::default();
    world.colliders.insert(ColliderBuilder::cuboid(5.0, 0.1, 5.0));
    let ball = world
        .add(RigidBodyBuilder::dynamic().translation(vector![0.3, 4.0, 0.0]), ColliderBuilder::ball(0.5));

    // The shadow runs rapier's own broad phase and brute force beside pbig, and compares every call.
    let mut broad_phase = Shadowed::new(PbigBroadPhase::new(), PbigBroadPhase::CONFIG.margin);
    for _ in 0..300 {
        world.step(&mut broad_phase);
    }

    let height = world.bodies[ball].translation().y;
    assert!((height - 0.6).abs() < 0.01, "the ball rests on the plank, not at {height}");
    assert!(broad_phase.first_difference().is_none(), "{:?}", broad_phase.first_difference());
    println!(
        "the ball rests at {height:.3}; {} calls checked, nothing missing",
        broad_phase.checker.compared
    );
}
