//! The incremental facade: after every update the kept pairs are what the oracle makes of the fat
//! boxes, and the events lead from one state to the next.

use crate::follower::Follower;
use pbig_core::{Aabb, BroadPhase, Config, Engine, Error, Limits, Pair, ProxyFilter};
use pbig_harness::boxes::{BoxSet, moved};
use pbig_tests::{engines, set, set_all, shifted, strategies};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

#[test]
fn random_worlds_with_churn_on_every_strategy() {
    let degenerate = BoxSet::named("degenerate").expect("the set exists");
    for (strategy, way) in strategies().into_iter().chain(engines()) {
        for seed in 0..60 {
            let mut rng = StdRng::seed_from_u64(seed);
            let margin = [0.0, 0.01, 0.3][seed as usize % 3];
            let ids = [20, 90, 300][seed as usize % 3];
            let mut world = Follower::new(way.with(|it| it.margin = margin), ids);
            for round in 0..25 {
                // From a handful of changes to a change of everything.
                let changes = if round % 7 == 0 { ids } else { rng.random_range(0..1 + ids / 10) };
                for new in degenerate.boxes(changes, seed * 1000 + round) {
                    let id = rng.random_range(0..ids as u32);
                    change(&mut world, &mut rng, id, new);
                }
                world.update(&format!("{strategy}, seed {seed}, round {round}"));
            }
        }
    }
}

fn change(world: &mut Follower, rng: &mut StdRng, id: u32, new: Aabb) {
    let filter =
        ProxyFilter { body: id % 7, memberships: 3, mask: rng.random_range(0..4), ..ProxyFilter::ALL };
    match (rng.random_range(0..6), world.boxes[id as usize]) {
        (0, Some(_)) => world.remove(id),
        (1, Some(_)) => {
            // Index reuse within one update.
            world.remove(id);
            world.set(id, new, filter);
        }
        (2, Some((aabb, _))) => world.set(id, aabb, filter),
        (3, Some((aabb, filter))) => world.set(id, moved(&[aabb], 0.05, rng.random())[0], filter),
        _ => world.set(id, new, filter),
    }
}

/// A box that reaches to infinity is the same again when the rest of it stays within the margin.
#[test]
fn infinite_boxes_within_their_margin_have_not_changed() {
    let mut broad_phase = BroadPhase::new(Config { margin: 0.1, ..Config::DEFAULT }).expect("a good margin");
    let half_space = |y: f32| Aabb::new([f32::NEG_INFINITY; 3], [f32::INFINITY, y, f32::INFINITY]);
    for (y, changed) in [(0.0, 1), (0.05, 0), (-0.05, 0), (0.5, 1), (f32::INFINITY, 1), (f32::INFINITY, 0)] {
        broad_phase.set(0, half_space(y), ProxyFilter::ALL).expect("a small id");
        broad_phase.update().expect("no pairs");
        assert_eq!(broad_phase.report().changed, changed, "{y}");
    }
}

#[test]
fn contract_5_no_change_no_work_and_few_changes_little() {
    let boxes = set("unit", 20_000, 5);
    let mut broad_phase = BroadPhase::new(Config { margin: 0.05, ..Config::DEFAULT }).expect("a good margin");
    set_all(&mut broad_phase, &boxes);
    broad_phase.update().expect("within the limits");
    set_all(&mut broad_phase, &boxes.iter().map(|aabb| shifted(aabb, [0.04; 3])).collect::<Vec<_>>());
    broad_phase.update().expect("within the limits");
    let report = broad_phase.report();
    assert_eq!((report.changed, report.checks.made), (0, 0), "motion within the margin changes nothing");
    for frame in 1..40 {
        let aabb = Aabb::from_center([frame as f32; 3], [0.5; 3]);
        broad_phase.set(77, aabb, ProxyFilter::ALL).expect("a small id");
        broad_phase.update().expect("within the limits");
        let made = broad_phase.report().checks.made;
        assert!(made < 200, "{made} checks for one moving box: {}", broad_phase.report().plan);
    }
}

#[test]
fn an_update_that_finds_too_many_pairs_can_be_repeated() {
    let limits = Limits { max_pairs: 250, ..Limits::DEFAULT };
    for engine in std::iter::once(None).chain(Engine::ALL.map(Some)) {
        let config = Config { limits, engine, ..Config::DEFAULT };
        let mut broad_phase = BroadPhase::new(config).expect("a good margin");
        let all = Aabb::from_center([0.0; 3], [1e6; 3]);
        set_all(&mut broad_phase, &[all; 100]);
        assert_eq!(broad_phase.update(), Err(Error::TooManyPairs { limit: 250 }));
        assert!(broad_phase.events().added.is_empty() && broad_phase.pair_count() == 0, "no partial result");
        let boxes = set("unit", 100, 1);
        set_all(&mut broad_phase, &boxes);
        broad_phase.update().expect("within the limits");
        let before: Vec<Pair> = broad_phase.pairs().collect();
        // Few changes: look-ups may find too many, too.
        [3, 4].into_iter().for_each(|id| broad_phase.set(id, all, ProxyFilter::ALL).expect("a small id"));
        assert_eq!(broad_phase.update(), Err(Error::TooManyPairs { limit: 250 }));
        assert!(broad_phase.pairs().eq(before), "nothing has changed");
        broad_phase.set(4, boxes[4], ProxyFilter::ALL).expect("a small id");
        broad_phase.update().expect("a hundred pairs now");
        assert_eq!(broad_phase.degree(3), 99);
    }
}

#[test]
fn a_margin_that_changes_applies_to_boxes_set_afterwards() {
    let mut world = Follower::new(Config { margin: 0.5, ..Config::DEFAULT }, 40);
    let boxes = set("pile", 40, 2);
    for (round, margin) in [0.5, 0.01, 2.0, 0.0].into_iter().enumerate() {
        world.broad_phase.set_margin(margin).expect("a good margin");
        for (id, aabb) in moved(&boxes, 0.02, round as u64).into_iter().enumerate() {
            world.set(id as u32, aabb, ProxyFilter::ALL);
        }
        world.update(&format!("margin {margin}"));
    }
}

#[test]
fn bad_arguments_are_errors() {
    for margin in [-1.0, f32::NAN, f32::INFINITY] {
        let error = BroadPhase::new(Config { margin, ..Config::DEFAULT }).unwrap_err();
        assert!(error.to_string().contains("margin"), "{error}");
    }
    let mut broad_phase = BroadPhase::new(Config::DEFAULT).expect("a good margin");
    let error = broad_phase.set(u32::MAX, Aabb::NOWHERE, ProxyFilter::ALL).unwrap_err();
    assert!(matches!(error, Error::TooManyBoxes { boxes: 4_294_967_296, .. }));
    assert!(!broad_phase.remove(5), "an unknown id is not there");
}
