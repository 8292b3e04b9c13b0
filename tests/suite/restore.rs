//! Snapshots: our state restored goes on bit by bit; a fresh broad phase beside a restored world misses nothing.

use crate::checked::{backends, everywhere, on_its_device, pbig};
use pbig_core::{Backend, Config};
use pbig_gpu::GpuFinder;
use pbig_harness::runner::Timed;
use pbig_harness::scenes::Scene;
use pbig_harness::world::World;
use pbig_tests::{Way, needs_gpu};
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

/// Two colliders in either order.
fn unordered(pair: ColliderPair) -> [(u32, u32); 2] {
    let [a, b] = [pair.collider1, pair.collider2].map(|handle| handle.into_raw_parts());
    [a.min(b), a.max(b)]
}

/// Pairs of the narrow phase.
fn edges(world: &World) -> BTreeSet<[(u32, u32); 2]> {
    world.pairs().map(unordered).collect()
}

#[test]
fn upstream_910_966_a_restored_broad_phase_resumes_bit_by_bit() {
    for name in ["column", "groups", "compounds", "ragdolls", "sensors"] {
        let mut ends = Vec::new();
        for (backend, way) in backends() {
            let (mut world, mut ours) = (scene(name, 300), pbig(way));
            steps(&mut world, &mut ours, 40);
            let (mut other, mut again) = (copy(&world), on_its_device(way, restored(&saved(&ours))));
            steps(&mut world, &mut ours, 30);
            steps(&mut other, &mut again, 30);
            assert!(world.pose_bits() == other.pose_bits(), "{name} on {backend}: restored and not");
            assert_eq!(saved(&ours), saved(&again), "{name} on {backend}");
            assert!(ours.pair_count() > 0, "{name}: nothing to compare");
            ends.push(world.pose_bits());
        }
        assert!(ends.iter().all(|end| *end == ends[0]), "{name}: one backend and another");
    }
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

/// A pile that sleeps on a fixed ground, and its broad phase.
fn sleeping_pile(way: impl Into<Way>) -> (World, PbigBroadPhase) {
    let (mut world, mut ours) = (World::default(), pbig(way));
    world.colliders.insert(ColliderBuilder::cuboid(20.0, 0.5, 20.0));
    for i in 0..30 {
        let at = vector![(i % 5) as f32 * 1.02, 1.0 + (i / 5) as f32 * 1.01, 0.0];
        world.add(RigidBodyBuilder::dynamic().translation(at), ColliderBuilder::cuboid(0.5, 0.5, 0.5));
    }
    steps(&mut world, &mut ours, 400);
    assert!(world.bodies.iter().all(|(_, body)| body.is_sleeping()), "the pile sleeps");
    (world, ours)
}

#[test]
fn a_fresh_broad_phase_finds_sleeping_and_fixed_colliders() {
    for (name, way) in backends() {
        let (mut world, ours) = sleeping_pile(way);
        let before = edges(&world);
        let mut fresh = Timed::new(pbig(way)).checked(way.margin, 1);
        world = copy(&world);
        world
            .add(RigidBodyBuilder::dynamic().translation(vector![0.0, 8.0, 0.0]), ColliderBuilder::ball(0.4));
        world.step(&mut fresh);
        assert!(edges(&world).is_superset(&before), "{name}");
        assert_eq!(fresh.inner.pair_count(), ours.pair_count(), "{name}: the pairs of the pile");
        (0..120).for_each(|_| world.step(&mut fresh));
        assert!(fresh.first_difference().is_none(), "{name}: {}", fresh.first_difference().expect("one"));
        let ball = world.bodies.iter().last().expect("the ball").1;
        assert!(ball.translation().y > 1.0, "{name}: the ball fell through");
    }
}

#[test]
fn a_device_is_given_at_the_start_or_after_a_restore() {
    needs_gpu!();
    let config = PbigConfig { backend: Backend::Device, ..PbigConfig::DEFAULT };
    let gpu = || GpuFinder::new().expect("an adapter");
    let (mut world, mut ours) =
        (scene("column", 100), PbigBroadPhase::with_device(config, Box::new(gpu())).expect("a length"));
    steps(&mut world, &mut ours, 20);
    let (mut other, mut again) = (copy(&world), restored(&saved(&ours)));
    assert!(again.device_name().is_none(), "a snapshot holds no device");
    again.set_device(Box::new(gpu()));
    steps(&mut world, &mut ours, 20);
    steps(&mut other, &mut again, 20);
    for broad_phase in [&ours, &again] {
        assert!(broad_phase.device_name().is_some() && broad_phase.stats().report.device.is_some());
    }
    assert!(world.pose_bits() == other.pose_bits());
}

#[test]
fn a_rescan_happens_once_and_only_where_a_collider_is_unknown() {
    let (world, _) = sleeping_pile(Config::from(PbigConfig::DEFAULT));
    let mut world = copy(&world);
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
fn adopted_pairs_end_if_apart_and_are_not_added_again() {
    everywhere(|mut scene| {
        let (a, _) = scene.ball(0.0);
        let (b, _) = scene.ball(0.9);
        scene.ball(1.8);
        assert_eq!((scene.step(), scene.contacts()), (2, 2));
        scene.world = copy(&scene.world);
        scene.move_to(a, 50.0);
        let mut fresh = pbig(scene.way);
        fresh.adopt(&scene.world.narrow_phase);
        // Not the fresh one's own: it follows what the narrow phase was told, by whomever.
        let mut counted = Timed::new(fresh);
        scene.world.step(&mut counted);
        assert_eq!((counted.added, counted.removed), (0, 1));
        assert_eq!((scene.contacts(), counted.inner.pair_count()), (1, 1));
        scene.broad_phase.inner = counted.inner;
        scene.world.remove(b);
        scene.world.step(&mut scene.broad_phase);
        assert_eq!(scene.contacts(), 0);
    });
}

#[test]
fn a_running_world_goes_over_from_rapiers_broad_phase_to_ours() {
    let (mut world, mut stock) = (scene("column", 200), DefaultBroadPhase::new());
    steps(&mut world, &mut stock, 60);
    let mut ours = PbigBroadPhase::new();
    ours.adopt(&world.narrow_phase);
    world.step(&mut ours);
    let known: BTreeSet<_> = ours.pairs().map(unordered).collect();
    assert_eq!(known, edges(&world), "both know the same pairs");
    let mut shadow = Timed::new(ours).checked(PbigConfig::DEFAULT.margin, 1);
    shadow.watcher.as_mut().expect("it is checked").start_over_with(shadow.inner.pairs());
    steps(&mut world, &mut shadow, 60);
    assert!(shadow.first_difference().is_none(), "{}", shadow.first_difference().expect("one"));
}

#[test]
fn a_clone_goes_on_as_the_original() {
    for (name, config) in backends() {
        let (mut world, mut ours) = (scene("column", 150), pbig(config));
        steps(&mut world, &mut ours, 30);
        let (mut other, mut again) = (copy(&world), ours.clone());
        steps(&mut world, &mut ours, 30);
        steps(&mut other, &mut again, 30);
        assert!(world.pose_bits() == other.pose_bits() && saved(&ours) == saved(&again), "{name}");
    }
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
        let pairs =
            |broad_phase: &PbigBroadPhase| -> BTreeSet<_> { broad_phase.pairs().map(unordered).collect() };
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
