//! The tests of [`super`] for any version of rapier, whose world and broad phase `super` names.

use super::{Subject, World, hand_over, subject, to_vector};
use glam::Vec3;
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use rapier3d::prelude::*;
use std::collections::HashSet;

/// An app that keeps the ordered pairs it was told of.
#[derive(Default)]
struct App {
    told: HashSet<(ColliderHandle, ColliderHandle)>,
    ends: usize,
    lost: usize,
}

impl App {
    fn step(&mut self, world: &mut World, broad_phase: &mut Subject) {
        for event in world.step_with_events(broad_phase) {
            match event {
                CollisionEvent::Started(a, b, _) => _ = self.told.insert((a, b)),
                CollisionEvent::Stopped(a, b, _) => {
                    self.ends += 1;
                    self.lost += usize::from(!self.told.remove(&(a, b)));
                }
            }
        }
    }
}

fn listening(collider: ColliderBuilder) -> ColliderBuilder {
    collider.active_events(ActiveEvents::COLLISION_EVENTS).active_collision_types(ActiveCollisionTypes::all())
}

fn add_ball(world: &mut World, at: Vec3, is_sensor: bool) -> RigidBodyHandle {
    let body = World::dynamic(at).gravity_scale(0.0);
    world.add(body, listening(ColliderBuilder::ball(0.4)).sensor(is_sensor))
}

/// A fixed zone, and a ball in it.
fn zone() -> (World, RigidBodyHandle) {
    let mut world = World::default();
    world.colliders.insert(listening(ColliderBuilder::cuboid(2.0, 2.0, 2.0).sensor(true)));
    let first = add_ball(&mut world, Vec3::ZERO, false);
    (world, first)
}

#[test]
fn a_ball_that_leaves_a_zone_in_one_step_leaves_as_it_came() {
    for leave in [
        (|world, first| world.bodies[first].set_translation(to_vector(50.0 * Vec3::X), true))
            as fn(&mut World, RigidBodyHandle),
        |world, first| {
            let collider = world.bodies[first].colliders()[0];
            world.colliders[collider].set_collision_groups(InteractionGroups::none());
        },
        |world, first| world.bodies[first].set_linvel(to_vector(5000.0 * Vec3::X), true),
    ] {
        let ((mut world, first), mut broad_phase, mut app) = (zone(), subject(), App::default());
        app.step(&mut world, &mut broad_phase);
        assert_eq!(app.told.len(), 1);
        for i in 0..4 {
            add_ball(&mut world, Vec3::new(0.9 * i as f32 - 1.4, 1.4, 0.0), false);
        }
        app.step(&mut world, &mut broad_phase);
        leave(&mut world, first);
        (0..3).for_each(|_| app.step(&mut world, &mut broad_phase));
        assert_eq!((app.ends, app.lost, app.told.len()), (1, 0, 4));
    }
}

#[test]
fn pairs_keep_their_order_whoever_finds_them_next() {
    let mut ends = 0;
    for seed in 0..60 {
        let ((mut world, _), mut broad_phase, mut app) = (zone(), subject(), App::default());
        let mut rng = StdRng::seed_from_u64(seed);
        for round in 0..60 {
            let at = Vec3::from_array([0.0; 3].map(|_: f32| rng.random_range(-3.0..3.0)));
            let bodies: Vec<_> = world.bodies.iter().map(|(handle, _)| handle).collect();
            let body = bodies[rng.random_range(0..bodies.len())];
            match rng.random_range(0..8) {
                0 | 1 => _ = add_ball(&mut world, at, round % 3 == 0),
                2 => {
                    let size = rng.random_range(0.1..3.0);
                    let collider = world.bodies[body].colliders()[0];
                    world.colliders[collider].set_shape(SharedShape::cuboid(size, size, size));
                }
                3 => hand_over(&mut world, &mut broad_phase, &mut rng),
                4 => world.bodies[body].set_body_type(RigidBodyType::KinematicPositionBased, true),
                _ => world.bodies[body].set_translation(to_vector(at), true),
            }
            app.step(&mut world, &mut broad_phase);
        }
        assert_eq!(app.lost, 0, "seed {seed}: {} ends", app.ends);
        ends += app.ends;
    }
    assert!(ends > 500, "{ends}");
}

/// The checker of this file can fail.
#[test]
fn an_end_in_the_other_order_is_noticed() {
    let ((mut world, first), mut broad_phase, mut app) = (zone(), subject(), App::default());
    app.step(&mut world, &mut broad_phase);
    let (a, b) = *app.told.iter().next().expect("the ball is in the zone");
    app.told = HashSet::from([(b, a)]);
    world.bodies[first].set_translation(to_vector(50.0 * Vec3::X), true);
    app.step(&mut world, &mut broad_phase);
    assert_eq!((app.ends, app.lost), (1, 1));
}
