//! A rapier app in which one line changed.
//!
//! `cargo run --release --example drop_in`

use rapier_pbig::PbigBroadPhase;
use rapier3d::prelude::*;

fn main() {
    let (mut bodies, mut colliders) = (RigidBodySet::new(), ColliderSet::new());
    colliders.insert(ColliderBuilder::halfspace(Vector::y_axis()));
    for i in 0..100 {
        let at = vector![(i % 5) as f32 * 1.1, 1.0 + (i / 5) as f32, 0.0];
        let body = bodies.insert(RigidBodyBuilder::dynamic().translation(at));
        colliders.insert_with_parent(ColliderBuilder::ball(0.5), body, &mut bodies);
    }

    // The one line. Before: let mut broad_phase = DefaultBroadPhase::new();
    let mut broad_phase = PbigBroadPhase::new();

    let mut pipeline = PhysicsPipeline::new();
    let (mut islands, mut narrow_phase) = (IslandManager::new(), NarrowPhase::new());
    let (mut impulse_joints, mut multibody_joints) = (ImpulseJointSet::new(), MultibodyJointSet::new());
    let mut ccd_solver = CCDSolver::new();
    for _ in 0..240 {
        pipeline.step(
            &vector![0.0, -9.81, 0.0],
            &IntegrationParameters::default(),
            &mut islands,
            &mut broad_phase,
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

    let lowest = bodies.iter().map(|(_, body)| body.translation().y).fold(f32::MAX, f32::min);
    println!("after four seconds the lowest of {} balls is at {lowest:.3}", bodies.len());
    let totals = broad_phase.stats().totals;
    println!(
        "{} pairs now; {} added, {} deleted so far",
        broad_phase.pair_count(),
        totals.added,
        totals.deleted
    );
    println!("last update: {}", broad_phase.stats().report.plan);
}
