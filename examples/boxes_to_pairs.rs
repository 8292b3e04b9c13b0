//! Boxes in, pairs out: the finder without rapier.
//!
//! `cargo run --release --example boxes_to_pairs`

use pbig_core::{Aabb, Error, Finder};

fn main() -> Result<(), Error> {
    // A row of cubes, each touching the next, and a box that is nowhere.
    let mut boxes: Vec<Aabb> = (0..6).map(|i| Aabb::from_center([i as f32, 0.0, 0.0], [0.5; 3])).collect();
    boxes.push(Aabb::NOWHERE);

    let mut finder = Finder::default();
    for pair in finder.find(&boxes)? {
        println!("box {} overlaps box {}", pair.a, pair.b);
    }
    let report = finder.report();
    println!("{} boxes, {} invalid, {} pairs", report.boxes, report.invalid, report.pairs);
    println!("{}", report.plan);
    Ok(())
}
