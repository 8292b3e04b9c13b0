//! Scenes by name, count and seed. Built with glam; the same world for the same three, every time.
//!
//! A scene is a [`Plan`], plain data, from which each version of rapier builds its world.

mod all;
mod asteroids;
mod builder;
mod conveyor;
mod falling;
mod filtered;
mod jar;
mod ragdolls;
mod resting;

use crate::plan::Plan;
#[cfg(feature = "rapier")]
use crate::world::World;
use builder::Builder;
use rand::SeedableRng;
use rand::rngs::StdRng;

#[derive(Clone, Copy)]
pub struct Scene {
    pub name: &'static str,
    pub about: &'static str,
    pub hard: &'static str,
    /// Bodies when the user does not say how many.
    pub default_bodies: usize,
    build: fn(&mut Builder, usize),
}

impl Scene {
    /// Returns the scene with this name, or an error that lists them all.
    pub fn named(name: &str) -> Result<Self, String> {
        let names = || Self::ALL.map(|scene| scene.name).join(", ");
        let found = Self::ALL.into_iter().find(|scene| scene.name == name);
        found.ok_or_else(|| format!("no scene is called '{name}'; there are: {}", names()))
    }

    /// Returns the world with `bodies` dynamic and kinematic bodies. Figures of `ragdolls` are whole, so the last may be too
    /// many, and `groups` adds two walls. Houses of `city` and sensors of `conveyor` and `sensors` count as bodies.
    pub fn plan(&self, bodies: usize, seed: u64) -> Plan {
        let mut builder = Builder { plan: Plan::default(), rng: StdRng::seed_from_u64(seed) };
        (self.build)(&mut builder, bodies);
        builder.plan
    }

    /// Builds that world on rapier 0.27.
    #[cfg(feature = "rapier")]
    pub fn build(&self, bodies: usize, seed: u64) -> World {
        World::of(&self.plan(bodies, seed))
    }
}

#[cfg(all(test, feature = "rapier"))]
mod tests {
    use super::*;
    use rapier3d::prelude::*;

    /// Returns the number of dynamic and kinematic bodies, and of fixed parts that count as bodies.
    fn bodies_of(name: &str, world: &World) -> usize {
        let counts = |collider: &Collider| match name {
            "city" => collider.shape().as_cuboid().is_some(),
            "conveyor" | "sensors" => collider.is_sensor(),
            _ => false,
        };
        let fixed =
            world.colliders.iter().filter(|(_, collider)| collider.parent().is_none() && counts(collider));
        world.bodies.iter().filter(|(_, body)| !body.is_fixed()).count() + fixed.count()
    }

    fn expected(name: &str, bodies: usize) -> usize {
        match name {
            "ragdolls" => bodies.next_multiple_of(11),
            "groups" => bodies + 2,
            _ => bodies,
        }
    }

    #[test]
    fn every_scene_builds_at_every_size_and_the_same_each_time() {
        for scene in Scene::ALL {
            for bodies in [0, 1, 2, 7, 100, 1001] {
                let world = scene.build(bodies, 1);
                let counted = bodies_of(scene.name, &world);
                assert_eq!(counted, expected(scene.name, bodies), "{}", scene.name);
                assert_eq!(world.pose_bits(), scene.build(bodies, 1).pose_bits(), "{}", scene.name);
            }
            assert!(!scene.about.is_empty() && !scene.hard.is_empty());
        }
    }

    #[test]
    fn a_wrong_name_is_answered_with_the_right_ones() {
        let error = Scene::named("colum").map(|s| s.name).unwrap_err();
        assert!(error.contains("'colum'") && error.contains("column, spheres"), "{error}");
    }
}
