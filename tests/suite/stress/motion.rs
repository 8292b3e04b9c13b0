//! Worlds that move far.

use super::through_updates;
use pbig_core::Aabb;
use pbig_tests::{set, shifted};

/// Ever faster, until the coordinates are infinite and then no numbers, and from the beginning again.
#[test]
fn a_fall_beyond_the_range_of_f32_and_back() {
    let start = set("pile", 150, 3);
    let mut frames = vec![start.clone()];
    for decade in 0..40 {
        // From 10^39 on this is infinite.
        let depth = 10f64.powi(decade) as f32;
        frames.push(frames[frames.len() - 1].iter().map(|b| shifted(b, [0.0, -depth, 0.0])).collect());
    }
    assert!(frames[40].iter().all(|b| b.max[1] == f32::NEG_INFINITY));
    frames.push(vec![Aabb::NOWHERE; 150]);
    frames.push(start);
    through_updates("beyond the range", &frames);
}
