//! A pair ends in the order in which it began: the checks of `pbig_scenes::pair_order`.

use glam::Vec3;
use pbig_harness_036::dimension::cuboid;
use pbig_harness_036::world::{World, to_vector};
use pbig_scenes::pair_order::{self, Change, Told, Zone};
use rand::RngExt;
use rand::rngs::StdRng;
use rapier::prelude::*;

struct InRapier {
    world: World,
    broad_phase: BroadPhaseBvh,
    balls: Vec<RigidBodyHandle>,
}

fn listening(collider: ColliderBuilder) -> ColliderBuilder {
    collider.active_events(ActiveEvents::COLLISION_EVENTS).active_collision_types(ActiveCollisionTypes::all())
}

impl Zone for InRapier {
    fn new() -> Self {
        let mut world = World::default();
        world.colliders.insert(listening(ColliderBuilder::new(cuboid(Vec3::splat(2.0)))).sensor(true));
        Self { world, broad_phase: rapier_pbig::broad_phase(), balls: Vec::new() }
    }

    fn add_ball(&mut self, at: Vec3, is_sensor: bool) {
        let body = World::dynamic(at).gravity_scale(0.0);
        self.balls.push(self.world.add(body, listening(ColliderBuilder::ball(0.4)).sensor(is_sensor)));
    }

    fn change(&mut self, ball: usize, change: Change) {
        let World { bodies, colliders, .. } = &mut self.world;
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
        let Self { world, broad_phase, .. } = self;
        match rng.random_range(0..5) {
            0 => rapier_pbig::uninstall(broad_phase),
            1 => rapier_pbig::install(broad_phase),
            kind @ (2 | 3) => {
                let bytes = world.to_bytes(broad_phase);
                (*world, *broad_phase) = World::from_bytes(&bytes).expect("the bytes of a world");
                if kind == 3 {
                    rapier_pbig::install(broad_phase);
                }
            }
            _ => *broad_phase = broad_phase.clone(),
        }
    }

    fn step(&mut self) -> Vec<Told> {
        let parts =
            |one: ColliderHandle, other: ColliderHandle| [one.into_raw_parts(), other.into_raw_parts()];
        let told = |event| match event {
            CollisionEvent::Started(one, other, _) => (true, parts(one, other)),
            CollisionEvent::Stopped(one, other, _) => (false, parts(one, other)),
        };
        self.world.step_with_events(&mut self.broad_phase).into_iter().map(told).collect()
    }
}

#[test]
fn pairs_end_in_the_order_in_which_they_began() {
    pair_order::a_ball_that_leaves_a_zone_leaves_as_it_came::<InRapier>();
    pair_order::pairs_keep_their_order_whoever_finds_them_next::<InRapier>();
    pair_order::an_end_in_the_other_order_is_noticed::<InRapier>();
}
