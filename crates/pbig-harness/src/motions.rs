//! Boxes in motion, frame by frame: nine kinds of motion at three densities.
//!
//! Equal motions, densities, numbers and seeds give equal boxes in every frame.

mod space;
#[cfg(test)]
mod tests;

use pbig_core::Aabb;
use rand::rngs::StdRng;
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use space::side;

/// Maximum distance that a box drifts or jitters in a frame along each axis. Unit cubes have edge 1.
const STEP: f32 = 0.1;

/// Maximum distance of a swing along each axis, in edges of the box.
const SWING: f32 = 0.1;

/// Acceleration of a fall, in lengths per squared frame: 9.81 m/s^2 at 60 frames a second.
const GRAVITY: f32 = 9.81 / 3600.0;

/// Frames of a burst, and of the rest before it.
const BURST: usize = 10;

/// A kind of motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// Every box has a constant velocity and turns at the border of the space.
    Drift,
    /// Every box takes a random step in every frame.
    Jitter,
    /// Every box goes away by up to a tenth of its edge, and comes back in the next frame.
    Swing,
    /// Every box falls under gravity. The starts differ; a box at the bottom starts again at the top.
    Fall,
    /// 5% of the boxes jump anywhere in every frame.
    Jump,
    /// All boxes rest for 10 frames and drift for 10 frames, in turn.
    Burst,
    /// 0%, 2% and 50% of the boxes take a random step, in turn.
    Shares,
    /// 1% of the boxes take a random step in every frame.
    Few,
    /// 1% of the boxes are removed in every frame, and as many absent boxes are inserted anywhere.
    Churn,
}

impl Motion {
    pub const ALL: [Self; 9] = {
        use Motion::*;
        [Drift, Jitter, Swing, Fall, Jump, Burst, Shares, Few, Churn]
    };

    /// Returns the name in tables and files.
    pub fn name(self) -> &'static str {
        const NAMES: [&str; 9] =
            ["drift", "jitter", "swing", "fall", "jump", "rest and burst", "changing shares", "few", "churn"];
        NAMES[self as usize]
    }

    /// Returns the share of boxes that move, or are removed, in a frame. Frames count from 1.
    pub fn share(self, frame: usize) -> f64 {
        match self {
            Self::Drift | Self::Jitter | Self::Swing | Self::Fall => 1.0,
            Self::Jump => 0.05,
            Self::Burst => [0.0, 1.0][(frame.saturating_sub(1) / BURST) % 2],
            Self::Shares => [0.0, 0.02, 0.5][frame.saturating_sub(1) % 3],
            Self::Few | Self::Churn => 0.01,
        }
    }

    /// Returns the number of absent boxes among `n`.
    fn absent(self, n: usize) -> usize {
        if self == Self::Churn { (n / 10).max(1).min(n.saturating_sub(1)) } else { 0 }
    }
}

/// Sizes of boxes, and pairs a box.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Density {
    /// Unit cubes, about 3.7 pairs a box.
    Dense,
    /// Unit cubes, about one pair a box.
    Sparse,
    /// Cubes with edges log-uniform from 0.1 to 10, about 11 pairs a box.
    Mixed,
}

impl Density {
    pub const ALL: [Self; 3] = [Self::Dense, Self::Sparse, Self::Mixed];

    /// Returns the name in tables and files.
    pub fn name(self) -> &'static str {
        ["dense", "sparse", "mixed"][self as usize]
    }

    /// Returns the expected number of pairs, divided by the number of boxes.
    pub fn pairs_per_box(self) -> f64 {
        [3.7, 1.0, 11.0][self as usize]
    }

    /// Returns the edge of a box at a place from 0 to 1 among the sizes.
    fn edge(self, place: f64) -> f64 {
        if self == Self::Mixed { 0.1 * 100f64.powf(place) } else { 1.0 }
    }
}

#[derive(Debug)]
pub struct MovingBoxes {
    motion: Motion,
    /// Edge of the cube that holds the centers, in the boxes' length unit.
    side: f32,
    frame: usize,
    rng: StdRng,
    /// All ids, shuffled: each frame takes the next ones.
    order: Vec<u32>,
    next: usize,
    centers: Vec<[f32; 3]>,
    edges: Vec<f32>,
    /// The state, besides its center, on which the next center of a box depends: its velocity, its home, or the elapsed part of
    /// its fall, from 0 to 1.
    states: Vec<[f32; 3]>,
    boxes: Vec<Aabb>,
    changed: Vec<u32>,
}

impl MovingBoxes {
    /// Makes `n` boxes. With [`Motion::Churn`] a tenth of them is absent.
    pub fn new(motion: Motion, density: Density, n: usize, seed: u64) -> Self {
        let mut rng = StdRng::seed_from_u64(seed);
        let present = n - motion.absent(n);
        let side = side(density, motion == Motion::Fall, present) as f32;
        let centers: Vec<[f32; 3]> = (0..n).map(|_| anywhere(&mut rng, side)).collect();
        let edges = (0..n).map(|_| density.edge(rng.random_range(0.0..1.0)) as f32).collect();
        let mut order: Vec<u32> = (0..n as u32).collect();
        order.shuffle(&mut rng);
        let mut state = |home: &[f32; 3]| match motion {
            Motion::Drift | Motion::Burst => [0; 3].map(|_| rng.random_range(-STEP..=STEP)),
            Motion::Fall => [rng.random_range(0.0..1.0), 0.0, 0.0],
            _ => *home,
        };
        let states = centers.iter().map(&mut state).collect();
        let (boxes, changed) = (vec![Aabb::NOWHERE; n], Vec::with_capacity(n));
        let mut scene =
            Self { motion, side, frame: 0, rng, order, next: 0, centers, edges, states, boxes, changed };
        scene.place_all();
        scene
    }

    /// Returns all boxes by id; an absent one is [`Aabb::NOWHERE`].
    pub fn boxes(&self) -> &[Aabb] {
        &self.boxes
    }

    /// Makes the next frame; returns the ids of changed boxes in ascending order.
    pub fn step(&mut self) -> &[u32] {
        self.frame += 1;
        let n = self.boxes.len();
        let mut count = (self.motion.share(self.frame) * n as f64).round() as usize;
        if self.motion == Motion::Churn {
            count = count.max(1).min(self.motion.absent(n));
        }
        self.changed.clear();
        self.changed.extend((0..count).map(|k| self.order[(self.next + k) % n]));
        self.changed.sort_unstable();
        for k in 0..count {
            self.move_one(self.changed[k] as usize);
        }
        if self.motion == Motion::Churn {
            self.remove(count);
        }
        self.next = (self.next + count) % n.max(1);
        &self.changed
    }

    fn place_all(&mut self) {
        if self.motion == Motion::Fall {
            let heights = self.states.iter().map(|state| height(state[0], self.side));
            self.centers.iter_mut().zip(heights).for_each(|(center, y)| center[1] = y);
        }
        (0..self.boxes.len()).for_each(|i| self.place(i));
        for k in 0..self.motion.absent(self.boxes.len()) {
            self.boxes[self.order[k] as usize] = Aabb::NOWHERE;
        }
    }

    fn place(&mut self, i: usize) {
        self.boxes[i] = Aabb::from_center(self.centers[i], [0.5 * self.edges[i]; 3]);
    }

    fn move_one(&mut self, i: usize) {
        let (rng, side, center) = (&mut self.rng, self.side, &mut self.centers[i]);
        let state = &mut self.states[i];
        match self.motion {
            Motion::Drift | Motion::Burst => {
                center.iter_mut().zip(state).for_each(|(x, v)| advance(x, v, side));
            }
            Motion::Jitter | Motion::Shares | Motion::Few => {
                center.iter_mut().for_each(|x| advance(x, &mut rng.random_range(-STEP..=STEP), side));
            }
            Motion::Swing => {
                let far = if self.frame.is_multiple_of(2) { 0.0 } else { SWING * self.edges[i] };
                *center = state.map(|x| x + rng.random_range(-far..=far));
            }
            Motion::Fall => fall(center, &mut state[0], side, rng),
            Motion::Jump | Motion::Churn => *center = anywhere(rng, side),
        }
        self.place(i);
    }

    /// Removes as many boxes as this frame has inserted: the next ones after all absent ones.
    fn remove(&mut self, count: usize) {
        let n = self.boxes.len();
        let first = self.next + self.motion.absent(n);
        for k in 0..count {
            let id = self.order[(first + k) % n];
            self.boxes[id as usize] = Aabb::NOWHERE;
            self.changed.push(id);
        }
        self.changed.sort_unstable();
    }
}

fn anywhere(rng: &mut StdRng, side: f32) -> [f32; 3] {
    [0; 3].map(|_| rng.random_range(0.0..side))
}

/// Moves a coordinate by its velocity, and turns both at the border of the space.
fn advance(x: &mut f32, velocity: &mut f32, side: f32) {
    *x += *velocity;
    if *x < 0.0 || *x > side {
        *x = if *x < 0.0 { -*x } else { 2.0 * side - *x };
        *velocity = -*velocity;
    }
}

/// Returns the height of a box whose fall has elapsed in part.
fn height(elapsed: f32, side: f32) -> f32 {
    side * (1.0 - elapsed * elapsed)
}

fn fall(center: &mut [f32; 3], elapsed: &mut f32, side: f32, rng: &mut StdRng) {
    let frames = (2.0 * side / GRAVITY).sqrt();
    *elapsed += 1.0 / frames;
    if *elapsed >= 1.0 {
        *elapsed -= 1.0;
        *center = anywhere(rng, side);
    }
    center[1] = height(*elapsed, side);
}
