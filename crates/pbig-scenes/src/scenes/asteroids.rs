//! An asteroid field: no gravity, bodies of very different sizes, all in motion.

use super::builder::{Builder, side_of_square};
use crate::world::{World, to_rotation, to_vector};
use glam::Vec3;
use rapier3d::prelude::*;

/// Half the edge of the cubes that the field is divided into, and of their smallest parts.
const LARGEST: f32 = 8.0;
const SMALLEST: f32 = 0.25;
/// Of 1: cubes with one asteroid, and cubes that are divided into eight. The others are empty.
const FILLED: f32 = 0.45;
const DIVIDED: f32 = 0.35;
/// Mean number of asteroids in one of the largest cubes, about.
const MEAN: usize = 120;

/// A flat field of cubes. A cube holds one asteroid, or is divided, or is empty, so that none begins inside another.
pub(super) fn asteroids(b: &mut Builder, n: usize) {
    b.world.gravity = Vec3::ZERO;
    let mut left = n;
    for layer in 0.. {
        for (x, z) in from_the_middle(n) {
            let cube = Vec3::new(x as f32, layer as f32, z as f32) * 2.0 * LARGEST;
            left = fill(b, cube, LARGEST, left);
        }
        if left == 0 {
            break;
        }
    }
}

/// Returns the cubes of a layer that has room for `n` asteroids, from the middle outward.
fn from_the_middle(n: usize) -> Vec<(i32, i32)> {
    let reach = side_of_square(n.div_ceil(MEAN)) as i32;
    let mut cubes: Vec<_> = (-reach..=reach).flat_map(|x| (-reach..=reach).map(move |z| (x, z))).collect();
    cubes.sort_by_key(|(x, z)| x * x + z * z);
    cubes
}

/// Fills a cube with at most `left` asteroids, and returns how many are left.
fn fill(b: &mut Builder, cube: Vec3, half: f32, left: usize) -> usize {
    let draw = b.random(0.0, 1.0);
    if left == 0 {
        0
    } else if draw < FILLED {
        asteroid(b, cube, half);
        left - 1
    } else if draw < FILLED + DIVIDED && half > SMALLEST {
        (0..8).fold(left, |left, part| {
            let sign = |bit: usize| if part & bit == 0 { -0.5 } else { 0.5 };
            fill(b, cube + Vec3::new(sign(1), sign(2), sign(4)) * half, half / 2.0, left)
        })
    } else {
        left
    }
}

/// Adds an asteroid that fits into a cube however it is turned. It circles the middle, and drifts inward, so that the
/// field grows dense.
fn asteroid(b: &mut Builder, cube: Vec3, half: f32) {
    let radius = half * b.random(0.6, 0.95);
    let shape = match b.random(0.0, 3.0) as usize {
        0 => ColliderBuilder::ball(radius),
        1 => ColliderBuilder::cuboid(radius * 0.65, radius * 0.5, radius * 0.55),
        _ => ColliderBuilder::capsule_y(radius * 0.4, radius * 0.6),
    };
    let around = Vec3::Y.cross(cube).normalize_or_zero() * 2.0;
    let inward = cube * -0.08;
    let velocity = around + inward + b.random_vec(Vec3::splat(2.0));
    let (turn, spin) = (b.random_turn(), b.random_vec(Vec3::splat(0.7)));
    let body = World::dynamic(cube).rotation(to_rotation(turn)).linvel(to_vector(velocity));
    b.world.add(body.angvel(to_vector(spin)), shape.restitution(0.6));
}
