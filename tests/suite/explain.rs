//! Everything that a user sees: reasons, statistics, spans, and the shadow.

use crate::checked::{Checked, everywhere, pbig};
use pbig_core::{Backend, Config, Engine};
use pbig_harness::files::read_frames;
use pbig_harness::scenes::Scene;
use pbig_harness::world::World;
use pbig_tests::{Way, needs_gpu};
use rapier_pbig::shadow::{Fault, Shadow};
use rapier_pbig::{PbigBroadPhase, PbigConfig, Why};
use rapier3d::prelude::*;
use std::cell::RefCell;
use std::collections::BTreeSet;

#[test]
fn why_names_the_test_that_ended_a_pair() {
    everywhere(|mut scene| {
        let (_, a) = scene.ball(0.0);
        let (b_body, b) = scene.ball(0.9);
        let c = scene.attach(b_body);
        let (_, far) = scene.ball(10.0);
        let early = scene.broad_phase.inner.why(a, b);
        assert_eq!(early, Why::Unknown(a.into_raw_parts().into()), "before the first step");
        scene.step();
        let why = |scene: &Checked, x, y| scene.broad_phase.inner.why(x, y);
        assert_eq!(why(&scene, a, b), Why::Reported);
        assert_eq!(why(&scene, a, a), Why::SameCollider);
        assert_eq!(why(&scene, b, c), Why::SameBody);
        assert!(matches!(why(&scene, a, far), Why::Apart { axis: 0, gap } if (gap - 8.978).abs() < 1e-3));
        scene.world.colliders[a].set_collision_groups(InteractionGroups::none());
        scene.step();
        assert!(matches!(why(&scene, a, b), Why::Groups(_)));
        scene.world.colliders[a].set_enabled(false);
        scene.step();
        assert_eq!(why(&scene, a, b), Why::Disabled(a.into_raw_parts().into()));
        scene.world.remove_collider(far);
        scene.step();
        assert_eq!(why(&scene, b, far), Why::Unknown(far.into_raw_parts().into()));
    });
}

#[test]
fn why_speaks_of_kinds_and_of_boxes_without_a_place() {
    let mut world = World::with_gravity(glam::Vec3::ZERO);
    let fixed = [0.0, 0.1]
        .map(|x| world.colliders.insert(ColliderBuilder::ball(0.5).translation(vector![x, 0.0, 0.0])));
    let mut broad_phase = PbigBroadPhase::new();
    world.step(&mut broad_phase);
    let why = broad_phase.why(fixed[0], fixed[1]);
    assert!(matches!(why, Why::BodyTypes(_)), "{why}");
    assert!(why.to_string().contains("a fixed and a fixed body"), "{why}");
    let lost = ColliderBuilder::ball(0.5).translation(vector![f32::NAN, 0.0, 0.0]);
    let lost = world.colliders.insert(lost);
    let World { params, colliders, bodies, .. } = &world;
    broad_phase.update(params, colliders, bodies, &[lost], &[], &mut Vec::new());
    assert_eq!(broad_phase.why(fixed[0], lost), Why::InvalidBox(lost.into_raw_parts().into()));
    broad_phase.adopt(&world.narrow_phase);
    assert_eq!(
        broad_phase.why(fixed[0], fixed[1]),
        Why::Unknown(fixed[0].into_raw_parts().into()),
        "before the next update"
    );
}

#[test]
fn statistics_count_what_an_update_was_given_and_sent() {
    everywhere(|mut scene| {
        let (ball, _) = scene.ball(0.0);
        scene.ball(0.9);
        let handles: Vec<ColliderHandle> = scene.world.colliders.iter().map(|(handle, _)| handle).collect();
        // The pairs of a removed collider end silently.
        for (x, modified, removed, wanted) in [
            (0.0, &handles[..], &[][..], (2, 0, 1, 0, 1)),
            (50.0, &handles[..1], &handles[1..], (1, 1, 0, 0, 0)),
            (0.9, &handles, &[], (2, 0, 1, 0, 1)),
            (50.0, &handles, &[], (2, 0, 0, 1, 0)),
        ] {
            scene.move_to(ball, x);
            let World { params, colliders, bodies, .. } = &mut scene.world;
            bodies.propagate_modified_body_positions_to_colliders(colliders);
            let broad_phase = &mut scene.broad_phase.inner;
            broad_phase.update(params, colliders, bodies, modified, removed, &mut Vec::new());
            let stats = broad_phase.stats();
            let counts = (stats.modified, stats.removed, stats.added, stats.deleted, stats.report.pairs);
            assert_eq!(counts, wanted, "at {x}");
        }
        let stats = scene.broad_phase.inner.stats();
        let totals = &stats.totals;
        assert_eq!((stats.colliders, totals.rescans), (2, 0));
        assert_eq!((totals.updates, totals.added, totals.deleted, totals.failures), (4, 2, 1, 0));
    });
}

/// Calls that bring no news end at once. They are counted, their statistics are those of a call without news, and
/// the next call sees everything: a change, a collider behind rapier's lists, an adopted world, a failed update.
#[test]
fn calls_without_changes_are_counted_and_hide_nothing() {
    let mut world = World::default();
    for i in 0..3 {
        world.add(World::dynamic(glam::vec3(i as f32 * 0.9, 0.0, 0.0)), ColliderBuilder::ball(0.5));
    }
    let handles: Vec<ColliderHandle> = world.colliders.iter().map(|(handle, _)| handle).collect();
    let mut broad_phase = PbigBroadPhase::new();
    let call = |world: &World, broad_phase: &mut PbigBroadPhase, modified: &[ColliderHandle]| {
        let mut events = Vec::new();
        let World { params, colliders, bodies, .. } = world;
        broad_phase.update(params, colliders, bodies, modified, &[], &mut events);
        events.len()
    };
    assert_eq!(call(&world, &mut broad_phase, &handles), 2);
    for _ in 0..3 {
        assert_eq!(call(&world, &mut broad_phase, &[]), 0);
        let stats = broad_phase.stats();
        assert_eq!((stats.modified, stats.added, stats.report.changed, stats.report.pairs), (0, 0, 0, 2));
    }
    assert_eq!(broad_phase.stats().totals.updates, 4);
    // News that no list has: another collider.
    world.add(World::dynamic(glam::vec3(-0.9, 0.0, 0.0)), ColliderBuilder::ball(0.5));
    assert_eq!(
        call(&world, &mut broad_phase, &[]),
        3,
        "all colliders are looked at, and their pairs sent again"
    );
    (0..3).for_each(|_| assert_eq!(call(&world, &mut broad_phase, &[]), 0));
    broad_phase.adopt(&world.narrow_phase);
    assert_eq!(call(&world, &mut broad_phase, &[]), 3);
    (0..3).for_each(|_| assert_eq!(call(&world, &mut broad_phase, &[]), 0));
    let far = world.bodies.iter().next().expect("a body").0;
    world.bodies[far].set_translation(vector![50.0, 0.0, 0.0], true);
    let World { colliders, bodies, .. } = &mut world;
    bodies.propagate_modified_body_positions_to_colliders(colliders);
    assert_eq!(call(&world, &mut broad_phase, &handles), 2, "two pairs of the first ball have ended");
    assert_eq!(broad_phase.stats().totals.updates, 13);
}

thread_local! {
    /// Names of the spans that this thread has entered.
    static SPANS: RefCell<BTreeSet<&'static str>> = const { RefCell::new(BTreeSet::new()) };
}

/// For all threads and from then on: one for some threads only would race with the others, which decide for all
/// whether a span is looked at.
struct Names;

impl tracing::Subscriber for Names {
    fn enabled(&self, metadata: &tracing::Metadata<'_>) -> bool {
        metadata.target() == "pbig"
    }
    fn new_span(&self, span: &tracing::span::Attributes<'_>) -> tracing::span::Id {
        SPANS.with_borrow_mut(|spans| spans.insert(span.metadata().name()));
        tracing::span::Id::from_u64(1)
    }
    fn record(&self, _: &tracing::span::Id, _: &tracing::span::Record<'_>) {}
    fn record_follows_from(&self, _: &tracing::span::Id, _: &tracing::span::Id) {}
    fn event(&self, _: &tracing::Event<'_>) {}
    fn enter(&self, _: &tracing::span::Id) {}
    fn exit(&self, _: &tracing::span::Id) {}
}

fn spans(way: impl Into<Way>) -> BTreeSet<&'static str> {
    SPANS.take();
    let mut world = Scene::named("column").expect("the scene exists").build(200, 1);
    let mut broad_phase = pbig(way);
    (0..3).for_each(|_| world.step(&mut broad_phase));
    SPANS.take()
}

#[test]
fn each_stage_is_a_span() {
    tracing::subscriber::set_global_default(Names).expect("there is no other");
    let on_cpu = Config { backend: Backend::Cpu, ..PbigConfig::DEFAULT.into() };
    // A small world is swept, but for its first update.
    assert!(spans(on_cpu).is_superset(&["update", "proxies", "check", "events"].into()));
    let by_grid = spans(Config { engine: Some(Engine::Grid), ..on_cpu });
    assert_eq!(by_grid, ["update", "proxies", "plan", "map", "check", "diff", "events"].into());
    needs_gpu!();
    let of_gpu = spans(Config { backend: Backend::Device, ..PbigConfig::DEFAULT.into() });
    assert!(of_gpu.is_superset(&["update", "proxies", "device", "events"].into()), "{of_gpu:?}");
}

#[test]
fn a_box_lies_in_one_cell_that_contains_its_lower_corner() {
    let mut finder = pbig_core::BroadPhase::default();
    let set = |finder: &mut pbig_core::BroadPhase, id: u32, shift: f32| {
        let (size, step, side) = if id.is_multiple_of(9) { (0.5, 1.1, 10) } else { (0.05, 0.1, 20) };
        let corner = [id / 9, id / 9 / side, id / 9 / side / side].map(|i| (i % side) as f32 * step + shift);
        let aabb = pbig_core::Aabb::from_center(corner, [size; 3]);
        finder.set(id, aabb, pbig_core::ProxyFilter::ALL).expect("few boxes");
    };
    for id in 0..9000 {
        set(&mut finder, id, 0.0);
    }
    finder.update().expect("few pairs");
    (0..20).for_each(|id| set(&mut finder, id * 3, 1000.0));
    finder.update().expect("few pairs");
    let cells = finder.cells();
    let mut seen: Vec<u32> = cells.iter().flat_map(|cell| cell.ids.clone()).collect();
    seen.sort_unstable();
    assert!(seen.windows(2).all(|two| two[0] < two[1]) && seen.len() > 8900, "{} of 9000", seen.len());
    for cell in &cells {
        for &id in &cell.ids {
            let corner = finder.fat_aabb(id).expect("it is there").min;
            let inside = |k: usize| cell.aabb.min[k] <= corner[k] && corner[k] <= cell.aabb.max[k];
            assert!((0..3).all(inside), "{corner:?} outside {cell:?}");
        }
    }
    assert!(cells.len() > 100, "{} cells", cells.len());
}

#[test]
fn a_shadow_reports_the_first_difference_and_writes_a_replay() {
    let mut world = World::with_gravity(glam::Vec3::ZERO);
    let bodies =
        [0.0, 10.0, 20.0].map(|x| world.add(World::dynamic(glam::Vec3::X * x), ColliderBuilder::ball(0.5)));
    let handles = bodies.map(|body| world.bodies[body].colliders()[0]);
    let mut broad_phase = PbigBroadPhase::new().with_shadow(Shadow::Oracle);
    world.step(&mut broad_phase);
    assert!(broad_phase.differences().is_empty());
    // A ball moves onto another one without being listed.
    world.colliders[handles[0]].set_position(Isometry::translation(10.5, 0.0, 0.0));
    let World { params, colliders, bodies, .. } = &world;
    broad_phase.update(params, colliders, bodies, &handles[2..], &[], &mut Vec::new());
    let first = broad_phase.differences().first().expect("a difference");
    assert_eq!(first.fault, Fault::Missing);
    let text = first.to_string();
    for part in ["colliders (0, 0) and (1, 0)", "box [", "Dynamic body (0, 0)", "groups 0xffffffff"] {
        assert!(text.contains(part), "no {part} in {text}");
    }
    let file = first.replay.as_ref().expect("a folder was given").as_ref().expect("a writable folder");
    let frames = read_frames(file).expect("a replayable file");
    std::fs::remove_file(file).expect("the file is there");
    assert_eq!(frames.boxes, 3);
    let x = frames.frames.last().expect("frames")[0].expect("a box").min[0];
    assert!((x - 9.999).abs() < 1e-3, "the last frame is the one that failed: {x}");
}
