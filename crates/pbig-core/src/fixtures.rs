//! Boxes, and short ways to set them, for unit tests.

use crate::{Aabb, BroadPhase, ProxyFilter, oracle};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use std::ops::Range;

/// Returns the cube around a point.
pub(crate) fn cube(center: [f32; 3], half: f32) -> Aabb {
    Aabb::from_center(center, [half; 3])
}

/// Returns a place of a lattice, of `side` times `side` places in a layer.
pub(crate) fn lattice(id: u32, side: u32) -> [f32; 3] {
    [id % side, id / side % side, id / side / side].map(|x| x as f32)
}

/// Returns a random point of a cube.
pub(crate) fn random_point(random: &mut StdRng, within: Range<f32>) -> [f32; 3] {
    [0; 3].map(|_| random.random_range(within.clone()))
}

/// Returns boxes that cross in three directions, and that no tree can cut apart.
pub(crate) fn needles(n: usize) -> Vec<Aabb> {
    let mut random = StdRng::seed_from_u64(1);
    let needle = |i: usize| {
        let (mut at, mut half) = (random_point(&mut random, 0.0..1.0), [1e-9; 3]);
        (at[i % 3], half[i % 3]) = (0.5, 0.5);
        Aabb::from_center(at, half)
    };
    (0..n).map(needle).collect()
}

/// Runs work on a pool of threads.
#[cfg(feature = "parallel")]
pub(crate) fn on_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads").install(work)
}

/// Runs work on the caller's thread, as there are no others.
#[cfg(not(feature = "parallel"))]
pub(crate) fn on_threads<T>(_: usize, work: impl FnOnce() -> T) -> T {
    work()
}

/// Sets boxes without a filter.
pub(crate) fn set(of: &mut BroadPhase, boxes: impl IntoIterator<Item = (u32, Aabb)>) {
    boxes.into_iter().for_each(|(id, aabb)| of.set(id, aabb, ProxyFilter::ALL).expect("a small id"));
}

/// Sets boxes without a filter, and updates.
pub(crate) fn update(of: &mut BroadPhase, boxes: impl IntoIterator<Item = (u32, Aabb)>) {
    set(of, boxes);
    of.update().expect("few pairs");
}

/// Asserts that the pairs of boxes without filters are the oracle's.
pub(crate) fn assert_right(of: &BroadPhase, what: &str) {
    assert!(of.pairs().eq(oracle::pairs(of.fat_aabbs())), "{what}");
}

/// Returns the ids of boxes that overlap one, sorted.
pub(crate) fn met(of: &BroadPhase, aabb: &Aabb) -> Vec<u32> {
    let mut met = of.overlapping(aabb);
    met.sort_unstable();
    met
}
