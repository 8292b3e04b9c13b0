//! A town of rings: houses, cars that drive around for ever, and barrels in their way.

use super::builder::{Builder, direction};
use crate::plan::{Body, Collider, Shape};
use glam::{Quat, Vec3};
use std::f32::consts::TAU;

/// The radius of the first street, and the distance from street to street.
const FIRST_STREET: f32 = 20.0;
const STREET_DISTANCE: f32 = 18.0;
/// From the middle of a street to the middle of a lane.
const LANE: f32 = 2.2;
/// Along a street, the space for a house, and for a car in its lane with the barrels before it.
const HOUSE_EVERY: f32 = 8.0;
const CAR_EVERY: f32 = 16.0;

/// Things that stand or drive along a street.
#[derive(Clone, Copy)]
enum Kind {
    House,
    /// A car in a lane; 1 drives counterclockwise, -1 clockwise.
    Car(f32),
    /// A barrel in the outer half of a street (1) or the inner half (-1).
    Barrel(f32),
}

/// Builds streets until all bodies are used; a house counts as a body.
pub(super) fn traffic(b: &mut Builder, n: usize) {
    b.ground();
    let mut left = n;
    let mut radius = FIRST_STREET;
    while left > 0 {
        for kind in [Kind::Car(1.0), Kind::Car(-1.0), Kind::Barrel(1.0), Kind::Barrel(-1.0), Kind::House] {
            left -= around(b, radius, kind, left);
        }
        radius += STREET_DISTANCE;
    }
}

/// Places things around a street, at most `most` of them, and returns their number.
fn around(b: &mut Builder, radius: f32, kind: Kind, most: usize) -> usize {
    // Shares of the way from one car to the next. A lorry and its random shift take 0.4 before and behind, so no barrel
    // begins inside it.
    let (every, from, to) = match kind {
        Kind::House => (HOUSE_EVERY, -0.15, 0.15),
        Kind::Car(_) => (CAR_EVERY, -0.15, 0.15),
        Kind::Barrel(_) => (CAR_EVERY, 0.44, 0.56),
    };
    let places = (TAU * radius / every) as usize;
    for i in 0..places.min(most) {
        let angle = TAU * (i as f32 + b.random(from, to)) / places as f32;
        match kind {
            Kind::House => house(b, radius + STREET_DISTANCE / 2.0, angle),
            Kind::Car(way) => car(b, radius, angle, way),
            Kind::Barrel(half) => barrel(b, radius, angle, half),
        }
    }
    places.min(most)
}

fn house(b: &mut Builder, radius: f32, angle: f32) {
    let half = Vec3::new(b.random(2.0, 2.8), b.random(2.0, 9.0), b.random(2.0, 3.0));
    b.fixed_cuboid(direction(angle) * radius + Vec3::Y * half.y, half, -angle);
}

/// Adds a car, every eighth time a lorry. Its body turns around the middle of the town, so that no one has to steer it: all
/// mass is there, and none in the collider.
fn car(b: &mut Builder, radius: f32, angle: f32, way: f32) {
    let half = if b.random(0.0, 8.0) < 1.0 { Vec3::new(1.2, 1.5, 3.5) } else { Vec3::new(0.9, 0.7, 2.0) };
    let lane = radius + LANE * way;
    // All cars of a lane are equally fast, so none runs into another. A positive turn around y drives from z to x.
    let speed = 8.0 + 4.0 * way;
    let place = Vec3::new(lane, half.y + 0.05, 0.0);
    let spin = Vec3::Y * -way * speed / lane;
    // A slow turn counts as rest, however long the way.
    let body = Body::kinematic(Vec3::ZERO).turned(Quat::from_rotation_y(-angle)).angvel(spin).sleepless();
    let shape = Collider::cuboid(half.x, half.y, half.z).density(0.0);
    b.add(Body { has_own_mass: true, ..body }, shape.at(place));
}

/// Adds a barrel in the way of the cars or beside it.
fn barrel(b: &mut Builder, radius: f32, angle: f32, half: f32) {
    let side = half * b.random(0.5, 4.0);
    let at = direction(angle) * (radius + side) + Vec3::Y * 0.5;
    b.add(Body::dynamic(at), Collider::new(Shape::Cylinder(0.45, 0.3)));
}
