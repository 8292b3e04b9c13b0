//! Classes of bugs that rapier's own broad phases have had, and that random worlds do not reach: shapes changed in place, the
//! `CollisionPipeline`, long churn. Every call is checked beside stock and the oracle, on every backend. Numbers are those of issues
//! and pull requests of dimforge/rapier.

use crate::checked::{Checked, backends, everywhere, pbig};
use pbig_harness::world::World;
use rapier3d::prelude::*;
use std::sync::mpsc::channel;

/// Pairs in which the narrow phase has a contact.
fn touching(scene: &Checked) -> usize {
    scene.world.narrow_phase.contact_pairs().filter(|pair| pair.has_any_active_contact).count()
}

#[test]
fn upstream_177_180_a_shape_grows_and_shrinks_in_place() {
    everywhere(|mut scene| {
        let [changing, ..] = [0.0, 3.0, 6.0, 9.0].map(|x| scene.ball(x).1);
        assert_eq!(scene.step(), 0);
        for (radius, pairs) in [(3.0, 1), (9.0, 3), (0.5, 0)] {
            let shape = scene.world.colliders[changing].shape_mut();
            shape.as_ball_mut().expect("a ball").radius = radius;
            assert_eq!((scene.step(), scene.contacts()), (pairs, pairs), "radius {radius}");
        }
    });
}

#[test]
fn a_voxel_that_is_set_in_place_grows_the_box() {
    everywhere(|mut scene| {
        let voxels = ColliderBuilder::voxels(Vector::repeat(1.0), &[Point::origin()]);
        let voxels = scene.world.colliders.insert(voxels);
        scene.ball(5.4);
        assert_eq!(scene.step(), 0);
        for (x, pairs) in [(3, 0), (4, 1)] {
            let shape = scene.world.colliders[voxels].shape_mut().as_voxels_mut().expect("voxels");
            shape.set_voxel(point![x, 0, 0], true);
            assert_eq!((scene.step(), scene.contacts()), (pairs, pairs), "voxel {x}");
        }
    });
}

/// A ball without a body that reports collisions with everything.
fn loud(x: f32) -> ColliderBuilder {
    let ball = ColliderBuilder::ball(0.5).translation(vector![x, 0.0, 0.0]);
    ball.active_collision_types(ActiveCollisionTypes::all()).active_events(ActiveEvents::COLLISION_EVENTS)
}

/// Detects collisions without moving anything; for each event, whether a collision has started.
fn collide(scene: &mut Checked) -> Vec<bool> {
    let (send, received) = channel();
    let events = ChannelEventCollector::new(send, channel().0);
    let World { params, narrow_phase, bodies, colliders, .. } = &mut scene.world;
    CollisionPipeline::new().step(
        params.prediction_distance(),
        &mut scene.broad_phase,
        narrow_phase,
        bodies,
        colliders,
        &(),
        &events,
    );
    if let Some(first) = scene.broad_phase.first_difference() {
        panic!("{first}");
    }
    received.try_iter().map(CollisionEvent::started).collect()
}

#[test]
fn upstream_268_300_new_groups_end_a_contact_with_an_event() {
    everywhere(|mut scene| {
        let [changing, _, _] = [0.0, 0.9, 50.0].map(|x| scene.world.colliders.insert(loud(x)));
        assert_eq!(collide(&mut scene), [true]);
        for _ in 0..3 {
            assert!(collide(&mut scene).is_empty(), "nothing has changed");
            scene.world.colliders[changing].set_collision_groups(InteractionGroups::none());
            assert_eq!(collide(&mut scene), [false]);
            scene.world.colliders[changing].set_collision_groups(InteractionGroups::all());
            assert_eq!(collide(&mut scene), [true]);
        }
    });
}

#[test]
fn the_collision_pipeline_sees_motion_between_its_calls() {
    everywhere(|mut scene| {
        let [moving, ..] = [0.0, 2.0, 4.0].map(|x| scene.world.colliders.insert(loud(x)));
        assert!(collide(&mut scene).is_empty());
        let path: [(f32, &[bool]); 5] =
            [(1.2, &[true]), (2.9, &[]), (3.2, &[false, true]), (50.0, &[false]), (1.2, &[true])];
        for (x, events) in path {
            scene.world.colliders[moving].set_translation(vector![x, 0.0, 0.0]);
            assert_eq!(collide(&mut scene), events, "at {x}");
        }
    });
}

#[test]
fn upstream_281_617_indices_and_pairs_stay_few_under_churn() {
    everywhere(|mut scene| {
        let mut row: Vec<_> = (0..40).map(|i| scene.ball(0.9 * i as f32)).collect();
        assert_eq!(scene.step(), 39);
        let bytes =
            |scene: &Checked| postcard::to_stdvec(&scene.broad_phase.inner).expect("a snapshot").len();
        let mut sizes = Vec::new();
        for round in 0..100 {
            // Every other ball is replaced by a new one in its place: 2000 in all.
            for i in (round % 2..40).step_by(2) {
                scene.world.remove(row[i].0);
                row[i] = scene.ball(0.9 * i as f32);
            }
            assert_eq!((scene.step(), touching(&scene)), (39, 39), "round {round}");
            sizes.push(bytes(&scene));
        }
        // Generations above 127 take another byte.
        assert!(sizes[50..].iter().all(|size| *size == sizes[50]), "{sizes:?}");
        assert!(row.iter().all(|(_, collider)| collider.into_raw_parts().0 < 40), "indices are reused");
        let colliders = &scene.world.colliders;
        let live =
            |pair: ColliderPair| colliders.contains(pair.collider1) && colliders.contains(pair.collider2);
        assert!(scene.broad_phase.inner.pairs().all(live), "pairs have the present generation");
    });
}

#[test]
fn upstream_350_an_infinite_position_has_no_pairs_until_mended() {
    for (name, config) in backends() {
        let (params, bodies) = (IntegrationParameters::default(), RigidBodySet::new());
        let (mut broad_phase, mut colliders) = (pbig(config), ColliderSet::new());
        let handles = [0.0, 0.9, 1.8].map(|x| colliders.insert(loud(x)));
        // Without a narrow phase and without stock, which cannot bear it.
        let mut at = |x: f32| {
            colliders[handles[1]].set_translation(vector![x, 0.0, 0.0]);
            broad_phase.update(&params, &colliders, &bodies, &handles, &[], &mut Vec::new());
            (broad_phase.pair_count(), broad_phase.stats().report.invalid)
        };
        for x in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::NAN] {
            assert_eq!(at(0.9), (2, 0), "{name}, before {x}");
            assert_eq!(at(x), (0, u64::from(x.is_nan())), "{name}, at {x}");
            assert_eq!(at(x), (0, u64::from(x.is_nan())), "{name}, still at {x}");
        }
        assert_eq!(at(0.9), (2, 0), "{name}, mended");
    }
}
