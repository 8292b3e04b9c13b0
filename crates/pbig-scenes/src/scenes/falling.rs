//! Columns of bodies that fall, and bodies of many sizes.

use super::builder::{Builder, direction, heights, lattice, side_of_cube, side_of_square, wave};
use crate::plan::{Body, Collider, Shape};
use glam::Vec3;

pub(super) fn sphere(i: usize) -> Collider {
    Collider::ball(0.3 + 0.05 * (i % 5) as f32)
}

pub(super) fn cube(i: usize) -> Collider {
    let half = 0.3 + 0.04 * (i % 5) as f32;
    Collider::cuboid(half, half, half)
}

pub(super) fn slab(i: usize) -> Collider {
    let half = 0.4 + 0.05 * (i % 4) as f32;
    Collider::cuboid(half, 0.1, half)
}

/// Drops a square column, at most 24 wide so that it is tall, above the ground.
pub(super) fn fall(b: &mut Builder, n: usize, shape: fn(usize) -> Collider) {
    b.ground();
    let side = side_of_cube(n.div_ceil(4)).min(24);
    for i in 0..n {
        let place = lattice(i, side);
        let at = place * 1.3 + b.random_vec(Vec3::splat(0.1)) + Vec3::Y * 1.5;
        b.falling(at, shape(i));
    }
}

/// Drops columns of one shape each, side by side, as in Avril's figure 1.
pub(super) fn columns(b: &mut Builder, n: usize) {
    b.ground();
    let columns = (n / 1500).clamp(3, 25);
    let across = side_of_square(columns);
    let each = n.div_ceil(columns);
    let side = side_of_cube(each.div_ceil(6));
    let distance = side as f32 * 1.3 + 6.0;
    for i in 0..n {
        let (number, place) = (i / each, lattice(i % each, side) * 1.3);
        let corner = Vec3::new((number % across) as f32, 0.0, (number / across) as f32) * distance;
        let at = corner + place + b.random_vec(Vec3::splat(0.1)) + Vec3::Y * 1.5;
        b.falling(at, [sphere, cube, slab][number % 3](i));
    }
}

pub(super) fn column(b: &mut Builder, n: usize) {
    fall(b, n, |i| [sphere, cube, slab][i % 3](i));
}

/// Drops bodies of log-uniform sizes. Each is on its own level above the larger ones, so that none begins inside another.
pub(super) fn mixed(b: &mut Builder, n: usize) {
    b.ground();
    let mut sizes: Vec<f32> = (0..n).map(|_| b.random_size(0.025, 25.0)).collect();
    sizes.sort_by(|x, y| y.total_cmp(x));
    let width = (n as f32).sqrt() * 2.0 + 50.0;
    let mut height = 0.0;
    for (i, half) in sizes.into_iter().enumerate() {
        height += 2.0 * half / (width / (2.2 * half)).max(1.0).powi(2) + 1e-3;
        let free = (width - half).max(0.0);
        let at = b.random_vec(Vec3::new(free, 0.0, free)) + Vec3::Y * (height + half);
        let shape = if i % 2 == 0 { Collider::ball(half) } else { Collider::cuboid(half, half, half) };
        b.falling(at, shape);
    }
}

/// Drops balls on hills in a plain.
pub(super) fn rain(b: &mut Builder, n: usize) {
    b.ground();
    let wide = (n.max(1) as f32).sqrt() * 3.0;
    let hills = heights(24, |i, j| 2.2 + wave(i as f32 * 0.7) + direction(j as f32 * 0.9).x);
    let scale = Vec3::new(wide, 1.0, wide);
    b.insert(Collider::new(Shape::Heights(24, hills, scale)));
    for _ in 0..n {
        let at = b.random_vec(Vec3::new(wide * 0.49, 0.0, wide * 0.49)) + Vec3::Y * b.random(5.0, 62.0);
        let down = b.random(-40.0, -10.0);
        // Rapier's continuous collision detection knows no height fields, so drops look a metre ahead for contacts.
        let body = Body { has_ccd: true, soft_ccd: 1.0, ..Body::dynamic(at).linvel(Vec3::Y * down) };
        b.add(body, Collider::ball(0.08).restitution(0.3));
    }
}

pub(super) fn compounds(b: &mut Builder, n: usize) {
    b.ground();
    let side = side_of_cube(n.div_ceil(4));
    for i in 0..n {
        let place = lattice(i, side);
        let at = place * 2.6 + b.random_vec(Vec3::splat(0.1)) + Vec3::Y * 2.0;
        if i % 3 == 0 {
            let cube = || Shape::Cuboid(Vec3::splat(0.3));
            let shapes = vec![(Vec3::new(-0.4, 0.0, 0.0), cube()), (Vec3::new(0.4, 0.2, 0.0), cube())];
            b.falling(at, Collider::new(Shape::Compound(shapes)));
        } else {
            let body = b.falling(at, Collider::ball(0.35));
            for x in [-0.6, 0.6] {
                let arm = Collider::cuboid(0.4, 0.15, 0.15).at(Vec3::X * x);
                b.attach(arm, body);
            }
        }
    }
}
