//! The instructions that the tree needs, against the portable ones.

use super::random_box;
use crate::Aabb;
use crate::simd::{Portable, Simd};

use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

/// Gathers eight boxes, and returns them and the box around them.
fn gathered(simd: impl Simd, boxes: &[Aabb], at: &[u32; 8]) -> ([[f32; 8]; 6], Aabb) {
    let eight = simd.gather(boxes, at);
    (eight, simd.around(&eight))
}

/// Returns the lane of the nearest key, and keys with their values, the farthest first.
fn ordered(
    simd: impl Simd,
    keys: &[f32; 8],
    limits: &[f32; 8],
    values: &[u32; 8],
) -> (Option<usize>, Vec<f32>, Vec<u32>) {
    let (sorted, order, count) = simd.farthest_first(keys, limits, values);
    (simd.nearest(keys, limits), sorted[..count].to_vec(), order[..count].to_vec())
}

#[test]
fn instructions_gather_and_order_as_the_portable_ones_do() {
    let mut rng = StdRng::seed_from_u64(11);
    for _ in 0..2000 {
        let boxes: Vec<Aabb> = (0..20).map(|_| random_box(&mut rng, 5.0)).collect();
        let at = [0; 8].map(|_| rng.random_range(0..22u32).checked_sub(1).unwrap_or(u32::MAX));
        assert_eq!(crate::simd::dispatch!(gathered, &boxes, &at), gathered(Portable, &boxes, &at));
        let number =
            |rng: &mut StdRng| [0.0, 1.0, f32::MAX, f32::INFINITY, rng.random()][rng.random_range(0..5)];
        let [keys, limits] = [(); 2].map(|()| [0; 8].map(|_| number(&mut rng)));
        let ours = crate::simd::dispatch!(ordered, &keys, &limits, &at);
        assert_eq!(ours, ordered(Portable, &keys, &limits, &at), "{keys:?} {limits:?}");
    }
}
