//! Finds the overlapping pairs of a list of boxes, without rapier.
//!
//! `cargo run --release --example boxes_to_pairs`

use pbig_core::{Aabb, Error, Finder};

fn main() -> Result<(), Error> {
    // A row of cubes, each of which touches the next, and an invalid box.
    let mut boxes: Vec<Aabb> = (0..6).map(|i| Aabb::from_center([i as f32, 0.0, 0.0], [0.5; 3])).collect();
    boxes.push(Aabb::NOWHERE);

    // For one list `pbig_core::find_pairs(&boxes)` is enough. A finder keeps its buffers for the next list.
    let mut finder = Finder::default();
    for pair in finder.find(&boxes)? {
        println!("box {} overlaps box {}", pair.a, pair.b);
    }
    let report = finder.report();
    println!("{} boxes, {} invalid, {} pairs", report.boxes, report.invalid, report.pairs);
    println!("{}", report.plan);
    Ok(())
}
