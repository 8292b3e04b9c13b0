//! An avalanche: boulders roll down a valley.

use super::builder::{Builder, direction, heights, lattice, side_of_square, wave};
use crate::plan::{Collider, Shape};
use glam::Vec3;

/// Height over length of the slope.
const SLOPE: f32 = 0.7;
/// Boulders above each other.
const LAYERS: usize = 3;

/// Lays boulders above the upper part of a valley, which runs out into a plain.
pub(super) fn avalanche(b: &mut Builder, n: usize) {
    b.ground();
    let side = side_of_square(n.div_ceil(LAYERS));
    let length = (side as f32 * 4.0 + 40.0).max(60.0);
    // One sample a metre, or the field would cut off the waves, and bury boulders.
    let samples = length as usize + 1;
    let field = heights(samples, |i, j| {
        let part = |k: usize| k as f32 / (samples - 1) as f32 - 0.5;
        surface(part(j) * length, part(i) * length, length)
    });
    let scale = Vec3::new(length, 1.0, length);
    b.insert(Collider::new(Shape::Heights(samples, field, scale)).friction(0.4));
    for i in 0..n {
        let place = (lattice(i, side) - Vec3::new(side as f32 / 2.0, 0.0, 0.0)) * 1.6;
        let [x, z] = [place.x, place.z - length * 0.45];
        let y = surface(x, z, length) + 1.5 + place.y * 1.4;
        boulder(b, i, Vec3::new(x, y, z));
    }
}

/// Returns the height of the valley: it falls along z, rises to both sides, and is rough.
fn surface(x: f32, z: f32, length: f32) -> f32 {
    let slope = (length * 0.2 - z).max(0.0) * SLOPE;
    let aside = (2.0 * x / length) * (2.0 * x / length);
    let sides = aside * aside * length * 0.15;
    1.0 + slope + sides + 0.4 * (wave(x * 0.35) + direction(z * 0.5).x)
}

/// Adds a ball, a cuboid or a round cuboid.
fn boulder(b: &mut Builder, i: usize, at: Vec3) {
    let half = b.random_size(0.15, 0.55);
    let shape = match i % 3 {
        0 => Collider::ball(half),
        1 => Collider::cuboid(half, half * 0.8, half * 0.7),
        _ => Collider::new(Shape::Cuboid(half * Vec3::new(0.6, 0.7, 0.5), Some(half * 0.3))),
    };
    b.falling(at, shape.friction(0.4).restitution(0.2));
}
