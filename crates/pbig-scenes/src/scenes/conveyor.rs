//! Conveyors: rollers carry crates through gates, which are sensors.

use super::builder::{Builder, side_of_square};
use crate::world::{World, to_vector};
use glam::Vec3;
use rapier3d::prelude::*;

/// Bodies of one conveyor.
const ROLLERS: usize = 40;
const CRATES: usize = 20;
/// Gates are fixed and count as bodies.
const GATES: usize = 10;
const ROLLER_RADIUS: f32 = 0.14;
/// From roller to roller.
const ROLLER_DISTANCE: f32 = 0.3;
/// Height of the rollers' axes.
const HEIGHT: f32 = 1.2;
/// Metres a second on top of a roller.
const SPEED: f32 = 1.2;

/// Conveyors beside and behind each other.
pub(super) fn conveyor(b: &mut Builder, n: usize) {
    b.ground();
    let bodies = ROLLERS + CRATES + GATES;
    let conveyors = n.div_ceil(bodies);
    let rows = side_of_square(conveyors.div_ceil(4));
    for i in 0..conveyors {
        let at = Vec3::new((i % rows) as f32 * 18.0, HEIGHT, (i / rows) as f32 * 2.4);
        // A smaller conveyor for the bodies that are left.
        let left = bodies.min(n - i * bodies);
        let [rollers, crates] = [ROLLERS, CRATES].map(|of| (left * of).div_ceil(bodies));
        add_rollers(b, at, rollers);
        add_crates(b, at, crates);
        add_gates(b, at, left.saturating_sub(rollers + crates));
    }
}

fn add_rollers(b: &mut Builder, at: Vec3, n: usize) {
    for i in 0..n {
        let roller = RigidBodyBuilder::kinematic_velocity_based()
            .translation(to_vector(at + Vec3::X * (i as f32 * ROLLER_DISTANCE)))
            .angvel(to_vector(Vec3::Z * -SPEED / ROLLER_RADIUS));
        b.world.add(roller, ColliderBuilder::capsule_z(0.7, ROLLER_RADIUS).friction(1.0));
    }
}

/// Adds crates on the rollers, two above each other.
fn add_crates(b: &mut Builder, at: Vec3, n: usize) {
    for i in 0..n {
        let half = Vec3::new(b.random(0.3, 0.4), b.random(0.15, 0.3), b.random(0.2, 0.4));
        let x = 0.5 + (i / 2) as f32 * 1.1;
        let y = ROLLER_RADIUS + 0.02 + half.y + (i % 2) as f32 * 0.62;
        let crate_at = at + Vec3::new(x, y, b.random(-0.1, 0.1));
        let shape = ColliderBuilder::cuboid(half.x, half.y, half.z).friction(0.8);
        b.world.add(World::dynamic(crate_at).can_sleep(false), shape);
    }
}

/// Adds gates across the rollers.
fn add_gates(b: &mut Builder, at: Vec3, n: usize) {
    for i in 0..n {
        let place = Vec3::new((i as f32 + 0.5) * ROLLER_DISTANCE * (ROLLERS / GATES) as f32, 0.8, 0.0);
        b.fixed(at + place, ColliderBuilder::cuboid(0.05, 0.8, 0.9).sensor(true));
    }
}
