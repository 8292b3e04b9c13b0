//! A jar of balls and cubes of mixed sizes.

use super::builder::{Builder, direction, side_of_cube};
use crate::plan::Collider;
use glam::Vec3;
use std::f32::consts::TAU;

/// Radii.
const SMALLEST: f32 = 0.12;
const LARGEST: f32 = 0.6;
/// Planks of the wall.
const PLANKS: usize = 24;

/// Drops layers of one size each into each other.
pub(super) fn jar(b: &mut Builder, n: usize) {
    b.ground();
    // The first metre is room for the largest bodies; the rest keeps a large jar about three times as high as its radius.
    let radius = 1.0 + side_of_cube(n) as f32 * 0.25;
    let (mut left, mut height) = (n, 0.1);
    while left > 0 {
        let half = b.random_size(SMALLEST, LARGEST);
        left -= layer(b, radius, height + half * 1.1, half, left);
        height += half * 2.2;
    }
    wall(b, radius, height / 2.0);
}

/// Places bodies of one size side by side, at most `most` of them, and returns their number.
fn layer(b: &mut Builder, radius: f32, height: f32, half: f32, most: usize) -> usize {
    let distance = half * 2.2;
    let reach = ((radius - half) / distance) as i32;
    let places = (-reach..=reach).flat_map(|x| (-reach..=reach).map(move |z| (x, z)));
    let places = places.map(|(x, z)| Vec3::new(x as f32, 0.0, z as f32) * distance);
    let inside = places.filter(|place| place.length() + half * 1.1 < radius).take(most);
    inside.map(|place| content(b, place + Vec3::Y * height, half)).count()
}

/// Adds a ball or a cube.
fn content(b: &mut Builder, at: Vec3, half: f32) {
    // A cube that turns freely within the ball of the same size.
    let edge = half * 0.57;
    let shape =
        if b.random(0.0, 1.0) < 0.6 { Collider::ball(half) } else { Collider::cuboid(edge, edge, edge) };
    b.falling(at, shape);
}

/// Adds the planks of the jar.
fn wall(b: &mut Builder, radius: f32, half_height: f32) {
    // Inside, the planks touch a circle of the jar's radius; they overlap at their edges.
    let thick = 0.3;
    let half = Vec3::new(thick, half_height, (radius + 2.0 * thick) * TAU / 2.0 / PLANKS as f32 * 1.05);
    for i in 0..PLANKS {
        let angle = TAU * i as f32 / PLANKS as f32;
        let at = direction(angle) * (radius + thick) + Vec3::Y * half_height;
        b.fixed_cuboid(at, half, -angle);
    }
}
