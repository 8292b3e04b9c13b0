//! Follows boxes that move: each update tells which pairs were added and which were removed.
//!
//! `cargo run --release --example boxes_events`

use pbig_core::{Aabb, BroadPhase, Config, Error, ProxyFilter};

/// Id of the box that moves.
const MOVER: u32 = 5000;

fn cube(x: f32, z: f32) -> Aabb {
    Aabb::from_center([x, 0.0, z], [0.5; 3])
}

fn main() -> Result<(), Error> {
    // A box is stored larger by the margin. It counts as changed when it leaves the stored box.
    let mut broad_phase = BroadPhase::new(Config { margin: 0.1, ..Config::DEFAULT })?;

    // A floor of cubes with gaps of 0.5, and one cube that moves over it.
    let ids: Vec<u32> = (0..MOVER).collect();
    let floor = |id: u32| cube(1.5 * (id % 100) as f32, 1.5 * (id / 100) as f32);
    broad_phase.set_many(&ids, |id| Some((floor(id), ProxyFilter::ALL)))?;
    for frame in 0..10 {
        let x = 0.25 * frame as f32;
        broad_phase.set(MOVER, cube(x, 0.75), ProxyFilter::ALL)?;
        let events = broad_phase.update()?;
        let others = |pairs: &[pbig_core::Pair]| pairs.iter().map(|pair| pair.a).collect::<Vec<_>>();
        let (added, removed) = (others(&events.added), others(&events.removed));
        println!("at {x:.2}: added with {added:?}, removed with {removed:?}");
    }
    println!("last update: {}", broad_phase.report().plan);

    // Questions between updates.
    let around: Vec<u32> = broad_phase.pairs_of(MOVER).map(|pair| pair.a).collect();
    println!(
        "{} boxes, {} pairs; box {MOVER} is near {around:?}",
        broad_phase.len(),
        broad_phase.pair_count()
    );
    println!("boxes in a corner: {:?}", broad_phase.overlapping(&cube(0.75, 0.75)));

    // The pairs of a removed box end without events.
    broad_phase.remove(MOVER);
    let removed = broad_phase.update()?.removed.len();
    println!("after box {MOVER} was removed: {removed} events, {} pairs", broad_phase.pair_count());
    Ok(())
}
