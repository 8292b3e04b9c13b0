//! Galton boards: balls fall through rows of pegs into bins.

use super::builder::{Builder, side_of_square};
use crate::plan::{Body, Collider, Shape};
use glam::Vec3;

/// Balls of a board.
const BALLS: usize = 50;
const BALL_RADIUS: f32 = 0.15;
const PEG_RADIUS: f32 = 0.12;
/// Distance from peg to peg in a row; the width of a bin.
const PITCH: f32 = 0.7;
/// Distance from row to row.
const DROP: f32 = 0.6;
/// Heavy balls in oil: undamped ones jump off a peg so fast that they go on in one direction, and fill the outer bins.
const GRAVITY_SCALE: f32 = 4.0;
const DAMPING: f32 = 10.0;
const ROWS: usize = 7;
/// Pegs in a row, and bins.
const BINS: usize = 11;
const BIN_HEIGHT: f32 = 3.0;
/// From ball to ball, before they fall.
const BALL_DISTANCE: f32 = 0.35;
/// From one board to the board behind it.
const DEPTH: f32 = 1.2;

/// Builds boards behind and beside each other. Balls stay in the plane of their board, so a board needs no panes.
pub(super) fn galton(b: &mut Builder, n: usize) {
    b.ground();
    let boards = n.div_ceil(BALLS);
    let columns = side_of_square(boards.div_ceil(8));
    for board in 0..boards {
        let column = (board % columns) as f32 * (BINS as f32 + 2.0) * PITCH;
        let at = Vec3::new(column, 0.0, (board / columns) as f32 * DEPTH);
        fixed_parts(b, at);
        balls(b, at, BALLS.min(n - board * BALLS));
    }
}

/// Returns the height of the lowest ball.
fn top() -> f32 {
    BIN_HEIGHT + (ROWS as f32 + 2.0) * DROP
}

/// Adds the pegs, the walls of the bins, and the sides of a board.
fn fixed_parts(b: &mut Builder, at: Vec3) {
    for row in 0..ROWS {
        let shift = if row % 2 == 0 { 0.0 } else { PITCH / 2.0 };
        for peg in 0..BINS {
            let place = Vec3::new(across(peg) + shift, BIN_HEIGHT + (row as f32 + 1.0) * DROP, 0.0);
            b.fixed(at + place, Collider::new(Shape::Capsule(Vec3::Z * 0.2, PEG_RADIUS)));
        }
    }
    for wall in 0..=BINS {
        let place = Vec3::new(across(wall) - PITCH / 2.0, BIN_HEIGHT / 2.0, 0.0);
        b.fixed(at + place, Collider::cuboid(0.04, BIN_HEIGHT / 2.0, 0.3));
    }
    for side in [-1.0, 1.0] {
        let place = Vec3::new(side * (BINS as f32 / 2.0 + 0.1) * PITCH, top() / 2.0, 0.0);
        b.fixed(at + place, Collider::cuboid(0.1, top() / 2.0, 0.3));
    }
}

/// Adds balls one above the other, over the middle peg.
fn balls(b: &mut Builder, at: Vec3, n: usize) {
    for i in 0..n {
        let place = Vec3::new(b.random(-0.1, 0.1), top() + i as f32 * BALL_DISTANCE, 0.0);
        let (gravity_scale, damping) = (GRAVITY_SCALE, DAMPING);
        let ball = Body { keeps_z: true, gravity_scale, damping, ..Body::dynamic(at + place) };
        b.add(ball, Collider::ball(BALL_RADIUS).friction(0.1));
    }
}

/// Returns the coordinate along a board of the peg or bin with this number.
fn across(number: usize) -> f32 {
    (number as f32 - (BINS as f32 - 1.0) / 2.0) * PITCH
}
