//! Scenes in rapier: the shadow check finds nothing, and the same scene gives the same bits.

use crate::checked::pbig;
use pbig_core::{Backend, Config, Engine};
use pbig_harness::runner::{Run, Timed};
use pbig_harness::scenes::Scene;
use pbig_harness::world::World;
use pbig_tests::{Way, on_threads};
use rapier_pbig::{PbigBroadPhase, PbigConfig};
use rapier3d::prelude::*;

/// Bodies in a test; `pbig simulate --check` runs the scenes at their full size.
const MOST_BODIES: usize = 1000;

fn check(scene: Scene, way: impl Into<Way>, steps: usize) {
    let way = way.into();
    let bodies = scene.default_bodies.min(MOST_BODIES);
    let mut run = Run::new(scene, bodies, 11, pbig(way)).checked(way.margin, 1);
    run.steps(steps, || ());
    if let Some(first) = run.broad_phase.first_difference() {
        panic!("{}: {first}; {:?}", scene.name, run.write_failure(scene.name, &std::env::temp_dir()));
    }
    let fallback = &run.broad_phase.inner.stats().report.fallback;
    assert_eq!(*fallback, None, "{}: a GPU's work must not be done by the CPU", scene.name);
    let checker = run.broad_phase.checker().expect("it is checked");
    assert!(checker.compared > 0 && checker.oracle_pairs > 0, "{}: nothing was compared", scene.name);
}

#[test]
fn every_scene_for_300_steps_beside_stock_and_the_oracle() {
    for scene in Scene::ALL {
        check(scene, Config::from(PbigConfig::DEFAULT), 300);
    }
}

#[test]
fn every_scene_on_every_strategy() {
    for strategy in pbig_tests::strategies() {
        let (name, way) = strategy;
        println!("{name}");
        // A software adapter takes its time.
        let steps = if name.starts_with("gpu") { 20 } else { 40 };
        for scene in Scene::ALL {
            check(scene, way.with(|it| it.margin = PbigConfig::DEFAULT.margin), steps);
        }
    }
}

fn bits(scene: Scene, config: Config, threads: usize, steps: usize) -> Vec<u32> {
    on_threads(threads, || {
        let bodies = scene.default_bodies.min(MOST_BODIES);
        let mut run = Run::new(scene, bodies, 5, pbig(config));
        (0..steps).for_each(|_| run.step());
        run.world.pose_bits()
    })
}

#[test]
fn a_scene_gives_the_same_bits_for_any_number_of_threads() {
    for scene in Scene::ALL {
        let wanted = bits(scene, PbigConfig::DEFAULT.into(), 1, 120);
        for threads in [1, 2] {
            let got = bits(scene, PbigConfig::DEFAULT.into(), threads, 120);
            assert!(got == wanted, "{} on {threads} threads differs", scene.name);
        }
    }
    let other = Run::new(Scene::ALL[0], 100, 6, PbigBroadPhase::new()).world.pose_bits();
    assert!(
        other != Run::new(Scene::ALL[0], 100, 5, PbigBroadPhase::new()).world.pose_bits(),
        "another seed differs"
    );
}

#[test]
fn every_strategy_gives_the_same_bits() {
    let scene = Scene::named("column").expect("the scene exists");
    let with = |backend, engine| Config { backend, engine, ..PbigConfig::DEFAULT.into() };
    let wanted = bits(scene, PbigConfig::DEFAULT.into(), 2, 120);
    let engines = Engine::ALL.map(|engine| with(Backend::Cpu, Some(engine)));
    let backends = [Backend::Brute, Backend::Device].map(|backend| with(backend, None));
    for config in engines.into_iter().chain(backends).filter(pbig_tests::may_run) {
        assert!(bits(scene, config, 2, 120) == wanted, "{config:?}");
    }
}

#[test]
fn a_sleeping_world_costs_no_checks() {
    let scene = Scene::named("sleeping").expect("the scene exists");
    let mut run = Run::new(scene, 4000, 1, PbigBroadPhase::new());
    // The awake body falls for a second before it lands on others.
    let (mut most, mut updates) = (0, 0);
    for step in 0..40 {
        run.step();
        let report = run.broad_phase.inner.stats().report;
        if step > 2 {
            most = most.max(report.checks.made);
            updates += report.changed;
        }
    }
    assert!(updates > 20, "the awake body moves");
    assert!(most > 0 && most < 500, "{most} checks in one update for one awake body");
}

#[test]
fn upstream_14_endless_falls_are_found_at_the_same_cost() {
    for (name, way) in crate::checked::backends() {
        let mut world = World::with_gravity(glam::Vec3::NEG_Y * 1e4);
        for i in 0..200 {
            let at = glam::vec3((i % 10) as f32 * 0.9, 0.0, (i / 10) as f32 * 0.9);
            world.add(World::dynamic(at).linear_damping(0.0), ColliderBuilder::ball(0.5));
        }
        let mut broad_phase = Timed::new(pbig(way)).checked(way.margin, 50);
        let mut most_bytes = 0;
        for _ in 0..if name == "cpu" { 2000 } else { 700 } {
            world.step(&mut broad_phase);
            let report = broad_phase.inner.stats().report;
            // A sweep tests each box against all, wherever they are.
            let most = if name == "cpu" { 200 * 200 } else { 60 * 200 };
            assert!(report.checks.made <= most, "{name}: {} checks: {}", report.checks.made, report.plan);
            most_bytes = postcard::to_stdvec(&broad_phase.inner).expect("a snapshot").len().max(most_bytes);
        }
        let depth = world.bodies.iter().map(|(_, b)| b.translation().y).fold(0.0, f32::min);
        assert!(depth < -1e5, "{name}: fell to {depth}");
        assert!(most_bytes < 200 * 100, "{name}: {most_bytes} bytes");
        assert!(broad_phase.first_difference().is_none(), "{name}: {:?}", broad_phase.first_difference());
    }
}

#[test]
fn a_large_world_gives_the_same_bits_on_one_and_two_threads() {
    let scene = Scene::named("column").expect("the scene exists");
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| {
            let mut run = Run::new(scene, 6000, 5, PbigBroadPhase::new());
            (0..60).for_each(|_| run.step());
            run.world.pose_bits()
        })
    };
    assert!(run(1) == run(2));
}
