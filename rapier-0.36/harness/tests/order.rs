//! A pair ends in the order in which it began: the checks of `pbig_scenes::pair_order`.

use glam::Vec3;
use pbig_harness_036::dimension::cuboid;
use pbig_harness_036::world::{dynamic, from_bytes, to_bytes, to_vector, with};
use pbig_scenes::pair_order::{self, Change, Told, Zone};
use rand::RngExt;
use rand::rngs::StdRng;
use rapier::prelude::*;
use std::sync::mpsc::channel;

struct InRapier {
    world: PhysicsWorld,
    balls: Vec<RigidBodyHandle>,
}

fn listening(collider: ColliderBuilder) -> ColliderBuilder {
    collider.active_events(ActiveEvents::COLLISION_EVENTS).active_collision_types(ActiveCollisionTypes::all())
}

impl Zone for InRapier {
    fn new() -> Self {
        let mut world = with(rapier_pbig::broad_phase());
        world.colliders.insert(listening(ColliderBuilder::new(cuboid(Vec3::splat(2.0)))).sensor(true));
        Self { world, balls: Vec::new() }
    }

    fn add_ball(&mut self, at: Vec3, is_sensor: bool) {
        let (body, ball) = (dynamic(at).gravity_scale(0.0), listening(ColliderBuilder::ball(0.4)));
        self.balls.push(self.world.insert(body, ball.sensor(is_sensor)).0);
    }

    fn change(&mut self, ball: usize, change: Change) {
        let PhysicsWorld { bodies, colliders, .. } = &mut self.world;
        let body = &mut bodies[self.balls[ball]];
        let collider = &mut colliders[body.colliders()[0]];
        match change {
            Change::Move(at) => body.set_translation(to_vector(at), true),
            Change::Throw(velocity) => body.set_linvel(to_vector(velocity), true),
            Change::Exclude => collider.set_collision_groups(InteractionGroups::none()),
            Change::Resize(half) => collider.set_shape(cuboid(Vec3::splat(half))),
            Change::MakeKinematic => body.set_body_type(RigidBodyType::KinematicPositionBased, true),
        }
    }

    /// Changes who finds the pairs: nobody, by a save and a restore, with or without pbig afterwards, or at once.
    fn hand_over(&mut self, rng: &mut StdRng) {
        let world = &mut self.world;
        match rng.random_range(0..5) {
            0 => rapier_pbig::uninstall(&mut world.broad_phase),
            1 => rapier_pbig::install(&mut world.broad_phase),
            kind @ (2 | 3) => {
                *world = from_bytes(&to_bytes(world));
                if kind == 3 {
                    rapier_pbig::install(&mut world.broad_phase);
                }
            }
            _ => world.broad_phase = world.broad_phase.clone(),
        }
    }

    fn step(&mut self) -> Vec<Told> {
        let parts =
            |one: ColliderHandle, other: ColliderHandle| [one.into_raw_parts(), other.into_raw_parts()];
        let told = |event| match event {
            CollisionEvent::Started(one, other, _) => (true, parts(one, other)),
            CollisionEvent::Stopped(one, other, _) => (false, parts(one, other)),
        };
        let (send, received) = channel();
        self.world.step_with_events(&(), &ChannelEventCollector::new(send, channel().0, channel().0));
        received.try_iter().map(told).collect()
    }
}

#[test]
fn pairs_end_in_the_order_in_which_they_began() {
    pair_order::a_ball_that_leaves_a_zone_leaves_as_it_came::<InRapier>();
    pair_order::pairs_keep_their_order_whoever_finds_them_next::<InRapier>();
    pair_order::an_end_in_the_other_order_is_noticed::<InRapier>();
}
