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
use space::{Space, mixed_edge};

/// Largest distance that a box drifts or jitters in a frame along each axis; unit cubes have edge 1.
const STEP: f32 = 0.1;

/// Distance of a swing along each axis at most, in edges of the box.
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
    /// Every kind.
    pub const ALL: [Self; 9] = [
        Self::Drift,
        Self::Jitter,
        Self::Swing,
        Self::Fall,
        Self::Jump,
        Self::Burst,
        Self::Shares,
        Self::Few,
        Self::Churn,
    ];

    /// Returns the name in tables and files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Drift => "drift",
            Self::Jitter => "jitter",
            Self::Swing => "swing",
            Self::Fall => "fall",
            Self::Jump => "jump",
            Self::Burst => "rest and burst",
            Self::Shares => "changing shares",
            Self::Few => "few",
            Self::Churn => "churn",
        }
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
    /// Every density.
    pub const ALL: [Self; 3] = [Self::Dense, Self::Sparse, Self::Mixed];

    /// Returns the name in tables and files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Dense => "dense",
            Self::Sparse => "sparse",
            Self::Mixed => "mixed",
        }
    }

    /// Returns the expected number of pairs, divided by the number of boxes.
    pub fn pairs_per_box(self) -> f64 {
        match self {
            Self::Dense => 3.7,
            Self::Sparse => 1.0,
            Self::Mixed => 11.0,
        }
    }

    fn edge(self, rng: &mut StdRng) -> f32 {
        if self == Self::Mixed { mixed_edge(rng.random_range(0.0..1.0)) as f32 } else { 1.0 }
    }
}

/// Boxes that move.
#[derive(Debug)]
pub struct Scene {
    motion: Motion,
    /// Edge of the cube that holds the centers, in the boxes' length unit.
    side: f32,
    /// Number of frames so far.
    frame: usize,
    rng: StdRng,
    /// All ids, shuffled: each frame takes the next ones.
    order: Vec<u32>,
    /// Position in `order`.
    next: usize,
    centers: Vec<[f32; 3]>,
    edges: Vec<f32>,
    paths: Paths,
    boxes: Vec<Aabb>,
    changed: Vec<u32>,
}

/// The state, besides its center, on which the next center of a box depends.
#[derive(Debug)]
enum Paths {
    Free,
    Velocities(Vec<[f32; 3]>),
    Homes(Vec<[f32; 3]>),
    /// Elapsed part of each box's fall, from 0 to 1.
    Falls(Vec<f32>),
}

impl Scene {
    /// Makes `n` boxes. With [`Motion::Churn`] a tenth of them is absent.
    pub fn new(motion: Motion, density: Density, n: usize, seed: u64) -> Self {
        let mut rng = StdRng::seed_from_u64(seed);
        let space = Space { mixed: density == Density::Mixed, falls: motion == Motion::Fall };
        let side = space.side(n - motion.absent(n), density.pairs_per_box()) as f32;
        let centers: Vec<[f32; 3]> = (0..n).map(|_| anywhere(&mut rng, side)).collect();
        let edges: Vec<f32> = (0..n).map(|_| density.edge(&mut rng)).collect();
        let mut order: Vec<u32> = (0..n as u32).collect();
        order.shuffle(&mut rng);
        let paths = Paths::new(motion, &centers, &mut rng);
        let (boxes, changed) = (vec![Aabb::NOWHERE; n], Vec::with_capacity(n));
        let mut scene =
            Self { motion, side, frame: 0, rng, order, next: 0, centers, edges, paths, boxes, changed };
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
        if let Paths::Falls(elapsed) = &self.paths {
            let heights = elapsed.iter().map(|&elapsed| height(elapsed, self.side));
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
        match (&mut self.paths, self.motion) {
            (Paths::Velocities(velocities), _) => {
                for (x, v) in center.iter_mut().zip(&mut velocities[i]) {
                    advance(x, v, side);
                }
            }
            (Paths::Homes(homes), _) => {
                let far = if self.frame.is_multiple_of(2) { 0.0 } else { SWING * self.edges[i] };
                *center = homes[i].map(|x| x + rng.random_range(-far..=far));
            }
            (Paths::Falls(elapsed), _) => fall(center, &mut elapsed[i], side, rng),
            (Paths::Free, Motion::Jump | Motion::Churn) => *center = anywhere(rng, side),
            (Paths::Free, _) => {
                for x in center {
                    advance(x, &mut rng.random_range(-STEP..=STEP), side);
                }
            }
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

impl Paths {
    fn new(motion: Motion, centers: &[[f32; 3]], rng: &mut StdRng) -> Self {
        match motion {
            Motion::Drift | Motion::Burst => {
                let velocity = |_: &[f32; 3]| [0; 3].map(|_| rng.random_range(-STEP..=STEP));
                Self::Velocities(centers.iter().map(velocity).collect())
            }
            Motion::Swing => Self::Homes(centers.to_vec()),
            Motion::Fall => Self::Falls(centers.iter().map(|_| rng.random_range(0.0..1.0)).collect()),
            _ => Self::Free,
        }
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
