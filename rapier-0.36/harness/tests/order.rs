//! A pair ends in the order in which it began, whatever becomes of its colliders in between: an app that keeps ordered pairs of
//! handles must not keep one for ever.

use glam::Vec3;
use pbig_harness_036::world::{World, to_vector};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use rapier3d::prelude::*;
use std::collections::HashSet;

type Told = HashSet<(ColliderHandle, ColliderHandle)>;

/// An app that keeps the ordered pairs it was told of.
#[derive(Default)]
struct App {
    told: Told,
    ends: usize,
    lost: usize,
}

impl App {
    fn step(&mut self, world: &mut World, broad_phase: &mut BroadPhaseBvh) {
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

fn ball(at: Vec3) -> (RigidBodyBuilder, ColliderBuilder) {
    (World::dynamic(at).gravity_scale(0.0), listening(ColliderBuilder::ball(0.4)))
}

/// A fixed zone, and a ball in it, which comes first or after others.
fn zone() -> (World, RigidBodyHandle) {
    let mut world = World::default();
    world.colliders.insert(listening(ColliderBuilder::cuboid(2.0, 2.0, 2.0).sensor(true)));
    let (body, collider) = ball(Vec3::ZERO);
    let first = world.add(body, collider);
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
        let ((mut world, first), mut broad_phase) = (zone(), rapier_pbig::broad_phase());
        let mut app = App::default();
        app.step(&mut world, &mut broad_phase);
        assert_eq!(app.told.len(), 1);
        for i in 0..4 {
            let (body, collider) = ball(Vec3::new(0.9 * i as f32 - 1.4, 1.4, 0.0));
            world.add(body, collider);
        }
        app.step(&mut world, &mut broad_phase);
        leave(&mut world, first);
        (0..3).for_each(|_| app.step(&mut world, &mut broad_phase));
        assert_eq!((app.ends, app.lost, app.told.len()), (1, 0, 4));
    }
}

/// Changes who finds the pairs: nobody, by a save and a restore, with or without pbig afterwards, or at once.
fn hand_over(world: &mut World, broad_phase: &mut BroadPhaseBvh, kind: u32) {
    match kind {
        0 => rapier_pbig::uninstall(broad_phase),
        1 => rapier_pbig::install(broad_phase),
        2 | 3 => {
            let bytes = world.to_bytes(broad_phase);
            (*world, *broad_phase) = World::from_bytes(&bytes).expect("the bytes of a world");
            if kind == 3 {
                rapier_pbig::install(broad_phase);
            }
        }
        _ => *broad_phase = broad_phase.clone(),
    }
}

#[test]
fn pairs_keep_their_order_over_any_change_of_who_finds_them() {
    let mut ends = 0;
    for seed in 0..60 {
        let ((mut world, _), mut broad_phase) = (zone(), rapier_pbig::broad_phase());
        let (mut app, mut rng) = (App::default(), StdRng::seed_from_u64(seed));
        for round in 0..60 {
            let at = Vec3::from_array([0.0; 3].map(|_: f32| rng.random_range(-3.0..3.0)));
            let bodies: Vec<_> = world.bodies.iter().map(|(handle, _)| handle).collect();
            let body = bodies[rng.random_range(0..bodies.len())];
            match rng.random_range(0..8) {
                0 | 1 => {
                    let (body, collider) = ball(at);
                    world.add(body, collider.sensor(round % 3 == 0));
                }
                2 => {
                    let size = rng.random_range(0.1..3.0);
                    let collider = world.bodies[body].colliders()[0];
                    world.colliders[collider].set_shape(SharedShape::cuboid(size, size, size));
                }
                3 => hand_over(&mut world, &mut broad_phase, rng.random_range(0..5)),
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
