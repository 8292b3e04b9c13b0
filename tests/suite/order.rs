//! A pair ends in the order in which it began, whatever becomes of its colliders in between: an app that keeps ordered pairs of
//! handles must not keep one for ever.

use pbig_harness::world::World;
use rand::rngs::SmallRng;
use rand::{RngExt, SeedableRng};
use rapier_pbig::PbigBroadPhase;
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
    fn step(&mut self, world: &mut World, broad_phase: &mut PbigBroadPhase) {
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

fn add_ball(world: &mut World, at: [f32; 3], is_sensor: bool) -> RigidBodyHandle {
    let body = World::dynamic(at.into()).gravity_scale(0.0);
    world.add(body, listening(ColliderBuilder::ball(0.4)).sensor(is_sensor))
}

/// A fixed zone, and a ball in it.
fn zone() -> (World, RigidBodyHandle) {
    let mut world = World::default();
    world.colliders.insert(listening(ColliderBuilder::cuboid(2.0, 2.0, 2.0).sensor(true)));
    let first = add_ball(&mut world, [0.0; 3], false);
    (world, first)
}

#[test]
fn a_ball_that_leaves_a_zone_in_one_step_leaves_as_it_came() {
    for leave in [
        (|world, first| world.bodies[first].set_translation(vector![50.0, 0.0, 0.0], true))
            as fn(&mut World, RigidBodyHandle),
        |world, first| {
            let collider = world.bodies[first].colliders()[0];
            world.colliders[collider].set_collision_groups(InteractionGroups::none());
        },
        |world, first| world.bodies[first].set_linvel(vector![5000.0, 0.0, 0.0], true),
    ] {
        let ((mut world, first), mut ours, mut app) = (zone(), PbigBroadPhase::new(), App::default());
        app.step(&mut world, &mut ours);
        assert_eq!(app.told.len(), 1);
        for i in 0..4 {
            add_ball(&mut world, [0.9 * i as f32 - 1.4, 1.4, 0.0], false);
        }
        app.step(&mut world, &mut ours);
        leave(&mut world, first);
        (0..3).for_each(|_| app.step(&mut world, &mut ours));
        assert_eq!((app.ends, app.lost, app.told.len()), (1, 0, 4));
    }
}

/// Restores the broad phase, or takes the world over with a new one.
fn hand_over(world: &mut World, ours: &mut PbigBroadPhase, kind: u32) {
    match kind {
        0 => {
            *ours = PbigBroadPhase::new();
            ours.adopt(&world.narrow_phase);
        }
        1 => ours.adopt(&world.narrow_phase),
        2 => *ours = ours.clone(),
        _ => {
            let bytes = postcard::to_stdvec(ours).expect("a snapshot");
            *ours = postcard::from_bytes(&bytes).expect("what was saved");
            *world = World::from_bytes(&world.to_bytes()).expect("the bytes of a world");
        }
    }
}

#[test]
fn pairs_keep_their_order_over_restores_and_takeovers() {
    let mut ends = 0;
    for seed in 0..60 {
        let ((mut world, _), mut ours, mut app) = (zone(), PbigBroadPhase::new(), App::default());
        let mut rng = SmallRng::seed_from_u64(seed);
        for round in 0..60 {
            let at = [0.0; 3].map(|_: f32| rng.random_range(-3.0..3.0));
            let bodies: Vec<_> = world.bodies.iter().map(|(handle, _)| handle).collect();
            let body = bodies[rng.random_range(0..bodies.len())];
            match rng.random_range(0..8) {
                0 | 1 => _ = add_ball(&mut world, at, round % 3 == 0),
                2 => {
                    let size = rng.random_range(0.1..3.0);
                    let collider = world.bodies[body].colliders()[0];
                    world.colliders[collider].set_shape(SharedShape::cuboid(size, size, size));
                }
                3 => hand_over(&mut world, &mut ours, rng.random_range(0..4)),
                4 => world.bodies[body].set_body_type(RigidBodyType::KinematicPositionBased, true),
                _ => world.bodies[body].set_translation(at.into(), true),
            }
            app.step(&mut world, &mut ours);
        }
        assert_eq!(app.lost, 0, "seed {seed}: {} ends", app.ends);
        ends += app.ends;
    }
    assert!(ends > 500, "{ends}");
}

/// The checker of this file can fail.
#[test]
fn an_end_in_the_other_order_is_noticed() {
    let ((mut world, _), mut ours, mut app) = (zone(), PbigBroadPhase::new(), App::default());
    app.step(&mut world, &mut ours);
    let (a, b) = *app.told.iter().next().expect("the ball is in the zone");
    app.told = HashSet::from([(b, a)]);
    let ball = world.bodies.iter().next().expect("a ball").0;
    world.bodies[ball].set_translation(vector![50.0, 0.0, 0.0], true);
    app.step(&mut world, &mut ours);
    assert_eq!((app.ends, app.lost), (1, 1));
}
