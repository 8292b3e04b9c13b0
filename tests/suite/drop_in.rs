//! The duties of a broad phase to rapier 0.27, call by call.

use crate::checked::{Checked, backends, everywhere, pbig};
use pbig_core::Config;
use pbig_harness::world::World;
use pbig_tests::on_threads;
use rapier_pbig::{PbigBroadPhase, PbigConfig, Why};
use rapier3d::prelude::*;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Balls in a row, on a number of threads: in each step one in `every` is listed as moved, and moves or stays. Where few of many have
/// moved, the states of two listed balls lie far apart in memory. The last row has more than are looked at one after the other.
#[test]
fn many_may_come_go_and_change_in_one_step() {
    for (threads, balls, every) in [(2, 18_000, 1), (1, 9000, 9), (2, 9000, 9), (2, 45_000, 5)] {
        on_threads(threads, || multitude(balls, every));
    }
}

fn multitude(count: usize, every: usize) {
    let mut scene = Checked::new(Config::from(PbigConfig::DEFAULT));
    let mut balls: Vec<_> = (0..count).map(|i| scene.ball(i as f32 * 0.9)).collect();
    assert_eq!(scene.step(), count - 1, "all are new");
    for step in 1..4 {
        let moved = (0..count).step_by(every);
        for i in moved {
            scene.move_to(balls[i].0, i as f32 * 0.9 + if (i / 7) % 4 == step { 0.2 } else { 0.0 });
        }
        for (_, collider) in balls[step * 1000..].iter().take(100) {
            scene.world.colliders[*collider].set_enabled(step.is_multiple_of(2));
        }
        for (body, old) in balls[2000..].iter_mut().step_by(500) {
            scene.world.remove_collider(*old);
            *old = scene.attach(*body);
        }
        let none = InteractionGroups::none();
        scene.world.colliders[balls[4000 + step].1].set_collision_groups(none);
        scene.move_to(balls[count / 4 * step].0, f32::NAN);
        let pairs = scene.step();
        // In a row of neighbours one ball in 14 leaves its neighbour. Scattered balls do whenever they move.
        let apart = if every == 1 { count / 14 } else { count / every / 4 };
        let expected = count - apart - 300..count - apart / 2;
        assert!(expected.contains(&pairs), "{pairs} pairs in step {step}, of {expected:?}");
    }
}

#[test]
fn a_multitude_leaves_the_same_behind_on_any_number_of_threads() {
    let mut world = World::with_gravity(glam::Vec3::ZERO);
    let ball = |i| World::dynamic(glam::Vec3::X * 0.9 * i as f32);
    (0..17_000).for_each(|i| _ = world.add(ball(i), ColliderBuilder::ball(0.5).enabled(i < 16_900)));
    let mut listed: Vec<_> = world.colliders.iter().map(|(handle, _)| handle).collect();
    // Colliders that are gone, one of them with another's index.
    listed.extend(
        [(3, 77), (0x7fff_ffff, 0)].map(|(i, generation)| ColliderHandle::from_raw_parts(i, generation)),
    );
    let left_behind = |threads| {
        let (mut broad_phase, mut events) = (PbigBroadPhase::new(), Vec::new());
        let World { params, colliders, bodies, .. } = &world;
        on_threads(threads, || broad_phase.update(params, colliders, bodies, &listed, &[], &mut events));
        assert_eq!((events.len(), broad_phase.pair_count()), (16_899, 16_899), "{threads} threads");
        serde_json::to_string(&broad_phase).expect("a snapshot")
    };
    assert!(left_behind(1) == left_behind(2));
}

#[test]
fn a_collider_that_is_fixed_or_sleeps_has_no_margin_until_it_moves() {
    let fix = |body: &mut RigidBody| body.set_body_type(RigidBodyType::Fixed, true);
    for still in [fix, RigidBody::sleep] {
        everywhere(|mut scene| {
            scene.ball(0.0);
            let (body, _) = scene.ball(1.017);
            still(&mut scene.world.bodies[body]);
            assert_eq!(scene.step(), 0, "the gap is wider than the margin of one");
            scene.move_to(body, 2.0);
            assert_eq!(scene.step(), 0);
            scene.move_to(body, 1.017);
            assert_eq!(scene.step(), 1, "the gap is narrower than both margins");
        });
    }
}

#[test]
fn a_collider_removed_twice_and_then_with_its_body_is_gone() {
    everywhere(|mut scene| {
        let [(a, on_a), ..] = [0.0, 0.9, 1.8, 50.0].map(|x| scene.ball(x));
        scene.attach(a);
        assert_eq!(scene.step(), 3, "both of the first body with the second, and the second with the third");
        scene.world.remove_collider(on_a);
        scene.world.remove_collider(on_a);
        // Listed twice in one call, and once more in the step.
        let World { params, colliders, bodies, .. } = &scene.world;
        scene.broad_phase.update(params, colliders, bodies, &[], &[on_a, on_a], &mut Vec::new());
        assert_eq!(scene.broad_phase.inner.pair_count(), 2);
        let (unknown, mut events) =
            ([ColliderHandle::from_raw_parts(77, 3), ColliderHandle::invalid()], vec![]);
        scene.broad_phase.inner.update(params, colliders, bodies, &unknown, &unknown, &mut events);
        assert_eq!((events.len(), scene.broad_phase.inner.stats().report.checks.made), (0, 0));
        scene.world.remove(a);
        scene.world.remove(a);
        assert_eq!((scene.step(), scene.contacts()), (1, 1));
    });
}

#[test]
fn soft_ccd_boxes_contain_stocks_in_cut_and_spinning_motion() {
    for spin in [0.0, 30.0, 300.0] {
        let mut world = World::with_gravity(glam::Vec3::ZERO);
        let body =
            RigidBodyBuilder::dynamic().linvel(vector![900.0, 0.0, 0.0]).angvel(vector![0.0, 0.0, spin]);
        world.add(body.soft_ccd_prediction(3.0), ColliderBuilder::cuboid(2.0, 0.1, 0.1));
        // A curtain of targets around the path; stock tells which of them matter.
        for i in 0..400 {
            let at = vector![(i % 20) as f32 * 0.5 - 3.0, (i / 20) as f32 * 0.3 - 3.0, 0.0];
            world.add(RigidBodyBuilder::dynamic().translation(at), ColliderBuilder::ball(0.05));
        }
        let pairs = |broad_phase: &mut dyn BroadPhase| {
            let handles: Vec<_> = world.colliders.iter().map(|(handle, _)| handle).collect();
            let mut events = Vec::new();
            broad_phase.update(&world.params, &world.colliders, &world.bodies, &handles, &[], &mut events);
            let pair = |event: &BroadPhasePairEvent| match event {
                BroadPhasePairEvent::AddPair(p) => {
                    [p.collider1.into_raw_parts().0, p.collider2.into_raw_parts().0]
                }
                BroadPhasePairEvent::DeletePair(_) => panic!("nothing to delete"),
            };
            let found = events.iter().map(pair).map(|[a, b]| [a.min(b), a.max(b)]);
            found.filter(|[a, _]| *a == 0).collect::<std::collections::BTreeSet<_>>()
        };
        // Positions of colliders are set by a step; the first one of each has just this effect.
        let (stock, ours) = (pairs(&mut DefaultBroadPhase::new()), pairs(&mut PbigBroadPhase::new()));
        assert!(stock.len() > 10 && ours.is_superset(&stock), "spin {spin}: {:?}", stock.difference(&ours));
    }
}

#[test]
fn where_rapiers_own_broad_phase_panics_ours_does_not() {
    // One of three is disabled and one removed in the same step. If stock survives that in another release, its row in
    // docs/DROP_IN.md goes.
    let contacts = |broad_phase: &mut dyn BroadPhase, x: f32| {
        let mut scene = Checked::new(Config::from(PbigConfig::DEFAULT));
        let [a, b, _] = [0.0, x, 0.9].map(|x| scene.ball(x).0);
        let mut step = |scene: &mut Checked| {
            scene.world.step(broad_phase);
            scene.contacts()
        };
        let at_first = step(&mut scene);
        scene.world.bodies[a].set_enabled(false);
        scene.world.remove(b);
        let without = step(&mut scene);
        scene.world.bodies[a].set_enabled(true);
        [at_first, without, step(&mut scene)]
    };
    for (x, at_first) in [(0.5, 3), (7.0, 1)] {
        let mut stock = DefaultBroadPhase::new();
        assert!(catch_unwind(AssertUnwindSafe(move || contacts(&mut stock, x))).is_err());
        for (_, way) in backends() {
            assert_eq!(contacts(&mut pbig(way), x), [at_first, 0, 1]);
        }
    }
}

#[test]
fn a_collider_that_reuses_an_unlisted_index_has_its_own_pairs() {
    for (_, way) in backends() {
        let (mut scene, mut ours) = (Checked::new(way), pbig(way));
        let (body, old) = scene.ball(0.0);
        let (_, other) = scene.ball(0.9);
        let update = |scene: &Checked, ours: &mut PbigBroadPhase, listed: &[ColliderHandle]| {
            let World { params, colliders, bodies, .. } = &scene.world;
            let mut events = Vec::new();
            ours.update(params, colliders, bodies, listed, &[], &mut events);
            events.len()
        };
        assert_eq!(update(&scene, &mut ours, &[old, other]), 1);
        scene.world.remove_collider(old);
        let new = scene.attach(body);
        assert_eq!(new.into_raw_parts().0, old.into_raw_parts().0);
        assert_eq!(update(&scene, &mut ours, &[new]), 1, "the pair is new, although box and index are not");
        assert_eq!(
            (ours.why(new, other), ours.why(old, other)),
            (Why::Reported, Why::Unknown(old.into_raw_parts().into()))
        );
    }
}
