//! Bodies at rest, or soon at rest.

use super::builder::{Builder, lattice, side_of_cube, side_of_square};
use crate::plan::{Body, Collider};
use glam::Vec3;

pub(super) fn pile(b: &mut Builder, n: usize) {
    b.ground();
    let side = side_of_cube(n);
    for i in 0..n {
        let place = lattice(i, side);
        let at = place * 1.02 + b.random_vec(Vec3::new(0.01, 0.0, 0.01)) + Vec3::Y * 0.51;
        b.add(Body::dynamic(at), Collider::cuboid(0.5, 0.5, 0.5));
    }
}

pub(super) fn pyramid(b: &mut Builder, n: usize) {
    b.ground();
    let mut left = n;
    let levels = (1..).find(|&k: &usize| k * (k + 1) * (2 * k + 1) / 6 >= n).unwrap_or(1);
    for level in 0..levels {
        let side = levels - level;
        for i in 0..(side * side).min(left) {
            let corner = Vec3::new(level as f32 * 0.5, level as f32 + 0.5, level as f32 * 0.5);
            let at = corner + Vec3::new((i % side) as f32, 0.0, (i / side) as f32);
            b.add(Body::dynamic(at), Collider::cuboid(0.495, 0.495, 0.495));
        }
        left = left.saturating_sub(side * side);
    }
}

pub(super) fn sleeping(b: &mut Builder, n: usize) {
    b.ground();
    let side = side_of_square(n);
    for i in 0..n.saturating_sub(1) {
        let at = Vec3::new((i % side) as f32 * 1.1, 0.5, (i / side) as f32 * 1.1);
        b.add(Body { is_sleeping: true, ..Body::dynamic(at) }, Collider::cuboid(0.5, 0.5, 0.5));
    }
    if n == 0 {
        return;
    }
    let middle = side as f32 * 0.55;
    let awake = Body::dynamic(Vec3::new(middle, 8.0, middle)).linvel(Vec3::new(3.0, 0.0, 0.5));
    b.add(awake.sleepless(), Collider::ball(0.4));
}

pub(super) fn city(b: &mut Builder, n: usize) {
    b.ground();
    let side = side_of_square(n);
    for i in 0..n {
        let at = Vec3::new((i % side) as f32, 0.0, (i / side) as f32) * 4.0;
        if i % 50 == 0 {
            let up = b.random(10.0, 20.0);
            let body =
                Body::dynamic(at + Vec3::Y * up + Vec3::X * 2.0).linvel(b.random_vec(Vec3::splat(5.0)));
            b.add(body, Collider::ball(0.4));
        } else {
            let half_height = b.random(0.5, 6.0);
            b.fixed(at + Vec3::Y * half_height, Collider::cuboid(1.5, half_height, 1.5));
        }
    }
}
