//! The size of the space in which boxes have a wanted number of pairs.

use super::Density;

/// The number of typical edges that stand for random ones.
const SAMPLES: usize = 32;

/// Returns the edge of the cube in which the centers of `n` boxes are uniform, but for heights of boxes that fall: these are on
/// their way from the top to the bottom, with starts uniform in time.
pub(super) fn side(density: Density, falls: bool, n: usize) -> f64 {
    let edges: Vec<f64> = (0..SAMPLES).map(|i| density.edge((i as f64 + 0.5) / SAMPLES as f64)).collect();
    let reaches = || edges.iter().flat_map(|a| edges.iter().map(move |b| 0.5 * (a + b)));
    let chance = |part: f64| near(part).powi(2) * if falls { near_in_a_fall(part) } else { near(part) };
    let pairs_per_box = |side: f64| {
        let sum: f64 = reaches().map(|reach| chance((reach / side).min(1.0))).sum();
        0.5 * n.saturating_sub(1) as f64 * sum / (SAMPLES * SAMPLES) as f64
    };
    let (mut low, mut high): (f64, f64) = (0.1, 1e6);
    for _ in 0..60 {
        let middle = (low * high).sqrt();
        if pairs_per_box(middle) > density.pairs_per_box() { low = middle } else { high = middle }
    }
    high
}

/// Returns the chance that two numbers, uniform from 0 to 1, differ by at most `part`.
fn near(part: f64) -> f64 {
    part * (2.0 - part)
}

/// Returns the chance that the squares of two such numbers differ by at most `part`: a fall covers the square of its time.
///
/// It is twice the integral, over the lower number s, of min(1, sqrt(s^2 + part)) - s.
fn near_in_a_fall(part: f64) -> f64 {
    1.0 - (1.0 - part).sqrt() + part * (1.0 / part - 1.0).sqrt().asinh()
}
