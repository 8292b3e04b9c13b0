//! Wrecking balls swing into walls of bricks.

use super::builder::{Builder, side_of_square};
use crate::plan::{Body, Collider, Joint, JointKind};
use glam::{Quat, Vec3};

/// Bodies of a wall with its ball.
const BODIES: usize = 250;
/// Half the length, height and depth of a brick.
const BRICK: Vec3 = Vec3::new(0.5, 0.25, 0.3);
const BALL_RADIUS: f32 = 2.0;
/// From the pivot to the ball's centre.
const ROD: f32 = 10.0;
/// Angle by which the ball is pulled back, in radians.
const SWING: f32 = 1.2;

/// Builds walls behind and beside each other, each with its own ball.
pub(super) fn wrecking(b: &mut Builder, n: usize) {
    b.ground();
    let walls = n.div_ceil(BODIES);
    let across = side_of_square(walls);
    for wall in 0..walls {
        let at = Vec3::new((wall % across) as f32 * 32.0, 0.0, (wall / across) as f32 * 26.0);
        let bodies = BODIES.min(n - wall * BODIES);
        let rows = bricks(b, at, bodies - 1);
        ball(b, at, rows as f32 * 2.0 * BRICK.y);
    }
}

/// Adds a wall in running bond, about as long as high in bricks, and returns its number of rows.
fn bricks(b: &mut Builder, at: Vec3, n: usize) -> usize {
    let row_length = side_of_square(n);
    for i in 0..n {
        let (row, column) = (i / row_length, i % row_length);
        let shift = if row % 2 == 0 { 0.0 } else { BRICK.x };
        let x = (column as f32 - row_length as f32 / 2.0) * 2.02 * BRICK.x + shift;
        let place = Vec3::new(x, (row as f32 * 2.0 + 1.0) * BRICK.y, 0.0);
        b.add(Body::dynamic(at + place), Collider::cuboid(BRICK.x, BRICK.y, BRICK.z));
    }
    n.div_ceil(row_length)
}

/// Adds a heavy ball that is about to swing into the middle of a wall of this height.
fn ball(b: &mut Builder, at: Vec3, height: f32) {
    let lowest = (height * 0.4).max(BALL_RADIUS + 0.2);
    let pivot = at + Vec3::Y * (lowest + ROD);
    let hook = b.insert_body(Body::fixed(pivot));
    let turn = Quat::from_rotation_x(SWING + b.random(-0.05, 0.05));
    let place = pivot + turn * (Vec3::NEG_Y * ROD);
    let body = Body::dynamic(place).turned(turn).sleepless();
    let ball = b.add(body, Collider::ball(BALL_RADIUS).density(20.0));
    let rod = Collider::capsule_y(ROD / 2.0, 0.05).at(Vec3::Y * ROD / 2.0);
    b.attach(rod.density(0.0), ball);
    let (kind, anchors) = (JointKind::Socket(None), [Vec3::ZERO, Vec3::Y * ROD]);
    b.plan.joints.push(Joint { kind, bodies: [hook, ball], anchors, has_contacts: true });
}
