//! Sets of boxes by name: the papers' sets, and sets that broke other broad phases.

use pbig_core::Aabb;
use rand::rngs::StdRng;
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, Normal};

/// A named generator: `n` boxes from a seed, the same ones every time.
#[derive(Clone, Copy, Debug)]
pub struct BoxSet {
    pub name: &'static str,
    make: fn(usize, &mut StdRng) -> Vec<Aabb>,
}

impl BoxSet {
    pub const ALL: [Self; 6] = [
        Self { name: "uniform", make: uniform }, // PBIG 6.1: centres uniform in 10^4 cubed, edges 1 to 100
        Self { name: "gaussian", make: gaussian }, // PBIG 6.3: centres normal, deviation 1000
        Self { name: "unit", make: unit },       // unit cubes, density 1/4, about one pair a box
        Self { name: "mixed", make: mixed },     // edges log-uniform from 0.1 to 10, about one pair a box
        Self { name: "pile", make: pile },       // a settled lattice, 10 to 12 neighbours a box
        Self { name: "degenerate", make: degenerate }, // every kind of bad, flat, far, huge and identical box
    ];

    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|set| set.name == name)
    }

    pub fn boxes(&self, n: usize, seed: u64) -> Vec<Aabb> {
        (self.make)(n, &mut StdRng::seed_from_u64(seed))
    }
}

pub fn shifted(aabb: &Aabb, by: [f32; 3]) -> Aabb {
    let add = |corner: [f32; 3]| std::array::from_fn(|k| corner[k] + by[k]);
    Aabb::new(add(aabb.min), add(aabb.max))
}

/// The boxes moved by up to `distance` along each axis, sizes kept.
pub fn moved(boxes: &[Aabb], distance: f32, seed: u64) -> Vec<Aabb> {
    let mut rng = StdRng::seed_from_u64(seed);
    let mut shift = |b: &Aabb| shifted(b, [0; 3].map(|_| rng.random_range(-distance..=distance)));
    boxes.iter().map(&mut shift).collect()
}

/// Cubes whose edges differ by up to `spread` times (log-uniform around 1), about `pairs` pairs a box:
/// with `spread` 1 the set `unit` at other densities.
pub fn cubes(n: usize, spread: f32, pairs: f32, seed: u64) -> Vec<Aabb> {
    let mut rng = StdRng::seed_from_u64(seed);
    let edges: Vec<f32> = (0..n).map(|_| spread.powf(rng.random_range(-0.5..=0.5))).collect();
    // Two cubes overlap when their centres are closer than half the sum of edges on each axis, so their
    // chance in a space V is (e + f)^3 / V; edges in turn stand for random ones.
    let cubed = |two: &[f32]| f64::from(two[0] + two[two.len() - 1]).powi(3);
    let mean = edges.windows(2).map(cubed).sum::<f64>() / edges.len().max(2) as f64;
    let side = (mean * n as f64 / (2.0 * f64::from(pairs))).cbrt() as f32;
    let mut edges = edges.into_iter();
    with(n, || {
        let half = edges.next().map_or(0.5, |edge| edge / 2.0);
        ([0; 3].map(|_| rng.random_range(0.0..side.max(1.0))), [half; 3])
    })
}

/// The boxes that move in each frame: a share of all, each frame a different one.
#[derive(Clone, Debug)]
pub struct Movers {
    order: Vec<u32>,
    pub count: usize,
}

impl Movers {
    /// A share of `n`, rounded, at least one.
    pub fn new(n: usize, share: f64) -> Self {
        let mut order: Vec<u32> = (0..n as u32).collect();
        order.shuffle(&mut StdRng::seed_from_u64(7));
        Self { order, count: ((n as f64 * share).round() as usize).clamp(n.min(1), n) }
    }

    /// Returns the boxes that move in a frame, in ascending order.
    pub fn of(&self, frame: usize) -> Vec<u32> {
        let n = self.order.len();
        let mut movers: Vec<u32> =
            (0..self.count).map(|i| self.order[(frame * self.count + i) % n]).collect();
        movers.sort_unstable();
        movers
    }
}

/// Boxes that go to and fro: a mover at home goes up to a distance away along each axis, one that is away
/// returns. So a set stays what it is, however many frames there are.
#[derive(Clone, Debug)]
pub struct Wander {
    pub boxes: Vec<Aabb>,
    home: Vec<Aabb>,
    is_away: Vec<bool>,
    movers: Movers,
    distance: f32,
    /// The displacement of each box per frame, for boxes that do not return.
    velocities: Vec<[f32; 3]>,
}

impl Wander {
    /// All at home; a share of them will move in each frame.
    pub fn new(boxes: Vec<Aabb>, share: f64, distance: f32) -> Self {
        let movers = Movers::new(boxes.len(), share);
        let (home, is_away) = (boxes.clone(), vec![false; boxes.len()]);
        Self { home, is_away, boxes, movers, distance, velocities: vec![] }
    }

    /// All move in every frame, each in a direction of its own by up to the distance along each axis; at the border of
    /// the space of the set they turn.
    pub fn drifting(boxes: Vec<Aabb>, distance: f32) -> Self {
        let mut rng = StdRng::seed_from_u64(9);
        let velocities =
            boxes.iter().map(|_| [0; 3].map(|_| rng.random_range(-distance..=distance))).collect();
        Self { velocities, ..Self::new(boxes, 1.0, distance) }
    }

    /// Moves those of a frame, and tells who they are.
    pub fn step(&mut self, frame: usize) -> Vec<u32> {
        let movers = self.movers.of(frame);
        if !self.velocities.is_empty() {
            self.drift();
            return movers;
        }
        let homes: Vec<Aabb> = movers.iter().map(|&id| self.home[id as usize]).collect();
        for (&id, place) in movers.iter().zip(moved(&homes, self.distance, frame as u64)) {
            let i = id as usize;
            self.boxes[i] = if self.is_away[i] { self.home[i] } else { place };
            self.is_away[i] = !self.is_away[i];
        }
        movers
    }

    fn drift(&mut self) {
        let space = self.home.iter().fold(Aabb::NOWHERE, |space, home| space.union(home));
        for (aabb, velocity) in self.boxes.iter_mut().zip(&mut self.velocities) {
            for (k, v) in velocity.iter_mut().enumerate() {
                let (out, below) = (aabb.max[k] > space.max[k], aabb.min[k] < space.min[k]);
                if (out && *v > 0.0) || (below && *v < 0.0) {
                    *v = -*v;
                }
                aabb.min[k] += *v;
                aabb.max[k] += *v;
            }
        }
    }
}

fn with(n: usize, make: impl FnMut() -> ([f32; 3], [f32; 3])) -> Vec<Aabb> {
    std::iter::repeat_with(make).take(n).map(|(center, half)| Aabb::from_center(center, half)).collect()
}

fn uniform(n: usize, rng: &mut StdRng) -> Vec<Aabb> {
    with(n, || ([0; 3].map(|_| rng.random_range(0.0..1e4)), [0; 3].map(|_| rng.random_range(0.5..50.0))))
}

fn gaussian(n: usize, rng: &mut StdRng) -> Vec<Aabb> {
    let normal = Normal::new(5000.0f32, 1000.0).expect("a deviation above zero");
    with(n, || ([0; 3].map(|_| normal.sample(rng)), [0; 3].map(|_| rng.random_range(0.5..50.0))))
}

fn unit(n: usize, rng: &mut StdRng) -> Vec<Aabb> {
    let edge = (4.0 * n as f32).cbrt();
    with(n, || ([0; 3].map(|_| rng.random_range(0.0..edge)), [0.5; 3]))
}

fn mixed(n: usize, rng: &mut StdRng) -> Vec<Aabb> {
    let edge = (142.0 * n as f32).cbrt();
    with(n, || {
        let half = 0.05 * 100f32.powf(rng.random_range(0.0..1.0));
        ([0; 3].map(|_| rng.random_range(0.0..edge)), [half; 3])
    })
}

fn pile(n: usize, rng: &mut StdRng) -> Vec<Aabb> {
    let side = (n as f64).cbrt().ceil() as usize;
    let mut i = 0;
    with(n, || {
        let place = [i % side, i / side % side, i / side / side];
        i += 1;
        (place.map(|p| p as f32 * 0.985 + rng.random_range(-0.05..0.05)), [0.5; 3])
    })
}

/// One box of each kind that `degenerate` draws from.
fn degenerate_box(rng: &mut StdRng) -> Aabb {
    let near = |rng: &mut StdRng| [0; 3].map(|_| rng.random_range(-5.0f32..5.0));
    let center = near(rng);
    let mut b = Aabb::from_center(center, [0; 3].map(|_| rng.random_range(0.0..1.0)));
    let axis = rng.random_range(0..3);
    match rng.random_range(0..18) {
        0 => b.min[axis] = f32::NAN,
        1 => b.max[axis] = f32::NAN,
        2 => std::mem::swap(&mut b.min, &mut b.max),
        3 => (b.min[axis], b.max[axis]) = (f32::NEG_INFINITY, f32::INFINITY),
        4 => b = Aabb::new([-0.5 * f32::MAX; 3], [0.5 * f32::MAX; 3]),
        5 => b = Aabb::new([-f32::MAX; 3], [f32::MAX; 3]),
        6 => b = Aabb::from_center(center, [0.0; 3]),
        7 => b.max[axis] = b.min[axis],
        8 => b = Aabb::from_center([0.0; 3], [1.0; 3]),
        9 => b = Aabb::from_center(center.map(|x| x.signum() * 1e30), [1e29; 3]),
        10 => b = Aabb::from_center(center.map(|x| 1e7 + x), [1.0; 3]),
        11 => b = Aabb::from_center(center.map(|x| x * 1e-40), [1e-41; 3]),
        12 => b = Aabb::from_center(center.map(f32::round), [0.5; 3]),
        13 => b = Aabb::from_center(center, [1e-3, 1e-3, 100.0]),
        14 => b = Aabb::from_center(center, [rng.random_range(-3.0f32..3.0).exp2(); 3]),
        15 => b = Aabb::new([-0.0; 3], [0.0; 3]),
        16 => b.max[axis] = f32::INFINITY,
        _ => {}
    }
    b
}

/// Mixes all kinds, and repeats some boxes exactly.
fn degenerate(n: usize, rng: &mut StdRng) -> Vec<Aabb> {
    let mut boxes: Vec<Aabb> = Vec::with_capacity(n);
    for i in 0..n {
        let again = i > 0 && rng.random_range(0..8) == 0;
        let b = if again { boxes[rng.random_range(0..i)] } else { degenerate_box(rng) };
        boxes.push(b);
    }
    boxes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_seed_gives_the_same_boxes_and_another_gives_others() {
        for set in BoxSet::ALL {
            let bits = |seed| -> Vec<u32> {
                set.boxes(50, seed).iter().flat_map(|b| b.min.map(f32::to_bits)).collect()
            };
            assert_eq!(bits(1), bits(1), "{}", set.name);
            assert_ne!(bits(1), bits(2), "{}", set.name);
        }
    }

    #[test]
    fn cubes_have_about_the_pairs_that_were_asked_for() {
        for (spread, pairs) in [(1.0, 1.0), (1.0, 4.0), (30.0, 1.0)] {
            let found = pbig_core::oracle::pairs(&cubes(3000, spread, pairs, 1)).len() as f32 / 3000.0;
            assert!((0.6 * pairs..1.4 * pairs).contains(&found), "{spread} {pairs}: {found}");
        }
    }

    #[test]
    fn wanderers_return_and_drifters_go_on_and_turn_at_the_border() {
        let start = BoxSet::ALL[2].boxes(200, 1);
        let mut wander = Wander::new(start.clone(), 1.0, 0.1);
        assert_eq!(wander.step(0).len(), 200);
        assert!(wander.boxes.iter().zip(&start).all(|(now, home)| now != home));
        wander.step(1);
        assert_eq!(wander.boxes, start);
        let mut drifting = Wander::drifting(start.clone(), 0.1);
        (0..400).for_each(|frame| assert_eq!(drifting.step(frame).len(), 200));
        let gone = drifting.boxes.iter().zip(&start).map(|(a, b)| (a.min[0] - b.min[0]).abs()).sum::<f32>();
        assert!(gone > 200.0, "{gone}: more than an edge each");
        let edge = 800f32.cbrt() + 2.0;
        assert!(drifting.boxes.iter().all(|aabb| aabb.min[0] > -1.0 && aabb.max[0] < edge));
    }

    #[test]
    fn movers_are_a_share_and_others_each_time() {
        let movers = Movers::new(100, 0.1);
        let mut all: Vec<u32> = (0..10).flat_map(|frame| movers.of(frame)).collect();
        all.sort_unstable();
        assert_eq!(all, (0..100).collect::<Vec<_>>());
        assert_eq!((Movers::new(5, 0.01).count, Movers::new(5, 1.0).count), (1, 5));
    }
}
