//! Snapshots: our state restored goes on bit by bit; another world is noticed; no bytes do harm. Random worlds are restored,
//! and handed to fresh broad phases, at any moment.

use crate::checked::{backends, on_gpu, on_its_device, pbig};
use pbig_core::Config;
use pbig_harness::scenes::Scene;
use pbig_harness::world::World;
use pbig_tests::needs_gpu;
use rapier_pbig::shadow::Shadow;
use rapier_pbig::{PbigBroadPhase, PbigConfig};
use rapier3d::prelude::*;
use std::collections::BTreeSet;

fn saved(broad_phase: &PbigBroadPhase) -> Vec<u8> {
    postcard::to_stdvec(broad_phase).expect("a snapshot")
}

fn restored(bytes: &[u8]) -> PbigBroadPhase {
    postcard::from_bytes(bytes).expect("what was saved")
}

fn copy(world: &World) -> World {
    World::from_bytes(&world.to_bytes()).expect("what was saved")
}

fn scene(name: &str, bodies: usize) -> World {
    Scene::named(name).expect("the scene exists").build(bodies, 3)
}

fn steps(world: &mut World, broad_phase: &mut dyn BroadPhase, steps: usize) {
    (0..steps).for_each(|_| world.step(broad_phase));
}

#[test]
fn upstream_910_966_a_restored_one_and_a_clone_resume_bit_by_bit() {
    for name in ["column", "groups", "compounds", "ragdolls", "sensors"] {
        let mut ends = Vec::new();
        for (backend, way) in backends() {
            let (mut world, mut ours) = (scene(name, 300), pbig(way));
            steps(&mut world, &mut ours, 40);
            let before = copy(&world);
            let again = [on_its_device(way, restored(&saved(&ours))), ours.clone()];
            steps(&mut world, &mut ours, 30);
            for mut again in again {
                let mut other = copy(&before);
                steps(&mut other, &mut again, 30);
                assert!(world.pose_bits() == other.pose_bits(), "{name} on {backend}: restored and not");
                assert_eq!(saved(&ours), saved(&again), "{name} on {backend}");
            }
            assert!(ours.pair_count() > 0, "{name}: nothing to compare");
            ends.push(world.pose_bits());
        }
        assert!(ends.iter().all(|end| *end == ends[0]), "{name}: one backend and another");
    }
}

#[test]
fn a_snapshot_holds_no_device() {
    needs_gpu!();
    let without = PbigBroadPhase::with_core_config(on_gpu().config).expect("a length");
    let [(mut world, with), (_, without)] = [pbig(on_gpu()), without].map(|mut ours| {
        let mut world = scene("column", 60);
        steps(&mut world, &mut ours, 40);
        (world, ours)
    });
    assert_eq!(saved(&with), saved(&without));
    let mut again = restored(&saved(&with));
    steps(&mut world, &mut again, 1);
    let devices = [&with, &again].map(|one| one.stats().report.device.is_some());
    let why = again.stats().report.fallback.clone().unwrap_or_default();
    assert!(devices == [true, false] && why.starts_with("no device was given"), "{devices:?}, {why}");
}

#[test]
fn upstream_675_710_899_options_survive_a_snapshot_and_json() {
    let config = Config { margin: 0.03, ..PbigConfig::DEFAULT.into() };
    let (mut world, mut ours) = (scene("column", 60), pbig(config));
    steps(&mut world, &mut ours, 20);
    let json = serde_json::to_string(&ours).expect("JSON");
    let again: PbigBroadPhase = serde_json::from_str(&json).expect("what was saved");
    assert_eq!(saved(&again), saved(&ours));
    assert!(format!("{again:?}").contains("margin: 0.03"), "{again:?}");
}

#[test]
fn a_rescan_happens_once_and_only_where_a_collider_is_unknown() {
    // A pile that sleeps on a fixed ground: rapier lists none of its colliders to a fresh broad phase.
    let (mut world, mut ours) = (World::default(), PbigBroadPhase::new());
    world.colliders.insert(ColliderBuilder::cuboid(20.0, 0.5, 20.0));
    for i in 0..30 {
        let at = vector![(i % 5) as f32 * 1.02, 1.0 + (i / 5) as f32 * 1.01, 0.0];
        world.add(RigidBodyBuilder::dynamic().translation(at), ColliderBuilder::cuboid(0.5, 0.5, 0.5));
    }
    steps(&mut world, &mut ours, 400);
    assert!(world.bodies.iter().all(|(_, body)| body.is_sleeping()), "the pile sleeps");
    world = copy(&world);
    let mut fresh = PbigBroadPhase::new();
    let mut rescans = Vec::new();
    for _ in 0..3 {
        let (World { params, colliders, bodies, .. }, events) = (&world, &mut Vec::new());
        fresh.update(params, colliders, bodies, &[], &[], events);
        rescans.push(fresh.stats().totals.rescans);
        assert_eq!(events.is_empty(), rescans.len() > 1);
        world.step(&mut fresh);
    }
    assert_eq!((rescans, fresh.stats().totals.rescans), (vec![1; 3], 1));
    assert_eq!((fresh.stats().colliders, fresh.pair_count() > 30), (31, true));
}

#[test]
fn a_shadow_may_come_before_or_after_an_adoption() {
    for after in [false, true] {
        let mut world = scene("column", 100);
        steps(&mut world, &mut DefaultBroadPhase::new(), 40);
        let shadowed = |ours: PbigBroadPhase| ours.with_shadow(Shadow::Stock).with_shadow(Shadow::Oracle);
        let mut ours = PbigBroadPhase::new();
        if !after {
            ours = shadowed(ours);
        }
        ours.adopt(&world.narrow_phase);
        if after {
            ours = shadowed(ours);
        }
        steps(&mut world, &mut ours, 30);
        assert!(ours.differences().is_empty(), "{after}: {}", ours.differences()[0]);
        assert!(ours.pair_count() > 50);
    }
}

#[test]
fn a_world_replaced_by_a_smaller_or_larger_one_is_noticed() {
    let mut ours = PbigBroadPhase::new();
    for bodies in [50, 20, 80] {
        let mut world = scene("column", bodies);
        let known = world.colliders.len();
        let rescans = ours.stats().totals.rescans;
        // As after a restore: nothing is listed as modified.
        steps(&mut world, &mut DefaultBroadPhase::new(), 30);
        let (World { params, colliders, bodies, .. }, events) = (&world, &mut Vec::new());
        ours.update(params, colliders, bodies, &[], &[], events);
        let mut fresh = PbigBroadPhase::new();
        fresh.update(params, colliders, bodies, &[], &[], &mut Vec::new());
        assert_eq!((ours.stats().colliders, fresh.stats().colliders), (known, known));
        let parts = |pair: ColliderPair| [pair.collider1, pair.collider2].map(ColliderHandle::into_raw_parts);
        let pairs =
            |broad_phase: &PbigBroadPhase| -> BTreeSet<_> { broad_phase.pairs().map(parts).collect() };
        assert!(ours.stats().totals.rescans > rescans && !pairs(&fresh).is_empty());
        assert_eq!(pairs(&ours), pairs(&fresh), "nothing of the old world is left");
    }
}

#[test]
fn changed_bytes_are_an_error_or_never_panic_later() {
    let (mut world, mut ours) = (scene("column", 12), PbigBroadPhase::new());
    steps(&mut world, &mut ours, 60);
    let bytes = saved(&ours);
    let handles: Vec<ColliderHandle> = world.colliders.iter().map(|(handle, _)| handle).collect();
    let (mut errors, mut loaded) = (0, 0);
    let dispatcher = rapier3d::parry::query::DefaultQueryDispatcher;
    for i in 0..bytes.len() {
        for change in [1, 0x80] {
            let mut broken = bytes.clone();
            broken[i] ^= change;
            let Ok(mut other) = postcard::from_bytes::<PbigBroadPhase>(&broken) else {
                errors += 1;
                continue;
            };
            loaded += 1;
            let World { params, colliders, bodies, .. } = &world;
            other.update(params, colliders, bodies, &handles, &handles[..3], &mut Vec::new());
            other.update(params, colliders, bodies, &handles, &[], &mut Vec::new());
            let pairs: Vec<ColliderPair> = other.pairs().collect();
            pairs.iter().for_each(|pair| _ = other.why(pair.collider1, pair.collider2).to_string());
            let queries = other.as_query_pipeline(&dispatcher, bodies, colliders, QueryFilter::default());
            let ray = Ray::new(point![0.0, 90.0, 0.0], -Vector::y());
            queries.cast_ray(&ray, 1e3, true);
            assert!(!saved(&other).is_empty());
        }
        assert!(postcard::from_bytes::<PbigBroadPhase>(&bytes[..i]).is_err(), "cut at {i}");
    }
    assert!(errors > 50 && loaded > 50, "{errors} errors, {loaded} loaded");
}

/// Rapier's own broad phase overflows the stack in this world, which no checker can catch.
#[test]
fn a_shadow_survives_removals_that_leave_one_collider() {
    let mut world = World::default();
    let mut ours = PbigBroadPhase::new().with_shadow(Shadow::Stock);
    let ball = |world: &mut World, x: f32| {
        let body =
            RigidBodyBuilder::dynamic().translation(vector![x, 10.0, 0.0]).linvel(vector![3.0, 0.0, 0.0]);
        world.add(body, ColliderBuilder::ball(0.5))
    };
    for steps_before in 3..6 {
        let balls = [10.0, 20.0, 30.0].map(|x| ball(&mut world, x));
        steps(&mut world, &mut ours, steps_before);
        balls[..2].iter().for_each(|&gone| world.remove(gone));
        steps(&mut world, &mut ours, 1);
        let more = [31.0, 32.0].map(|x| ball(&mut world, x));
        steps(&mut world, &mut ours, 16);
        assert!(ours.differences().is_empty(), "{}", ours.differences()[0]);
        world.remove(balls[2]);
        more.iter().for_each(|&gone| world.remove(gone));
        steps(&mut world, &mut ours, 1);
    }
    assert_eq!(ours.pair_count(), 0);
}
