//! A world in f64 far from the origin has the pairs of one at the origin, and its checkers find no difference.
#![cfg(feature = "f64")]

use glam::Vec3;
use pbig_harness_036::world::{ground, to_vector};
use rapier::prelude::*;
use rapier_pbig::PbigFinder;
use rapier_pbig::shadow::{Shadow, checker};

/// Returns the number of pairs after the first step of a heap at a distance along x.
fn pairs(distance: f64) -> usize {
    let mut world = PhysicsWorld::new();
    let finder = PbigFinder::default().with_shadow(Shadow::Stock).with_shadow(Shadow::Oracle);
    rapier_pbig::install_finder(&mut world.broad_phase, finder);
    world.colliders.insert(ground());
    for i in 0..400u16 {
        let [x, y] = [i % 20, i / 20].map(|k| 0.97 * f32::from(k));
        let at = to_vector(Vec3::new(x, y + 0.5, 0.0)) + Vector::X * distance;
        world.insert(RigidBodyBuilder::dynamic().translation(at), ColliderBuilder::ball(0.5));
    }
    let mut count = 0;
    for step in 0..40 {
        world.step();
        if step == 0 {
            count = rapier_pbig::finder(&world.broad_phase).expect("it is installed").pair_count();
        }
    }
    let checker = checker(&world.broad_phase).expect("it was added");
    assert!(checker.differences.is_empty(), "at {distance}: {}", checker.differences[0]);
    assert!(checker.compared > 30 && checker.oracle_pairs > 10_000, "{}", checker.oracle_pairs);
    count
}

#[test]
fn a_far_world_has_the_pairs_of_one_at_the_origin() {
    let near = pairs(0.0);
    for distance in [1e7, -6.4e6, 1e9] {
        let far = pairs(distance);
        assert!(near > 700 && far.abs_diff(near) * 100 <= near, "{near} at the origin, {far} at {distance}");
    }
}
