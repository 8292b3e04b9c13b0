//! Sensors, collision groups and kinematic bodies: overlapping boxes that need not be pairs.

use super::builder::{Builder, lattice, side_of_cube, side_of_square};
use super::falling::{cube, sphere};
use crate::world::{groups_that_meet, to_vector};
use glam::Vec3;
use rapier3d::prelude::*;

pub(super) fn sensors(b: &mut Builder, n: usize) {
    b.ground();
    let side = side_of_square(n.div_ceil(4));
    for i in 0..n {
        let place = lattice(i, side) * 1.5;
        let types = ActiveCollisionTypes::default() | ActiveCollisionTypes::FIXED_FIXED;
        match i % 3 {
            0 => {
                let half = b.random(0.4, 1.2);
                let sensor = ColliderBuilder::cuboid(half, half, half).sensor(true);
                let sees_fixed = if i % 2 == 0 { sensor.active_collision_types(types) } else { sensor };
                b.fixed(place + Vec3::Y, sees_fixed);
            }
            _ => {
                let jitter = b.random_vec(Vec3::splat(0.2));
                b.falling(place + jitter + Vec3::Y * 6.0, sphere(i));
            }
        }
    }
}

pub(super) fn groups(b: &mut Builder, n: usize) {
    b.ground();
    let side = side_of_cube(n.div_ceil(3));
    for i in 0..n {
        // Three crowds in one place: neighbours in the list stand inside each other.
        let spot = i / 3;
        let place = lattice(spot, side);
        let at = place * 1.3 + b.random_vec(Vec3::splat(0.05)) + Vec3::Y;
        let own = Group::from_bits_truncate(1 << (i % 3));
        let groups = groups_that_meet(own, own | Group::GROUP_4);
        b.falling(at, cube(i).collision_groups(groups));
    }
    let all = groups_that_meet(Group::GROUP_4, Group::ALL);
    for x in [-4.0, 4.0 + side as f32 * 1.3] {
        let wall = RigidBodyBuilder::kinematic_velocity_based()
            .translation(to_vector(Vec3::new(x, 3.0, 0.0)))
            .linvel(to_vector(Vec3::X * -x.signum()));
        let reach = side as f32 * 1.3;
        b.world.add(wall, ColliderBuilder::cuboid(0.5, 3.0, reach).collision_groups(all));
    }
}
