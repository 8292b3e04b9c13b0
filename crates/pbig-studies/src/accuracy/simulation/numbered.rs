//! A scene whose bodies keep their numbers whatever the order in which they are inserted.

use pbig_harness::world::World;
use rand::SeedableRng;
use rand::rngs::StdRng;
use rand::seq::SliceRandom;
use rapier3d::prelude::*;
use std::collections::HashMap;

/// A world, and the handle of each body by its number.
pub(super) struct Numbered {
    pub(super) world: World,
    pub(super) bodies: Vec<RigidBodyHandle>,
}

impl Numbered {
    /// Numbers bodies in the order in which they were inserted.
    pub(super) fn new(world: World) -> Self {
        let bodies = world.bodies.iter().map(|(handle, _)| handle).collect();
        Self { world, bodies }
    }

    /// Returns this world before its first step, with bodies inserted in an order drawn from the seed; without one, in their
    /// own. Their colliders are in that order too, after those without a body. No scene has articulations.
    pub(super) fn inserted(&self, seed: Option<u64>) -> Self {
        let mut order: Vec<usize> = (0..self.bodies.len()).collect();
        if let Some(seed) = seed {
            order.shuffle(&mut StdRng::seed_from_u64(seed));
        }
        let from = &self.world;
        let mut world = World::with_gravity(from.gravity);
        world.params = from.params;
        let mut bodies = vec![RigidBodyHandle::invalid(); self.bodies.len()];
        for (_, collider) in from.colliders.iter().filter(|(_, collider)| collider.parent().is_none()) {
            world.colliders.insert(collider.clone());
        }
        for number in order {
            let body = &from.bodies[self.bodies[number]];
            bodies[number] = world.bodies.insert(body.clone());
            for &collider in body.colliders() {
                let collider = from.colliders[collider].clone();
                world.colliders.insert_with_parent(collider, bodies[number], &mut world.bodies);
            }
        }
        let there: HashMap<_, _> = self.bodies.iter().zip(&bodies).collect();
        for (_, joint) in from.impulse_joints.iter() {
            world.impulse_joints.insert(*there[&joint.body1], *there[&joint.body2], joint.data, true);
        }
        Self { world, bodies }
    }

    /// Returns the mean and the largest distance between the positions of bodies of one number.
    pub(super) fn apart(&self, other: &Self) -> [f64; 2] {
        let place = |of: &Self, body: RigidBodyHandle| of.world.bodies[body].translation().map(f64::from);
        let pairs = self.bodies.iter().zip(&other.bodies);
        let distances = pairs.map(|(&one, &two)| (place(self, one) - place(other, two)).norm());
        let [sum, most] = distances.fold([0.0, 0.0], |[sum, most]: [f64; 2], by| [sum + by, most.max(by)]);
        [sum / self.bodies.len().max(1) as f64, most]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pbig_harness::scenes::Scene;
    use rapier_pbig::PbigBroadPhase;

    /// With rapier's own broad phase no two runs are the same.
    fn stepped(mut one: Numbered) -> Numbered {
        let mut broad_phase = PbigBroadPhase::new();
        (0..90).for_each(|_| one.world.step(&mut broad_phase));
        one
    }

    #[test]
    fn in_the_old_order_it_is_the_same_world_and_in_another_it_ends_elsewhere() {
        for name in ["column", "ragdolls", "compounds"] {
            let scene = || Numbered::new(Scene::named(name).expect("a scene").build(40, 1));
            let (original, other) = (scene(), scene().inserted(Some(1)));
            assert_eq!(other.world.impulse_joints.len(), original.world.impulse_joints.len());
            assert_eq!(other.apart(&original), [0.0; 2]);
            assert_ne!(other.world.pose_bits(), original.world.pose_bits(), "the order of handles");
            let (copy, original) = (stepped(original.inserted(None)), stepped(original));
            assert_eq!(copy.world.pose_bits(), original.world.pose_bits(), "{name}");
            assert!(stepped(other).apart(&original)[1] > 0.0, "{name}");
        }
    }
}
