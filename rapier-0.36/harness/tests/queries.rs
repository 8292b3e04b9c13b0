//! Both broad phases answer the queries of frames, and a frame without queries is a step.
#![cfg(not(any(feature = "dim2", feature = "f64")))]

use glam::Vec3;
use pbig_harness_036::queries::FrameQueries;
use pbig_harness_036::run::Run;
use pbig_harness_036::world::{dynamic, ground, with};
use pbig_scenes::frames::FrameKind;
use pbig_scenes::scenes::Scene;
use rapier::prelude::{BroadPhaseBvh, ColliderBuilder, PhysicsWorld, Vector};

/// Returns balls that hang still above a ground.
fn still_world(broad_phase: BroadPhaseBvh) -> PhysicsWorld {
    let mut world = PhysicsWorld { gravity: Vector::ZERO, ..with(broad_phase) };
    world.colliders.insert(ground());
    for i in 0..216 {
        let place = Vec3::new((i % 6) as f32, (i / 36) as f32, (i / 6 % 6) as f32);
        world.insert(dynamic(2.0 * place + Vec3::Y), ColliderBuilder::ball(0.5));
    }
    world
}

/// Returns the hits of some frames.
fn hits(kind: FrameKind, broad_phase: BroadPhaseBvh) -> u64 {
    let mut world = still_world(broad_phase);
    let mut queries = FrameQueries::new(kind, &world).expect("a kind with queries");
    let frames = (0..40).map(|_| {
        world.step();
        queries.ask(&world)
    });
    frames.sum()
}

#[test]
fn both_broad_phases_have_the_same_hits_in_a_world_at_rest() {
    for kind in FrameKind::ALL.into_iter().filter(|kind| *kind != FrameKind::None) {
        let [stock, ours] = [BroadPhaseBvh::new(), rapier_pbig::broad_phase()].map(|one| hits(kind, one));
        assert!(stock > 0 && ours > 0, "{}: {stock} and {ours}", kind.name());
        // A character that touches two colliders at once may slide along either.
        assert!(kind == FrameKind::Character || stock == ours, "{}: {stock} and {ours}", kind.name());
    }
}

#[test]
fn a_frame_is_a_step_and_its_queries() {
    for (kind, has_queries) in [(FrameKind::None, false), (FrameKind::Rays100, true)] {
        let scene = Scene::named("column").expect("the scene exists");
        let mut run = Run::new(scene, 50, 1, rapier_pbig::broad_phase()).with_queries(kind);
        (0..5).for_each(|_| run.step());
        assert_eq!(run.hits > 0, has_queries);
        for time in &run.times {
            assert_eq!((time.frame, time.queries > 0.0), (time.step + time.queries, has_queries));
        }
    }
}
