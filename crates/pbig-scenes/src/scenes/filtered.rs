//! Sensors, collision groups and kinematic bodies: overlapping boxes that need not be pairs.

use super::builder::{Builder, lattice, side_of_cube, side_of_square};
use super::falling::{cube, sphere};
use crate::plan::{Body, Collider};
use glam::Vec3;

/// The group of the moving walls.
const WALLS: u32 = 0b1000;

pub(super) fn sensors(b: &mut Builder, n: usize) {
    b.ground();
    let side = side_of_square(n.div_ceil(4));
    for i in 0..n {
        let place = lattice(i, side) * 1.5;
        match i % 3 {
            0 => {
                let half = b.random(0.4, 1.2);
                let sensor = Collider::cuboid(half, half, half).sensor();
                b.fixed(place + Vec3::Y, Collider { sees_fixed: i % 2 == 0, ..sensor });
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
        let own = 1 << (i % 3);
        b.falling(at, cube(i).groups(own, own | WALLS));
    }
    for x in [-4.0, 4.0 + side as f32 * 1.3] {
        let wall = Body::kinematic(Vec3::new(x, 3.0, 0.0)).linvel(Vec3::X * -x.signum());
        let reach = side as f32 * 1.3;
        b.add(wall, Collider::cuboid(0.5, 3.0, reach).groups(WALLS, u32::MAX));
    }
}
