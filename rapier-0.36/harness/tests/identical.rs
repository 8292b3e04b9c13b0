//! What must not change a single bit: the number of threads, a second run, saving and restoring.

use pbig_harness_036::scenes::Scene;
use pbig_harness_036::world::{World, to_vector};
use rapier_pbig::{PbigConfig, Why};
use rapier3d::prelude::*;

fn scene(name: &str) -> Scene {
    Scene::named(name).expect("the scene exists")
}

/// The poses after some steps with pbig.
fn poses(name: &str, bodies: usize, steps: usize) -> Vec<u32> {
    let (mut world, mut broad_phase) = (scene(name).build(bodies, 1), rapier_pbig::broad_phase());
    for _ in 0..steps {
        world.step(&mut broad_phase);
    }
    world.pose_bits()
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

#[test]
fn a_restored_world_goes_on_as_if_it_had_never_been_saved() {
    for name in ["column", "mixed", "compounds", "ragdolls", "sensors", "pile"] {
        let (mut world, mut broad_phase) = (scene(name).build(150, 1), rapier_pbig::broad_phase());
        for _ in 0..50 {
            world.step(&mut broad_phase);
        }
        let bytes = world.to_bytes(&broad_phase);
        let (mut restored, mut second) = World::from_bytes(&bytes).expect("these are the bytes of a world");
        assert!(rapier_pbig::finder(&second).is_none(), "a finder is not saved");
        rapier_pbig::install(&mut second);
        for step in 0..60 {
            world.step(&mut broad_phase);
            restored.step(&mut second);
            assert!(world.pose_bits() == restored.pose_bits(), "{name}, step {step}");
        }
    }
}

/// The tree takes over when nobody installs pbig again, and pbig from the tree: the pile stays where it is.
#[test]
fn pbig_and_the_tree_take_over_from_each_other() {
    let (mut world, mut broad_phase) = (scene("pile").build(100, 1), BroadPhaseBvh::new());
    let pairs = |world: &World| {
        world.narrow_phase.contact_pairs().filter(|pair| pair.has_any_active_contact()).count()
    };
    for _ in 0..60 {
        world.step(&mut broad_phase);
    }
    let before = pairs(&world);
    for round in 0..6 {
        if round % 2 == 0 {
            rapier_pbig::install(&mut broad_phase);
        } else {
            rapier_pbig::uninstall(&mut broad_phase);
            assert!(rapier_pbig::finder(&broad_phase).is_none());
        }
        for (_, body) in world.bodies.iter_mut() {
            body.wake_up(true);
        }
        for _ in 0..20 {
            world.step(&mut broad_phase);
        }
        let now = pairs(&world);
        assert!(now.abs_diff(before) * 20 <= before, "round {round}: {before} contacts before, {now} now");
    }
}

#[test]
fn a_clone_goes_on_as_the_original() {
    let (mut world, mut broad_phase) = (scene("cubes").build(100, 1), rapier_pbig::broad_phase());
    for _ in 0..40 {
        world.step(&mut broad_phase);
    }
    let bytes = world.to_bytes(&broad_phase);
    let (mut copied, _) = World::from_bytes(&bytes).expect("these are the bytes of a world");
    let mut copy = broad_phase.clone();
    for _ in 0..40 {
        world.step(&mut broad_phase);
        copied.step(&mut copy);
    }
    assert!(world.pose_bits() == copied.pose_bits());
}

#[test]
fn a_body_whose_pose_is_no_number_disturbs_nobody() {
    let (mut world, mut broad_phase) = (scene("column").build(60, 1), rapier_pbig::broad_phase());
    let at = |x: f32| to_vector(glam::Vec3::new(x, 0.0, 0.0));
    let bodies: Vec<_> = world.bodies.iter().map(|(handle, _)| handle).collect();
    for step in 0..120 {
        match step {
            20 => world.bodies[bodies[3]].set_translation(at(f32::NAN), true),
            30 => world.bodies[bodies[4]].set_linvel(at(f32::INFINITY), true),
            40 => _ = world.add(World::dynamic(glam::Vec3::NAN), ColliderBuilder::ball(0.5)),
            _ => (),
        }
        world.step(&mut broad_phase);
        let finder = rapier_pbig::finder(&broad_phase).expect("it is installed");
        assert!(finder.last_error().is_none());
    }
    let low = world.bodies.iter().filter(|(_, body)| body.translation().y < -0.1).count();
    assert!(low <= 3, "{low} bodies fell through the ground");
}

#[test]
fn a_scene_that_never_asks_builds_no_tree_and_one_that_asks_finds_what_moved() {
    let (mut world, mut broad_phase) = (World::default(), rapier_pbig::broad_phase());
    let ball = world.add(World::dynamic(glam::Vec3::Y * 3.0), ColliderBuilder::ball(0.5));
    let hit = |world: &World, broad_phase: &BroadPhaseBvh| {
        let World { bodies, colliders, narrow_phase, .. } = world;
        let dispatcher = narrow_phase.query_dispatcher();
        let queries = broad_phase.as_query_pipeline(dispatcher, bodies, colliders, QueryFilter::default());
        let ray = Ray::new(to_vector(glam::Vec3::Y * 100.0), to_vector(-glam::Vec3::Y));
        queries.cast_ray(&ray, 200.0, true).map(|(_, distance)| 100.0 - distance)
    };
    for _ in 0..30 {
        world.step(&mut broad_phase);
        let top = hit(&world, &broad_phase).expect("the ray hits the ball");
        assert!((top - world.bodies[ball].translation().y - 0.5).abs() < 1e-3, "{top}");
    }
}

#[test]
fn questions_are_answered_and_bad_settings_are_errors() {
    let (mut world, mut broad_phase) = (World::default(), BroadPhaseBvh::new());
    let bad = PbigConfig { margin: f32::NAN, ..PbigConfig::DEFAULT };
    assert!(rapier_pbig::install_with(&mut broad_phase, bad).is_err());
    rapier_pbig::install(&mut broad_phase);
    let bodies =
        [0.0, 0.9, 5.0].map(|x| world.add(World::dynamic(glam::Vec3::X * x), ColliderBuilder::ball(0.5)));
    world.gravity = glam::Vec3::ZERO;
    world.step(&mut broad_phase);
    let finder = rapier_pbig::finder(&broad_phase).expect("it is installed");
    let [a, b, c] = bodies.map(|body| world.bodies[body].colliders()[0]);
    assert_eq!((finder.why(a, b), finder.pair_count(), finder.pairs().count()), (Why::Reported, 1, 1));
    assert!(matches!(finder.why(a, c), Why::Apart { axis: 0, .. }));
    assert_eq!((finder.stats().colliders, finder.stats().added), (3, 1));
}
