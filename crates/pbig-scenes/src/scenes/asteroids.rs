//! An asteroid field: no gravity, bodies of very different sizes, all in motion.

use super::builder::{Builder, side_of_square};
use crate::plan::{Body, Collider, Joint, JointKind};
use glam::Vec3;

/// Half the edge of the cubes that the field is divided into, and of their smallest parts.
const LARGEST: f32 = 8.0;
const SMALLEST: f32 = 0.25;
/// Shares of cubes with one asteroid, and of cubes that are divided into eight. The others are empty.
const FILLED: f32 = 0.45;
const DIVIDED: f32 = 0.35;
/// Mean number of asteroids in one of the largest cubes, about.
const MEAN: usize = 120;
/// Acceleration toward the middle for each metre of distance, 1/s^2.
const PULL: f32 = 0.2;
/// Angular velocity around the middle at first, radians a second. Half of what a circle would need, so the field contracts
/// to half its width, and swings out again.
const CIRCLING: f32 = 0.22;

/// Fills a flat field of cubes. A cube holds one asteroid, or is divided, or is empty, so that none begins inside another.
pub(super) fn asteroids(b: &mut Builder, n: usize) {
    b.plan.gravity = Vec3::ZERO;
    let middle = b.insert_body(Body::fixed(Vec3::ZERO));
    let mut left = n;
    for layer in 0.. {
        for (x, z) in from_the_middle(n) {
            let cube = Vec3::new(x as f32, layer as f32, z as f32) * 2.0 * LARGEST;
            left = fill(b, middle, cube, LARGEST, left);
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
fn fill(b: &mut Builder, middle: usize, cube: Vec3, half: f32, left: usize) -> usize {
    if left == 0 {
        return 0;
    }
    let draw = b.random(0.0, 1.0);
    if draw < FILLED {
        let body = asteroid(b, cube, half);
        // It does not depend on the mass. Without it the first collisions would scatter the field for good.
        let (kind, anchors) = (JointKind::Pull(PULL), [Vec3::ZERO; 2]);
        b.plan.joints.push(Joint { kind, bodies: [middle, body], anchors, has_contacts: true });
        left - 1
    } else if draw < FILLED + DIVIDED && half > SMALLEST {
        (0..8).fold(left, |left, part| {
            let sign = |bit: usize| if part & bit == 0 { -0.5 } else { 0.5 };
            fill(b, middle, cube + Vec3::new(sign(1), sign(2), sign(4)) * half, half / 2.0, left)
        })
    } else {
        left
    }
}

/// Adds an asteroid that fits into a cube however it is turned. It circles the middle.
fn asteroid(b: &mut Builder, cube: Vec3, half: f32) -> usize {
    let radius = half * b.random(0.6, 0.95);
    let shape = match b.random(0.0, 3.0) as usize {
        0 => Collider::ball(radius),
        1 => Collider::cuboid(radius * 0.65, radius * 0.5, radius * 0.55),
        _ => Collider::capsule_y(radius * 0.4, radius * 0.6),
    };
    let around = Vec3::Y.cross(cube) * CIRCLING;
    let velocity = around + b.random_vec(Vec3::splat(2.0));
    let (turn, spin) = (b.random_turn(), b.random_vec(Vec3::splat(0.7)));
    let body = Body::dynamic(cube).turned(turn).linvel(velocity);
    b.add(body.angvel(spin), shape.restitution(0.6))
}
