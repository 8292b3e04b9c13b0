//! One test for each class of bugs that rapier's own broad phases have had. Every call is checked beside
//! stock and the oracle, on every backend. Numbers are those of issues and pull requests of dimforge/rapier;
//! `bevy` and `js` mark those of its bindings.

use crate::checked::{Checked, everywhere, on_cpu, on_gpu, pbig};
use pbig_harness::world::World;
use pbig_tests::{Way, needs_gpu};
use rapier3d::prelude::*;
use std::sync::mpsc::channel;

/// A body with one collider.
pub(crate) fn add(
    scene: &mut Checked,
    body: RigidBodyBuilder,
    shape: ColliderBuilder,
) -> (RigidBodyHandle, ColliderHandle) {
    let body = scene.world.bodies.insert(body);
    (body, scene.attach_shape(body, shape))
}

/// A body that stays where it is put, whatever pushes it, and never sleeps.
pub(crate) fn held(at: [f32; 3]) -> RigidBodyBuilder {
    let body = RigidBodyBuilder::dynamic().translation(at.into());
    body.can_sleep(false).lock_translations().lock_rotations()
}

/// Pairs in which the narrow phase has a contact.
pub(crate) fn touching(scene: &Checked) -> usize {
    scene.world.narrow_phase.contact_pairs().filter(|pair| pair.has_any_active_contact).count()
}

/// Pairs of which one is a sensor that the other reaches into.
pub(crate) fn sensed(scene: &Checked) -> usize {
    scene.world.narrow_phase.intersection_pairs().filter(|(_, _, hit)| *hit).count()
}

#[test]
fn upstream_288_530_588_a_crowd_that_may_not_collide() {
    everywhere(|mut scene| {
        let crowd = InteractionGroups::new(Group::GROUP_1, Group::GROUP_2);
        for _ in 0..1000 {
            add(&mut scene, held([0.0; 3]), ColliderBuilder::ball(0.5).collision_groups(crowd));
        }
        assert_eq!((scene.steps(3), scene.contacts()), (0, 0));
        let checks = scene.checks();
        assert!(scene.on_gpu() || checks < 2000, "{checks} checks");
        let groups = InteractionGroups::new(Group::GROUP_2, Group::GROUP_1);
        let floor = ColliderBuilder::cuboid(50.0, 1.0, 50.0).translation(vector![0.0, -1.4, 0.0]);
        scene.world.colliders.insert(floor.collision_groups(groups));
        assert_eq!((scene.steps(2), touching(&scene)), (1000, 1000));
        let checks = scene.checks();
        assert!(scene.on_gpu() || checks < 3000, "{checks} checks");
    });
}

#[test]
fn upstream_730_970_two_thousand_colliders_on_a_moving_body() {
    everywhere(|mut scene| {
        scene.world.colliders.insert(ColliderBuilder::cuboid(10.2, 1.0, 1.0).sensor(true));
        let body = RigidBodyBuilder::dynamic().linvel(vector![-60.0, 0.0, 0.0]).can_sleep(false);
        let body = scene.world.bodies.insert(body);
        for i in 0..2000 {
            scene.attach_shape(body, ColliderBuilder::ball(0.5).translation(vector![i as f32, 0.0, 0.0]));
        }
        // The balls touch each other, one for each metre; those from -10 to 10 reach into the sensor.
        for metres in 1..=12_usize {
            let inside = (11 + metres).min(21);
            assert_eq!((scene.step(), sensed(&scene)), (inside, inside), "after {metres} m");
        }
        assert_eq!(scene.contacts(), 0);
        // Sorted into cells they are tested against neighbours, of two million pairs.
        let checks = scene.checks();
        assert!(scene.on_gpu() || checks < 40_000, "{checks} checks");
    });
}

#[test]
fn upstream_558_fixed_bodies_are_free_after_the_first_step() {
    among_fixed_bodies(on_cpu()[0], 60, 200);
    needs_gpu!();
    // A GPU looks at all again.
    among_fixed_bodies(on_gpu(), 2, u64::MAX);
}

/// One body moves among fixed ones, at a metre in two steps. Not beside the oracle, which would test 127 million pairs.
fn among_fixed_bodies(way: impl Into<Way>, steps: usize, most_checks: u64) {
    let mut world = World::with_gravity(glam::Vec3::ZERO);
    for i in 0..15_941 {
        let at = vector![(i % 127) as f32, 0.0, (i / 127) as f32];
        world.add(RigidBodyBuilder::fixed().translation(at), ColliderBuilder::cuboid(0.5, 0.5, 0.5));
    }
    let mover =
        RigidBodyBuilder::dynamic().translation(vector![5.0, 0.0, 60.0]).linvel(vector![30.0, 0.0, 0.0]);
    let mover = world.add(mover.can_sleep(false), ColliderBuilder::ball(0.4).sensor(true));
    let mut broad_phase = pbig(way);
    world.step(&mut broad_phase);
    for step in 0..steps {
        // The first of the two updates of a step has nothing to do, because only rapier moves bodies.
        world.step(&mut broad_phase);
        let report = broad_phase.stats().report;
        assert_eq!(report.changed, 1, "step {step}");
        assert!((1..=2).contains(&report.pairs), "step {step}: {} pairs", report.pairs);
        let made = report.checks.made;
        assert!((1..most_checks).contains(&made), "step {step}: {made} checks for one body that moves");
    }
    world.remove(mover);
    world.step(&mut broad_phase);
    for _ in 0..3 {
        world.step(&mut broad_phase);
        let report = broad_phase.stats().report;
        assert_eq!((report.changed, report.checks.made, report.pairs), (0, 0, 0));
    }
}

#[test]
fn upstream_244_a_large_moving_sensor_misses_no_small_one() {
    everywhere(|mut scene| {
        for i in 0..400 {
            let at = vector![(i % 20) as f32, 0.0, (i / 20) as f32];
            scene.world.colliders.insert(ColliderBuilder::cuboid(0.25, 0.25, 0.25).translation(at));
        }
        let sensor = ColliderBuilder::cuboid(4.1, 1.0, 4.1).sensor(true);
        let body = RigidBodyBuilder::kinematic_position_based().translation(vector![-30.0, 0.0, 9.5]);
        let (body, _) = add(&mut scene, body, sensor.active_collision_types(ActiveCollisionTypes::all()));
        // To one side and back. It reaches eight rows, and 4.35 m to both sides.
        for n in (-8..=8).chain((-8..8).rev()) {
            let x = 9.5 + 2.0 * n as f32;
            scene.world.bodies[body].set_next_kinematic_translation(vector![x, 0.0, 9.5]);
            let columns = (0..20).filter(|&i| (i as f32 - x).abs() < 4.35).count();
            assert_eq!((scene.step(), sensed(&scene)), (8 * columns, 8 * columns), "at {x}");
        }
    });
}

#[test]
fn upstream_177_180_a_shape_grows_and_shrinks_in_place() {
    everywhere(|mut scene| {
        let [changing, ..] = [0.0, 3.0, 6.0, 9.0].map(|x| scene.ball(x).1);
        let ball = || SharedShape::ball(0.5);
        let mut pairs_with = |shape: SharedShape| {
            scene.world.colliders[changing].set_shape(shape);
            scene.step()
        };
        for _ in 0..3 {
            assert_eq!(pairs_with(ball()), 0);
            assert_eq!(pairs_with(SharedShape::ball(3.0)), 1);
            assert_eq!(pairs_with(SharedShape::cuboid(6.0, 0.1, 0.1)), 2);
            let far_part = (Isometry::translation(9.0, 0.0, 0.0), ball());
            assert_eq!(pairs_with(SharedShape::compound(vec![(Isometry::identity(), ball()), far_part])), 3);
        }
        assert_eq!(pairs_with(ball()), 0);
        for (radius, pairs) in [(3.0, 1), (9.0, 3), (0.5, 0)] {
            let shape = scene.world.colliders[changing].shape_mut();
            shape.as_ball_mut().expect("a ball").radius = radius;
            assert_eq!((scene.step(), scene.contacts()), (pairs, pairs), "radius {radius}");
        }
    });
}

#[test]
fn upstream_593_665_teleports_from_one_neighbour_to_another() {
    everywhere(|mut scene| {
        for k in 0..10 {
            scene.ball(10.0 * k as f32);
        }
        let (jumper, _) = scene.ball(-500.0);
        assert_eq!(scene.step(), 0);
        for step in 0..40 {
            scene.move_to(jumper, 10.0 * (step * 7 % 10) as f32 + 0.9);
            assert_eq!((scene.step(), touching(&scene)), (1, 1), "step {step}");
        }
        scene.move_to(jumper, 500.0);
        assert_eq!((scene.step(), scene.contacts()), (0, 0));
    });
}

#[test]
fn upstream_77_819_far_away_and_back() {
    everywhere(|mut scene| {
        let [_, (traveller, _), _] = [0.0, 0.9, 1.8].map(|x| scene.ball(x));
        for distance in [10.0, -1e3, 1e6, -1e9, 1e12] {
            for axis in 0..3 {
                let mut away: [f32; 3] = [0.9, 0.0, 0.0];
                away[axis] += distance;
                scene.world.bodies[traveller].set_translation(away.into(), true);
                assert_eq!((scene.step(), scene.contacts()), (0, 0), "{distance} along {axis}");
                scene.move_to(traveller, 0.9);
                assert_eq!((scene.step(), touching(&scene)), (2, 2), "{distance} along {axis}");
            }
        }
    });
}

#[test]
fn upstream_349_small_colliders_touch_at_the_borders_of_cells() {
    everywhere(|mut scene| {
        let row: Vec<_> =
            (0..100).map(|_| add(&mut scene, held([0.0; 3]), ColliderBuilder::ball(0.05)).0).collect();
        for shift in [0.0, 3.6, 1.0 / 3.0, -7.25, 0.05] {
            for (i, body) in row.iter().enumerate() {
                let at = vector![0.1 * i as f32 + shift, shift, 0.0];
                scene.world.bodies[*body].set_translation(at, true);
            }
            assert_eq!((scene.step(), touching(&scene)), (99, 99), "shifted by {shift}");
        }
    });
}

#[test]
fn upstream_326_897_groups_change_while_bodies_move() {
    everywhere(|mut scene| {
        // Overlapping balls that fly along together: contacts, but no forces.
        let row = [0.0, 0.9, 1.8, 2.7, 3.6, 4.5, 5.4, 6.3, 7.2, 8.1].map(|x| {
            let body = RigidBodyBuilder::dynamic().translation(vector![x, 0.0, 0.0]);
            let ball = ColliderBuilder::ball(0.5).solver_groups(InteractionGroups::none());
            add(&mut scene, body.linvel(vector![3.0, 6.0, 1.0]).can_sleep(false), ball)
        });
        let (body, collider) = row[4];
        for step in 0..20 {
            let (groups, pairs, up) = match step % 2 {
                0 => (InteractionGroups::none(), 7, 0.1),
                _ => (InteractionGroups::all(), 9, -0.1),
            };
            scene.world.colliders[collider].set_collision_groups(groups);
            if step >= 10 {
                let at = scene.world.bodies[body].translation() + vector![0.0, up, 0.0];
                scene.world.bodies[body].set_translation(at, true);
            }
            assert_eq!(
                (scene.step(), scene.contacts(), touching(&scene)),
                (pairs, pairs, pairs),
                "step {step}"
            );
        }
    });
}

/// A ball without a body that reports collisions with everything.
pub(crate) fn loud(x: f32) -> ColliderBuilder {
    let ball = ColliderBuilder::ball(0.5).translation(vector![x, 0.0, 0.0]);
    ball.active_collision_types(ActiveCollisionTypes::all()).active_events(ActiveEvents::COLLISION_EVENTS)
}

/// Detects collisions without moving anything; for each event, whether a collision has started.
pub(crate) fn collide(scene: &mut Checked) -> Vec<bool> {
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
fn upstream_268_a_kinematic_body_leaves_a_fixed_one() {
    everywhere(|mut scene| {
        scene.world.colliders.insert(ColliderBuilder::ball(0.5));
        let (body, _) = scene.ball(0.9);
        scene.ball(50.0);
        for _ in 0..3 {
            assert_eq!((scene.step(), touching(&scene)), (1, 1));
            scene.world.bodies[body].set_body_type(RigidBodyType::KinematicVelocityBased, true);
            assert_eq!((scene.step(), scene.contacts()), (0, 0));
            scene.world.bodies[body].set_body_type(RigidBodyType::Dynamic, true);
        }
    });
}

#[test]
fn upstream_734_a_collider_of_another_body_has_pairs_at_once() {
    everywhere(|mut scene| {
        let (a, _) = scene.ball(0.0);
        let wanderer = scene.attach(a);
        let b = scene.world.bodies.insert(held([0.3, 0.0, 0.0]));
        scene.ball(50.0);
        assert_eq!(scene.step(), 0);
        for _ in 0..2 {
            // To the other body, to none, where it stays in its place, and back to the first.
            for (parent, pairs) in [(Some(b), 1), (None, 1), (Some(a), 0), (Some(b), 1), (Some(a), 0)] {
                let World { bodies, colliders, .. } = &mut scene.world;
                colliders.set_parent(wanderer, parent, bodies);
                assert_eq!((scene.step(), touching(&scene)), (pairs, pairs), "on {parent:?}");
                assert_eq!(scene.contacts(), pairs, "on {parent:?}");
            }
        }
    });
}

#[test]
fn upstream_344js_900_a_disabled_collider_meets_nothing() {
    everywhere(|mut scene| {
        scene.world.colliders.insert(ColliderBuilder::cuboid(50.0, 1.0, 1.0).sensor(true));
        let body = RigidBodyBuilder::dynamic().linvel(vector![6.0, 0.0, 0.0]).can_sleep(false);
        let (body, first) = add(&mut scene, body, ColliderBuilder::ball(0.3));
        let second = scene.attach_shape(body, ColliderBuilder::ball(0.4).enabled(false));
        let both = [(true, false), (true, true), (false, true), (false, false), (true, true), (true, false)];
        for (is_first, is_second) in both {
            scene.world.colliders[first].set_enabled(is_first);
            scene.world.colliders[second].set_enabled(is_second);
            let enabled = usize::from(is_first) + usize::from(is_second);
            for step in 0..4 {
                assert_eq!((scene.step(), sensed(&scene)), (enabled, enabled), "step {step} with {enabled}");
            }
        }
        assert!(scene.world.bodies[body].translation().x > 1.5, "the body has moved all the time");
    });
}

#[test]
fn upstream_435bevy_538_an_enabled_body_has_its_pairs_at_rest() {
    everywhere(|mut scene| {
        let [_, (body, collider), ..] = [0.0, 0.9, 1.8, 50.0].map(|x| scene.ball(x));
        assert_eq!(scene.step(), 2);
        for _ in 0..2 {
            scene.world.bodies[body].set_enabled(false);
            assert_eq!((scene.steps(3), scene.contacts()), (0, 0));
            scene.world.bodies[body].set_enabled(true);
            assert_eq!((scene.step(), touching(&scene)), (2, 2));
        }
        // A collider that the user disables stays so when its body comes back.
        scene.world.bodies[body].set_enabled(false);
        scene.world.colliders[collider].set_enabled(false);
        assert_eq!(scene.steps(2), 0);
        scene.world.bodies[body].set_enabled(true);
        assert_eq!((scene.steps(2), scene.contacts()), (0, 0));
        scene.world.colliders[collider].set_enabled(true);
        assert_eq!((scene.step(), touching(&scene)), (2, 2));
    });
}
