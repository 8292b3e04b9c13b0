//! A world under construction.

use crate::plan::{Body, Collider, Plan, Shape};
use glam::{EulerRot, Quat, Vec2, Vec3};
use rand::RngExt;
use rand::rngs::StdRng;

/// A world under construction, with its random numbers.
pub(super) struct Builder {
    pub(super) plan: Plan,
    pub(super) rng: StdRng,
}

impl Builder {
    /// Returns a number from `low` up to `high`, which must be larger.
    pub(super) fn random(&mut self, low: f32, high: f32) -> f32 {
        self.rng.random_range(low..high)
    }

    /// Returns a vector with components from `-reach` up to `reach`.
    pub(super) fn random_vec(&mut self, reach: Vec3) -> Vec3 {
        let mut along = |r: f32| if r > 0.0 { self.random(-r, r) } else { 0.0 };
        Vec3::new(along(reach.x), along(reach.y), along(reach.z))
    }

    /// Returns a rotation.
    pub(super) fn random_turn(&mut self) -> Quat {
        let angles = self.random_vec(Vec3::splat(std::f32::consts::PI));
        Quat::from_euler(EulerRot::XYZ, angles.x, angles.y, angles.z)
    }

    /// Returns a size whose logarithm is uniform from `low` up to `high`.
    pub(super) fn random_size(&mut self, low: f32, high: f32) -> f32 {
        low * power(high / low, self.random(0.0, 1.0))
    }

    /// Adds a body, and returns its number.
    pub(super) fn insert_body(&mut self, body: Body) -> usize {
        self.plan.bodies.push(body);
        self.plan.bodies.len() - 1
    }

    /// Adds a collider.
    pub(super) fn insert(&mut self, collider: Collider) {
        self.plan.colliders.push(collider);
    }

    /// Adds a collider to a body.
    pub(super) fn attach(&mut self, collider: Collider, body: usize) {
        self.insert(Collider { body: Some(body), ..collider });
    }

    /// Adds a body with one collider, and returns the body's number.
    pub(super) fn add(&mut self, body: Body, collider: Collider) -> usize {
        let body = self.insert_body(body);
        self.attach(collider, body);
        body
    }

    /// Adds a half-space below height 0.
    pub(super) fn ground(&mut self) {
        self.insert(Collider::new(Shape::HalfSpace));
    }

    /// Adds a dynamic body with a random rotation.
    pub(super) fn falling(&mut self, at: Vec3, collider: Collider) -> usize {
        let body = Body::dynamic(at).turned(self.random_turn());
        self.add(body, collider)
    }

    /// Adds a collider without a body.
    pub(super) fn fixed(&mut self, at: Vec3, collider: Collider) {
        self.insert(collider.at(at));
    }

    /// Adds a collider without a body, turned around the vertical axis by an angle in radians.
    pub(super) fn fixed_turned(&mut self, at: Vec3, angle: f32, collider: Collider) {
        self.insert(Collider { turn: Quat::from_rotation_y(angle), ..collider.at(at) });
    }

    /// Adds a box without a body, turned around the vertical axis by an angle in radians.
    pub(super) fn fixed_cuboid(&mut self, at: Vec3, half: Vec3, angle: f32) {
        self.fixed_turned(at, angle, Collider::cuboid(half.x, half.y, half.z));
    }
}

/// Returns the `i`-th place of a square column, layer by layer from the ground.
pub(super) fn lattice(i: usize, side: usize) -> Vec3 {
    Vec3::new((i % side) as f32, (i / side / side) as f32, (i / side % side) as f32)
}

/// Returns the number of places along an edge of the smallest cube with `places` places, at least 1.
pub(super) fn side_of_cube(places: usize) -> usize {
    (1..).find(|side: &usize| side.pow(3) >= places).unwrap_or(1)
}

/// Returns the number of places along an edge of the smallest square with `places` places, at least 1.
pub(super) fn side_of_square(places: usize) -> usize {
    (1..).find(|side: &usize| side.pow(2) >= places).unwrap_or(1)
}

/// Returns the heights of a square grid, as [`Shape::Heights`] holds them.
pub(super) fn heights(side: usize, height: impl Fn(usize, usize) -> f32) -> Vec<f32> {
    (0..side * side).map(|at| height(at % side, at / side)).collect()
}

// glam computes these with `libm`, so they have the same bits on every machine. The standard library asks the platform, and
// a web page would build other worlds. Steps have the same bits only with rapier's `enhanced-determinism`.

/// Returns the cosine and the sine of an angle in radians, as x and z.
pub(super) fn direction(angle: f32) -> Vec3 {
    let Vec2 { x, y } = Vec2::from_angle(angle);
    Vec3::new(x, 0.0, y)
}

/// Returns the sine of an angle in radians.
pub(super) fn wave(angle: f32) -> f32 {
    direction(angle).z
}

/// Returns `base` to the power of `exponent`.
pub(super) fn power(base: f32, exponent: f32) -> f32 {
    Vec2::splat(base).powf(exponent).x
}
