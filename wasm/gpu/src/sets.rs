//! The sets of boxes: the corpus, and larger ones with a ground.

use pbig_core::Aabb;
use pbig_harness::boxes::BoxSet;
use pbig_harness::corpus::{Case, corpus};

/// Returns the sets of at most this number of boxes.
pub(crate) fn sets(most_boxes: usize) -> Vec<Case> {
    let large = ["uniform", "mixed", "pile", "degenerate"].map(on_ground);
    corpus().into_iter().chain(large).filter(|case| case.boxes.len() <= most_boxes).collect()
}

/// Returns a set of thousands of boxes on a ground, and some with the floats that break comparisons.
fn on_ground(name: &str) -> Case {
    let mut boxes = BoxSet::named(name).expect("the set exists").boxes(6000, 11);
    let odd = [f32::NAN, -f32::NAN, -0.0, 1e-45, f32::NEG_INFINITY, f32::INFINITY, f32::MAX];
    for (i, odd) in odd.into_iter().enumerate() {
        boxes[50 * i].min[i % 3] = odd;
        boxes[50 * i + 1].max[i % 3] = odd;
        boxes[50 * i + 2] = Aabb::new([odd; 3], [odd; 3]);
    }
    boxes.push(Aabb::new([f32::NEG_INFINITY; 3], [f32::INFINITY, 1.0, f32::INFINITY]));
    Case { name: format!("{name} on a ground"), boxes }
}
