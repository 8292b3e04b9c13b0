//! `PbigBroadPhase::overlapped`: what was found ahead, together with what is found at once, is complete in every call.

use crate::checked::backends;
use pbig_core::gpu::Fault;
use pbig_core::{Backend, Coding, Config, GpuFinder, GpuOptions};
use pbig_harness::runner::Run;
use pbig_harness::scenes::Scene;
use pbig_harness::shadow::Shadowed;
use pbig_harness::simulate::{Task, run_checked};
use pbig_harness::world::World;
use pbig_tests::needs_gpu;
use rapier_pbig::PbigBroadPhase;
use rapier_pbig::shadow::Shadow;
use rapier3d::prelude::*;
use std::time::Duration;

fn ours(config: Config) -> PbigBroadPhase {
    PbigBroadPhase::with_config(config).overlapped()
}

fn check(scene: Scene, broad_phase: PbigBroadPhase, bodies: usize, steps: usize) -> PbigBroadPhase {
    let task = Task { scene, bodies: scene.default_bodies.min(bodies), steps, seed: 11 };
    let folder = std::env::temp_dir();
    let (outcome, broad_phase) = run_checked(task, broad_phase, f32::INFINITY, &folder, |_| ());
    let check = outcome.check.as_ref().expect("a check was asked for");
    assert!(!outcome.failed(), "{}: {}", scene.name, check.differences[0]);
    assert!(check.calls > 0 && check.oracle_pairs > 0, "{}: nothing was compared", scene.name);
    broad_phase
}

#[test]
fn every_scene_beside_stock_and_the_oracle() {
    for scene in Scene::ALL {
        check(scene, ours(PbigBroadPhase::CONFIG), 200, 120);
    }
}

#[test]
fn every_scene_on_a_gpu() {
    needs_gpu!();
    for scene in Scene::ALL {
        let broad_phase =
            check(scene, ours(Config { margin: 0.01, ..pbig_tests::gpu(Coding::Plain) }), 100, 20);
        assert_eq!(broad_phase.stats().report.fallback, None, "{}", scene.name);
    }
}

#[test]
fn the_checker_that_is_built_in_knows_of_it() {
    let scene = Scene::named("rain").expect("the scene exists");
    let before = PbigBroadPhase::new().with_shadow(Shadow::Oracle).overlapped();
    let after = PbigBroadPhase::new().overlapped().with_shadow(Shadow::Oracle);
    for broad_phase in [before, after] {
        let mut run = Run::new(scene, 200, 5, broad_phase);
        (0..60).for_each(|_| run.step());
        let differences = run.broad_phase.inner.differences();
        assert!(differences.is_empty(), "{}", differences[0]);
    }
}

#[test]
fn a_scene_gives_the_same_bits_on_every_backend_and_from_a_snapshot_or_a_clone() {
    for name in ["column", "ragdolls"] {
        let mut ends = Vec::new();
        for (backend, config) in backends() {
            let mut world = Scene::named(name).expect("the scene exists").build(120, 3);
            let (mut broad_phase, mut begun) = (ours(config), 0);
            for step in 0..50 {
                world.step(&mut broad_phase);
                begun += broad_phase.stats().overlapped.map_or(0, |overlapped| overlapped.begun);
                if step == 20 {
                    let bytes = postcard::to_stdvec(&broad_phase).expect("a snapshot");
                    broad_phase = postcard::from_bytes(&bytes).expect("what was saved");
                } else if step == 30 {
                    broad_phase = broad_phase.clone();
                }
            }
            assert!(begun > 1000, "{name} on {backend}: {begun} boxes in searches ahead");
            ends.push(world.pose_bits());
        }
        assert!(ends.iter().all(|end| *end == ends[0]), "{name}: one backend and another");
    }
}

/// Balls that fall freely, until they are made to turn.
fn falling(broad_phase: PbigBroadPhase) -> (World, Shadowed<PbigBroadPhase>) {
    let mut world = World::with_gravity(glam::Vec3::NEG_Y * 10.0);
    for i in 0..60 {
        let at = glam::vec3((i % 8) as f32 * 1.5, 0.0, (i / 8) as f32 * 1.5);
        world.add(World::dynamic(at).linvel(vector![3.0, 0.0, 0.0]), ColliderBuilder::ball(0.5));
    }
    (world, Shadowed::new(broad_phase, f32::INFINITY))
}

#[test]
fn bodies_that_go_where_they_are_expected_are_not_searched_for_again() {
    for (name, config) in backends() {
        let (mut world, mut broad_phase) = falling(ours(config));
        world.step(&mut broad_phase);
        for step in 1..40 {
            if step == 30 {
                world
                    .bodies
                    .iter_mut()
                    .take(7)
                    .for_each(|(_, body)| body.set_linvel(vector![-9.0, 0.0, 0.0], true));
            }
            world.step(&mut broad_phase);
            let stats = broad_phase.inner.stats();
            let ahead = stats.overlapped.expect("it is on");
            // Those that were searched for at once are stored where they are going.
            let (turned, had_turned) = (7 * usize::from(step == 30), 7 * u64::from(step == 31));
            assert_eq!((ahead.begun, ahead.left), (60 - turned, turned), "{name}, step {step}");
            assert_eq!(ahead.report.changed, 60 - had_turned, "{name}, step {step}: what was begun before");
            assert_eq!(stats.report.changed, turned as u64, "{name}, step {step}: at once");
            assert_eq!(ahead.report.gpu.is_some(), name == "gpu");
        }
        assert!(broad_phase.first_difference().is_none(), "{name}: {:?}", broad_phase.first_difference());
    }
}

#[test]
fn a_world_that_comes_to_rest_is_told_the_last_events_and_then_costs_nothing() {
    let mut world = World::with_gravity(glam::Vec3::ZERO);
    let near = |x: f32| World::dynamic(glam::Vec3::X * x).can_sleep(false);
    let bodies = [0.0, 5.0].map(|x| world.add(near(x), ColliderBuilder::ball(0.5)));
    let mut broad_phase = Shadowed::new(ours(PbigBroadPhase::CONFIG), f32::INFINITY);
    world.bodies[bodies[1]].set_linvel(vector![-210.0, 0.0, 0.0], true);
    // Expected 3.5 m further each step, it is stopped where it has come to.
    world.step(&mut broad_phase);
    assert_eq!(broad_phase.inner.pair_count(), 0);
    world.bodies[bodies[1]].set_linvel(Vector::zeros(), true);
    let before = broad_phase.inner.stats().totals;
    world.bodies.iter_mut().for_each(|(_, body)| body.sleep());
    world.step(&mut broad_phase);
    let after = broad_phase.inner.stats().totals;
    assert_eq!((after.updates - before.updates, after.added - before.added), (2, 1), "found ahead");
    let events = broad_phase.inner.stats().totals;
    (0..3).for_each(|_| world.step(&mut broad_phase));
    assert_eq!(broad_phase.inner.stats().totals.added, events.added);
    assert_eq!(broad_phase.inner.stats().overlapped.expect("it is on").begun, 0);
    assert!(broad_phase.first_difference().is_none(), "{:?}", broad_phase.first_difference());
}

#[test]
fn a_device_that_fails_between_two_calls_loses_no_pair() {
    needs_gpu!();
    let scene = Scene::named("column").expect("the scene exists");
    let options = GpuOptions { pause: Duration::ZERO, ..GpuOptions::DEFAULT };
    let config = Config { margin: 0.01, gpu: options, ..pbig_tests::gpu(Coding::Plain) };
    let device = GpuFinder::new().expect("an adapter");
    let other = device.clone();
    let mut run = Run::new(
        scene,
        100,
        5,
        Shadowed::new(PbigBroadPhase::with_gpu(config, device).overlapped(), f32::INFINITY),
    );
    let mut fallbacks = 0;
    for step in 0..30 {
        if step == 10 {
            other.inject(Fault::Timeout, 0);
        }
        run.step();
        let stats = run.broad_phase.inner.inner.stats();
        fallbacks += usize::from(stats.overlapped.expect("it is on").report.fallback.is_some());
    }
    assert!(fallbacks > 0, "the search that had begun has failed");
    let shadow = &run.broad_phase.inner;
    assert!(shadow.first_difference().is_none(), "{:?}", shadow.first_difference());
}

#[test]
fn colliders_that_are_replaced_while_a_search_is_on_its_way() {
    for (name, config) in backends() {
        let config = Config { backend: if name == "gpu" { Backend::Gpu } else { config.backend }, ..config };
        let (mut world, mut broad_phase) = falling(ours(config));
        for step in 0..20 {
            world.step(&mut broad_phase);
            let handles: Vec<_> = world.bodies.iter().map(|(handle, _)| handle).collect();
            // The next body takes the index of the one that goes, and its place or another.
            let at = *world.bodies[handles[step]].translation() + vector![0.0, 0.0, (step % 3) as f32];
            world.remove(handles[step]);
            world.add(RigidBodyBuilder::dynamic().translation(at), ColliderBuilder::ball(0.9));
            if step % 5 == 0 {
                let Shadowed { inner, checker } = &mut broad_phase;
                inner.adopt(&world.narrow_phase);
                checker.start_over(world.pairs());
            }
        }
        assert!(broad_phase.inner.pair_count() > 20, "{name}: {} pairs", broad_phase.inner.pair_count());
        assert!(broad_phase.first_difference().is_none(), "{name}: {:?}", broad_phase.first_difference());
    }
}
