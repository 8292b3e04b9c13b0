//! Worlds of one scene whose bodies were inserted in different orders.

use glam::Vec3;
use pbig_harness::output::Failure;
use pbig_harness::scenes::Scene;
use pbig_harness::world::{World, to_vector};
use rand::SeedableRng;
use rand::rngs::StdRng;
use rand::seq::SliceRandom;
use rapier3d::prelude::*;
use std::collections::HashMap;
use std::hash::{DefaultHasher, Hash, Hasher};

/// A world, and the handle of each body by its number. The number does not depend on the order of insertion.
pub(super) struct Numbered {
    pub(super) world: World,
    bodies: Vec<RigidBodyHandle>,
}

/// The one scene that the harness does not have: see [`cloud`].
pub(super) const CLOUD: &str = "cloud";

impl Numbered {
    pub(super) fn of_scene(scene: &str, bodies: usize) -> Result<Self, Failure> {
        Ok(Self::new(if scene == CLOUD { cloud(bodies) } else { Scene::named(scene)?.build(bodies, 1) }))
    }

    /// Numbers bodies in the order in which they were inserted.
    fn new(world: World) -> Self {
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

    /// Returns a hash of every number of every pose: the same exactly where two worlds with one order of bodies are.
    pub(super) fn hash(&self) -> u64 {
        let mut poses = DefaultHasher::new();
        self.world.pose_bits().hash(&mut poses);
        poses.finish()
    }
}

/// Balls and cubes that fly at a common centre and through each other's ways, without gravity, ground or sleep.
fn cloud(bodies: usize) -> World {
    let mut world = World::with_gravity(Vec3::ZERO);
    let side = (bodies as f32).cbrt().ceil() as usize;
    for i in 0..bodies {
        let place = [i % side, i / side % side, i / side / side].map(|k| k as f32 - side as f32 / 2.0);
        let at = Vec3::from_array(place) * 1.5;
        let velocity = -at + Vec3::new(0.5, 0.2 * (i % 7) as f32, -0.3);
        let shape =
            if i % 2 == 0 { ColliderBuilder::ball(0.5) } else { ColliderBuilder::cuboid(0.4, 0.4, 0.4) };
        world.add(World::dynamic(at).linvel(to_vector(velocity)).can_sleep(false), shape);
    }
    world
}

#[cfg(test)]
mod tests {
    use super::*;
    use rapier_pbig::PbigBroadPhase;

    /// Runs with pbig: with rapier's own broad phase no two runs are the same.
    fn stepped(mut one: Numbered) -> Numbered {
        let mut broad_phase = PbigBroadPhase::new();
        (0..90).for_each(|_| one.world.step(&mut broad_phase));
        one
    }

    #[test]
    fn the_old_order_gives_the_same_world_and_another_does_not() {
        for name in ["column", "ragdolls", "compounds"] {
            let scene = || Numbered::of_scene(name, 40).expect("a scene");
            let (original, other) = (scene(), scene().inserted(Some(1)));
            assert_eq!(other.world.impulse_joints.len(), original.world.impulse_joints.len());
            assert_eq!(other.apart(&original), [0.0; 2]);
            assert_ne!(other.hash(), original.hash(), "the order of handles");
            let (copy, original) = (stepped(original.inserted(None)), stepped(original));
            assert_eq!(copy.hash(), original.hash(), "{name}");
            assert!(stepped(other).apart(&original)[1] > 0.0, "{name}");
        }
    }
}
