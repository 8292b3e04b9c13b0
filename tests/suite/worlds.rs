//! Scenes in rapier: the shadow check finds nothing, and the same scene gives the same bits.

use crate::checked::pbig;
use pbig_core::{Backend, Config, Engine};
use pbig_harness::runner::Run;
use pbig_harness::scenes::Scene;
use pbig_tests::{Way, on_threads};
use rapier_pbig::{PbigBroadPhase, PbigConfig};

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

fn bits(scene: Scene, bodies: usize, config: Config, threads: usize) -> Vec<u32> {
    on_threads(threads, || {
        let mut run = Run::new(scene, bodies, 5, pbig(config));
        (0..120_000 / bodies.max(1000)).for_each(|_| run.step());
        run.world.pose_bits()
    })
}

#[test]
fn a_scene_gives_the_same_bits_for_any_number_of_threads() {
    let small = Scene::ALL.map(|scene| (scene, scene.default_bodies.min(MOST_BODIES)));
    // Enough bodies for several threads.
    let large = (Scene::named("column").expect("the scene exists"), 6000);
    for (scene, bodies) in small.into_iter().chain([large]) {
        let [wanted, again, other] =
            [1, 1, 2].map(|threads| bits(scene, bodies, PbigConfig::DEFAULT.into(), threads));
        assert!(wanted == again && wanted == other, "{}", scene.name);
    }
    let seeded = |seed| Run::new(Scene::ALL[0], 100, seed, PbigBroadPhase::new()).world.pose_bits();
    assert!(seeded(5) != seeded(6), "another seed differs");
}

#[test]
fn every_strategy_gives_the_same_bits() {
    let scene = Scene::named("column").expect("the scene exists");
    let with = |backend, engine| Config { backend, engine, ..PbigConfig::DEFAULT.into() };
    let wanted = bits(scene, MOST_BODIES, PbigConfig::DEFAULT.into(), 2);
    let engines = Engine::ALL.map(|engine| with(Backend::Cpu, Some(engine)));
    let backends = [Backend::Brute, Backend::Device].map(|backend| with(backend, None));
    for config in engines.into_iter().chain(backends).filter(pbig_tests::may_run) {
        assert!(bits(scene, MOST_BODIES, config, 2) == wanted, "{config:?}");
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
