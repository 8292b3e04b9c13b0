//! Measurements of a world's mechanics: contacts, penetration, energy and momentum.

use glam::DVec3;
use pbig_harness::world::{World, to_vector};
use rapier3d::prelude::*;

/// A world after a step. Of bodies, the dynamic ones.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Mechanics {
    /// Pairs of colliders that rapier holds to be in contact: within its prediction distance, 2 mm unless told.
    pub(super) contacts: u64,
    /// Their contact points.
    pub(super) points: u64,
    /// The depth of the deepest point, in metres; 0 if none is inside.
    pub(super) deepest: f64,
    /// The mean depth of all points, in metres. A point outside counts as 0.
    pub(super) mean_penetration: f64,
    /// Joules.
    pub(super) kinetic: f64,
    /// Joules, 0 at the origin; taken half a step of rapier's solver back, where the velocities belong, so that a body
    /// in free fall keeps the sum of its energies.
    pub(super) potential: f64,
    /// The sum over bodies, kg m/s.
    pub(super) momentum: DVec3,
    /// The sum of the lengths of the bodies' momenta.
    pub(super) speed: f64,
}

impl Mechanics {
    pub(super) fn of(world: &World) -> Self {
        let mut found = Self::default();
        let bodies = world.bodies.iter().filter(|(_, body)| body.is_dynamic());
        bodies.for_each(|(_, body)| found.add(world, body));
        let pairs = world.narrow_phase.contact_pairs().filter(|pair| pair.has_any_active_contact);
        for pair in pairs {
            found.contacts += 1;
            for point in pair.manifolds.iter().flat_map(|manifold| &manifold.points) {
                let inside = f64::from(-point.dist).max(0.0);
                found.points += 1;
                found.deepest = found.deepest.max(inside);
                // The sum, until all are in.
                found.mean_penetration += inside;
            }
        }
        found.mean_penetration /= found.points.max(1) as f64;
        found
    }

    pub(super) fn energy(&self) -> f64 {
        self.kinetic + self.potential
    }

    fn add(&mut self, world: &World, body: &RigidBody) {
        let mass = f64::from(body.mass());
        let momentum = DVec3::from_array(body.linvel().map(|v| f64::from(v) * mass).into());
        self.kinetic += f64::from(body.kinetic_energy());
        // Rapier's solver makes so many small steps of each.
        let dt = world.params.dt / world.params.num_solver_iterations.get() as Real;
        self.potential += f64::from(body.gravitational_potential_energy(dt, to_vector(world.gravity)));
        self.speed += momentum.length();
        self.momentum += momentum;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    fn near(found: f64, right: f64) {
        assert!((found - right).abs() <= 1e-5 * right.abs().max(1.0), "{found}, not {right}");
    }

    /// Measures after a step of no length, which only finds masses and contacts.
    fn measured(mut world: World) -> Mechanics {
        world.params.dt = 0.0;
        world.step(&mut DefaultBroadPhase::new());
        Mechanics::of(&world)
    }

    fn ball(radius: f32, mass: f32) -> ColliderBuilder {
        ColliderBuilder::ball(radius).mass(mass)
    }

    #[test]
    fn contacts_energy_and_momentum_by_hand() {
        let mut world = World::with_gravity(Vec3::ZERO);
        // Inside each other by 0.1, by 0.3, and 1 apart.
        for x in [0.0, 0.9, 1.6, 3.6] {
            world.add(World::dynamic(Vec3::X * x), ball(0.5, 1.0));
        }
        let found = measured(world);
        assert_eq!((found.contacts, found.points), (2, 2));
        near(found.deepest, 0.3);
        near(found.mean_penetration, 0.2);

        let mut world = World::with_gravity(Vec3::new(0.0, -10.0, 0.0));
        let moving = |at: Vec3, v: Vec3| World::dynamic(at).linvel(to_vector(v));
        world.add(moving(Vec3::Y * 3.0, Vec3::X * 2.0), ball(0.5, 2.0));
        let spin = moving(Vec3::new(9.0, 1.0, 0.0), Vec3::X * -1.0).angvel(vector![0.0, 4.0, 0.0]);
        world.add(spin, ball(0.5, 5.0));
        let kinematic = RigidBodyBuilder::kinematic_velocity_based().linvel(vector![7.0, 0.0, 0.0]);
        world.add(kinematic.translation(vector![0.0, 20.0, 0.0]), ball(0.5, 3.0));
        let found = measured(world);
        // Half of m v^2 twice, and of I w^2 with I = 2/5 m r^2; then m g h.
        near(found.kinetic, 4.0 + 2.5 + 0.5 * (0.4 * 5.0 * 0.25) * 16.0);
        near(found.energy(), found.kinetic + 10.0 * (2.0 * 3.0 + 5.0 * 1.0));
        near(found.momentum.x, -1.0);
        near(found.speed, 9.0);
    }
}
