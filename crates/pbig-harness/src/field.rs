//! Boxes as colliders of a rapier world, moved by hand: a broad phase's call without the rest of a step.

use crate::world::{World, to_vector};
use glam::Vec3;
use pbig_core::Aabb;
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use rapier3d::prelude::*;

/// A cuboid on a dynamic body of its own for each box.
pub struct Field {
    pub world: World,
    /// The cuboids, in the order of the boxes.
    pub colliders: Vec<ColliderHandle>,
    bodies: Vec<RigidBodyHandle>,
    rng: StdRng,
}

impl Field {
    pub fn new(boxes: &[Aabb]) -> Self {
        let mut world = World::default();
        let bodies: Vec<RigidBodyHandle> = boxes.iter().map(|aabb| add(&mut world, aabb)).collect();
        let colliders = bodies.iter().map(|&body| world.bodies[body].colliders()[0]).collect();
        Self { world, colliders, bodies, rng: StdRng::seed_from_u64(3) }
    }

    /// Moves some of them by up to `distance` along each axis and returns their handles, as a step lists
    /// what it has moved.
    pub fn shift(&mut self, movers: &[u32], distance: f32) -> Vec<ColliderHandle> {
        for &mover in movers {
            let by: [f32; 3] = std::array::from_fn(|_| self.rng.random_range(-distance..=distance));
            let body = self.world.bodies.get_mut(self.bodies[mover as usize]).expect("none is removed");
            body.set_translation(body.translation() + to_vector(Vec3::from_array(by)), false);
        }
        let World { bodies, colliders, .. } = &mut self.world;
        bodies.propagate_modified_body_positions_to_colliders(colliders);
        movers.iter().map(|&mover| self.colliders[mover as usize]).collect()
    }

    /// Calls a broad phase as a step does.
    pub fn call(
        &self,
        broad_phase: &mut dyn BroadPhase,
        modified: &[ColliderHandle],
        events: &mut Vec<BroadPhasePairEvent>,
    ) {
        let World { params, colliders, bodies, .. } = &self.world;
        broad_phase.update(params, colliders, bodies, modified, &[], events);
    }
}

fn add(world: &mut World, aabb: &Aabb) -> RigidBodyHandle {
    let (min, max) = (Vec3::from_array(aabb.min), Vec3::from_array(aabb.max));
    let half = (max - min) / 2.0;
    world.add(World::dynamic((min + max) / 2.0), ColliderBuilder::cuboid(half.x, half.y, half.z))
}
