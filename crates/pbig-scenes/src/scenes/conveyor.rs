//! Ring conveyors: rollers carry crates around, through gates, which are sensors.

use super::builder::{Builder, direction, side_of_square};
use crate::plan::{Body, Collider};
use glam::{Quat, Vec3};
use std::f32::consts::TAU;

/// Bodies of one ring.
const ROLLERS: usize = 80;
const CRATES: usize = 40;
/// Gates are fixed and count as bodies.
const GATES: usize = 20;
/// From the middle of a ring to the middle of its rollers.
const RING_RADIUS: f32 = 3.8;
/// From the middle of the rollers to the rails.
const HALF_WIDTH: f32 = 0.75;
/// Planks of a rail, which do not count as bodies.
const PLANKS: usize = 24;
const ROLLER_RADIUS: f32 = 0.14;
/// Height of the rollers' axes.
const HEIGHT: f32 = 1.2;
/// Metres a second on top of a roller.
const SPEED: f32 = 1.2;

/// Builds rings beside and behind each other. The last one may be an arc, from whose end crates fall.
pub(super) fn conveyor(b: &mut Builder, n: usize) {
    b.ground();
    let bodies = ROLLERS + CRATES + GATES;
    let rings = n.div_ceil(bodies);
    let rows = side_of_square(rings);
    for i in 0..rings {
        let at = Vec3::new((i % rows) as f32 * 10.0, HEIGHT, (i / rows) as f32 * 10.0);
        let left = bodies.min(n - i * bodies);
        let [rollers, crates] = [ROLLERS, CRATES].map(|of| (left * of).div_ceil(bodies));
        add_rollers(b, at, rollers);
        add_crates(b, at, crates.min(left - rollers));
        add_gates(b, at, left.saturating_sub(rollers + crates));
        add_rails(b, at);
    }
}

/// Adds rollers whose tops move towards larger angles.
fn add_rollers(b: &mut Builder, at: Vec3, n: usize) {
    for i in 0..n {
        let angle = TAU * (i as f32 + 0.5) / ROLLERS as f32;
        let outward = direction(angle);
        let roller = Body::kinematic(at + outward * RING_RADIUS)
            .turned(Quat::from_rotation_y(-angle))
            .angvel(outward * (SPEED / ROLLER_RADIUS));
        b.add(roller, Collider::capsule_x(0.7, ROLLER_RADIUS).friction(1.0));
    }
}

/// Adds crates on the rollers, two above each other.
fn add_crates(b: &mut Builder, at: Vec3, n: usize) {
    for i in 0..n {
        let half = Vec3::new(b.random(0.2, 0.4), b.random(0.15, 0.3), b.random(0.3, 0.4));
        let angle = TAU * ((i / 2) as f32 + 0.5) / (CRATES / 2) as f32;
        let up = ROLLER_RADIUS + 0.02 + half.y + (i % 2) as f32 * 0.62;
        let outward = direction(angle) * (RING_RADIUS + b.random(-0.1, 0.1));
        let body =
            Body::dynamic(at + outward + Vec3::Y * up).turned(Quat::from_rotation_y(-angle)).sleepless();
        let shape = Collider::cuboid(half.x, half.y, half.z).friction(0.8);
        b.add(body, shape);
    }
}

/// Adds gates across the rollers.
fn add_gates(b: &mut Builder, at: Vec3, n: usize) {
    for i in 0..n {
        let angle = TAU * i as f32 / GATES as f32;
        let place = direction(angle) * RING_RADIUS + Vec3::Y * 0.8;
        b.fixed_turned(at + place, -angle, Collider::cuboid(0.9, 0.8, 0.05).sensor());
    }
}

/// Adds a rail inside and one outside, along which crates slide.
fn add_rails(b: &mut Builder, at: Vec3) {
    let thick = 0.05;
    for radius in [RING_RADIUS - HALF_WIDTH - thick, RING_RADIUS + HALF_WIDTH + thick] {
        for i in 0..PLANKS {
            let angle = TAU * i as f32 / PLANKS as f32;
            let length = radius * TAU / PLANKS as f32;
            let plank = Collider::cuboid(thick, 0.3, length / 2.0).friction(0.0);
            b.fixed_turned(at + direction(angle) * radius + Vec3::Y * 0.45, -angle, plank);
        }
    }
}
