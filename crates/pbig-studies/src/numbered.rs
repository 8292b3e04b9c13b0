//! A scene whose bodies keep their numbers whatever the order in which they are inserted.

use pbig_harness::world::World;
use rand::SeedableRng;
use rand::rngs::StdRng;
use rand::seq::SliceRandom;
use rapier3d::prelude::*;
use std::collections::HashMap;

/// A world, and its bodies by number.
pub struct Numbered {
    /// The world.
    pub world: World,
    /// By number: the body's handle in this world.
    pub bodies: Vec<RigidBodyHandle>,
}

/// The distances between the bodies of two worlds, in the world's length unit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Apart {
    /// Over all bodies.
    pub mean: f64,
    /// The largest distance.
    pub max: f64,
}

impl Numbered {
    /// Bodies are numbered in the order in which they were inserted.
    pub fn new(world: World) -> Self {
        let bodies = world.bodies.iter().map(|(handle, _)| handle).collect();
        Self { world, bodies }
    }

    /// As [`Numbered::inserted`], in an order drawn from the seed.
    pub fn permuted(&self, seed: u64) -> Self {
        let mut order: Vec<usize> = (0..self.bodies.len()).collect();
        order.shuffle(&mut StdRng::seed_from_u64(seed));
        self.inserted(&order)
    }

    /// Returns this world before its first step, with bodies inserted in the given order of numbers. Their colliders are in
    /// that order too, after those that have no body. Articulations are left out; no scene has any.
    pub fn inserted(&self, order: &[usize]) -> Self {
        let from = &self.world;
        let mut world = World::with_gravity(from.gravity);
        world.params = from.params;
        let mut bodies = vec![RigidBodyHandle::invalid(); self.bodies.len()];
        for (_, collider) in from.colliders.iter().filter(|(_, collider)| collider.parent().is_none()) {
            world.colliders.insert(collider.clone());
        }
        for &number in order {
            let body = &from.bodies[self.bodies[number]];
            bodies[number] = world.bodies.insert(body.clone());
            for &collider in body.colliders() {
                let collider = from.colliders[collider].clone();
                world.colliders.insert_with_parent(collider, bodies[number], &mut world.bodies);
            }
        }
        let mut copy = Self { world, bodies };
        self.join(&mut copy);
        copy
    }

    /// Joints as here, in their order.
    fn join(&self, copy: &mut Self) {
        let there: HashMap<_, _> = self.bodies.iter().zip(&copy.bodies).collect();
        for (_, joint) in self.world.impulse_joints.iter() {
            if let (Some(&&one), Some(&&other)) = (there.get(&joint.body1), there.get(&joint.body2)) {
                copy.world.impulse_joints.insert(one, other, joint.data, true);
            }
        }
    }

    /// The distances between bodies of one number, of their positions.
    pub fn apart(&self, other: &Self) -> Apart {
        let place = |of: &Self, body: RigidBodyHandle| of.world.bodies[body].translation().map(f64::from);
        let pairs = self.bodies.iter().zip(&other.bodies);
        let distances = pairs.map(|(&one, &two)| (place(self, one) - place(other, two)).norm());
        let (sum, max) = distances.fold((0.0, 0.0), |(sum, max): (f64, f64), by| (sum + by, max.max(by)));
        Apart { mean: sum / self.bodies.len().max(1) as f64, max }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pbig_harness::scenes::Scene;
    use rapier_pbig::PbigBroadPhase;

    fn scene(name: &str) -> Numbered {
        Numbered::new(Scene::named(name).expect("a scene").build(40, 1))
    }

    /// With rapier's own broad phase no two runs are the same.
    fn stepped(mut one: Numbered) -> Numbered {
        let mut broad_phase = PbigBroadPhase::new();
        (0..90).for_each(|_| one.world.step(&mut broad_phase));
        one
    }

    #[test]
    fn in_the_old_order_it_is_the_same_world_bit_by_bit() {
        for name in ["column", "ragdolls", "compounds"] {
            let original = scene(name);
            let order: Vec<usize> = (0..original.bodies.len()).collect();
            let copy = stepped(original.inserted(&order));
            let original = stepped(original);
            assert_eq!(copy.world.pose_bits(), original.world.pose_bits(), "{name}");
            assert_eq!(copy.apart(&original), Apart::default());
        }
    }

    #[test]
    fn in_another_order_it_starts_as_the_same_world_and_ends_as_another() {
        let original = scene("ragdolls");
        let other = original.permuted(1);
        assert_eq!(other.world.impulse_joints.len(), original.world.impulse_joints.len());
        assert_eq!(other.apart(&original), Apart::default());
        assert_ne!(other.world.pose_bits(), original.world.pose_bits(), "the order of handles");
        assert!(stepped(other).apart(&stepped(original)).max > 0.0);
    }
}
