//! The number of threads, a second run, saving and restoring must not change a single bit.

use pbig_harness_036::build::world_of;
use pbig_harness_036::world::{dynamic, from_bytes, ground, pose_bits, to_bytes, to_vector, with};
use pbig_scenes::scenes::Scene;
use rapier::geometry::PairFinder;
use rapier::math::Real;
use rapier::parry::bounding_volume::BoundingVolume;
use rapier::prelude::*;
use rapier_pbig::{PbigConfig, PbigFinder, Why};

fn scene(name: &str) -> Scene {
    Scene::named(name).expect("the scene exists")
}

fn with_pbig(name: &str, bodies: usize) -> PhysicsWorld {
    world_of(&scene(name).plan(bodies, 1), rapier_pbig::broad_phase())
}

/// The poses after some steps with pbig.
fn poses(name: &str, bodies: usize, steps: usize) -> Vec<u64> {
    let mut world = with_pbig(name, bodies);
    (0..steps).for_each(|_| world.step());
    pose_bits(&world)
}

#[test]
fn a_second_run_and_any_number_of_threads_give_the_same_poses() {
    for (name, bodies, steps) in
        [("column", 9000, 12), ("mixed", 300, 60), ("rain", 3000, 40), ("groups", 300, 60)]
    {
        let wanted = poses(name, bodies, steps);
        for threads in [1, 2, 5] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            assert!(pool.install(|| poses(name, bodies, steps)) == wanted, "{name}, {threads} threads");
        }
    }
}

fn pbig_in(world: &PhysicsWorld) -> &PbigFinder {
    rapier_pbig::finder(&world.broad_phase).expect("it is installed")
}

/// The boxes, margins included, and the pairs.
fn state(world: &PhysicsWorld) -> impl PartialEq {
    pbig_in(world).state()
}

/// Queries find colliders in the order of their indices, so that the result of CCD does not depend on the past.
#[test]
fn what_a_box_meets_is_sorted_and_what_rapiers_tree_meets() {
    for bodies in [200, 3000] {
        let mut world = with_pbig("column", bodies);
        for step in 0..20 {
            world.step();
            let queries = world.query_pipeline();
            for (_, collider) in world.colliders.iter().step_by(97) {
                let reach = collider.compute_aabb().loosened(0.1 * step as Real);
                let index = |(found, _): (ColliderHandle, &Collider)| found.into_raw_parts().0;
                let of_index: Vec<u32> = queries.intersect_aabb_conservative(reach).map(index).collect();
                let tree = pbig_in(&world).tree();
                let mut of_tree: Vec<u32> = tree.leaves(|node| node.aabb().intersects(&reach)).collect();
                of_tree.sort_unstable();
                assert!(of_index == of_tree && !of_index.is_empty(), "{bodies} bodies, step {step}");
            }
        }
    }
}

/// The original has a tree, because it is asked. The restored finder and the clone have none.
#[test]
fn a_restored_world_and_a_clone_go_on_as_the_original() {
    for name in ["column", "cubes", "mixed", "compounds", "ragdolls", "sensors", "pile", "rain"] {
        let mut world = with_pbig(name, 150);
        (0..50).for_each(|_| world.step());
        // The index of the last collider is used again before the save, at the same place.
        let (last, collider) = world.colliders.iter().last().expect("there are colliders");
        let place = collider.translation();
        world.remove_collider(last);
        let (_, new) =
            world.insert(RigidBodyBuilder::dynamic().translation(place), ColliderBuilder::ball(0.1));
        assert_eq!(new.into_raw_parts().0, last.into_raw_parts().0);
        let bytes = to_bytes(&world);
        let [mut restored, mut copied] = [(); 2].map(|()| from_bytes(&bytes));
        assert!(!rapier_pbig::is_installed(&restored.broad_phase), "a finder is not saved");
        rapier_pbig::install(&mut restored.broad_phase);
        copied.broad_phase = world.broad_phase.clone();
        for step in 0..60 {
            _ = top(&world);
            world.step();
            for other in [&mut restored, &mut copied] {
                other.step();
                assert!(pose_bits(&world) == pose_bits(other), "{name}, step {step}");
                assert!(state(&world) == state(other), "{name}, step {step}");
            }
        }
    }
}

/// Returns the height at which a ray from above hits something.
fn top(world: &PhysicsWorld) -> Option<Real> {
    let ray = Ray::new(to_vector(glam::Vec3::Y * 100.0), to_vector(-glam::Vec3::Y));
    world.query_pipeline().cast_ray(&ray, 200.0, true).map(|(_, distance)| 100.0 - distance)
}

#[test]
fn only_a_scene_that_asks_has_an_index_and_it_finds_what_moved() {
    let mut world = with(rapier_pbig::broad_phase());
    let (ball, _) = world.insert(dynamic(glam::Vec3::Y * 3.0), ColliderBuilder::ball(0.5));
    let has_index = |world: &PhysicsWorld| {
        let finder = format!("{:?}", pbig_in(world));
        let [none, one] =
            ["fresh: OnceLock(<uninit>)", "fresh: OnceLock(Fresh {"].map(|text| finder.contains(text));
        assert_ne!(none, one, "{finder}");
        one
    };
    for _ in 0..30 {
        world.step();
        assert!(!has_index(&world));
    }
    for _ in 0..30 {
        world.step();
        let top = top(&world).expect("the ray hits the ball");
        assert!((top - world.bodies[ball].translation().y - 0.5).abs() < 1e-3, "{top}");
        assert!(has_index(&world));
    }
}

/// Until its first update a finder has seen nothing: rapier's tree answers, is saved, and takes over again.
#[test]
fn a_finder_before_its_first_update_hides_nothing() {
    let mut world = PhysicsWorld::new();
    world.colliders.insert(ground());
    let (ball, _) = world.insert(dynamic(glam::Vec3::Y * 3.0), ColliderBuilder::ball(0.5));
    (0..3).for_each(|_| world.step());
    let (before, saved) = (top(&world), to_bytes(&world));
    rapier_pbig::install(&mut world.broad_phase);
    assert!(before.is_some_and(|top| top > 3.0) && top(&world) == before);
    assert!(to_bytes(&world) == saved);
    rapier_pbig::uninstall(&mut world.broad_phase);
    (0..120).for_each(|_| world.step());
    assert!((world.bodies[ball].translation().y - 0.5).abs() < 0.02, "it fell through the ground");
}

#[test]
fn a_collider_whose_box_is_set_before_the_first_step_is_found() {
    for mut world in [BroadPhaseBvh::new(), rapier_pbig::broad_phase()].map(with) {
        world.insert(dynamic(glam::Vec3::X * 50.0), ColliderBuilder::ball(0.5));
        world.step();
        assert_eq!(top(&world), None);
        let (_, collider) = world.insert(dynamic(glam::Vec3::Y * 3.0), ColliderBuilder::ball(0.5));
        world.colliders[collider].set_translation(to_vector(glam::Vec3::Y * 3.0));
        let aabb = world.colliders[collider].compute_aabb();
        world.broad_phase.set_aabb(&world.integration_parameters, collider, aabb);
        assert_eq!(top(&world), Some(3.5));
        world.step();
        assert!(top(&world).is_some_and(|top| top > 3.4));
    }
}

#[test]
fn a_step_of_zero_length_keeps_the_finder() {
    let mut world = world_of(&scene("column").plan(60, 1), BroadPhaseBvh::new());
    for round in 0..6 {
        if round % 2 == 0 {
            rapier_pbig::install(&mut world.broad_phase);
        } else {
            rapier_pbig::uninstall(&mut world.broad_phase);
        }
        for dt in [0.0, 1.0 / 60.0, 0.0, 1.0 / 60.0, 0.0] {
            world.integration_parameters.dt = dt;
            world.step();
        }
    }
    world.integration_parameters.dt = 1.0 / 60.0;
    (0..120).for_each(|_| world.step());
    let low = world.bodies.iter().filter(|(_, body)| body.translation().y < -0.1).count();
    assert_eq!(low, 0, "{low} bodies fell through the ground");
}

#[test]
fn questions_are_answered_and_bad_settings_are_errors() {
    let mut world = PhysicsWorld { gravity: Vector::ZERO, ..PhysicsWorld::new() };
    let bad = PbigConfig { margin: f32::NAN, ..PbigConfig::DEFAULT };
    assert!(rapier_pbig::install_with(&mut world.broad_phase, bad).is_err());
    rapier_pbig::install(&mut world.broad_phase);
    let [a, b, c] =
        [0.0, 0.9, 5.0].map(|x| world.insert(dynamic(glam::Vec3::X * x), ColliderBuilder::ball(0.5)).1);
    world.step();
    let finder = pbig_in(&world);
    assert_eq!((finder.why(a, b), finder.pair_count(), finder.pairs().count()), (Why::Reported, 1, 1));
    assert!(matches!(finder.why(a, c), Why::Apart { axis: 0, .. }));
    assert_eq!((finder.stats().colliders, finder.stats().added), (3, 1));
}
