//! Sets of boxes by name: the papers' sets, and sets that broke other broad phases.

use pbig_core::Aabb;
use rand::rngs::StdRng;
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
}
