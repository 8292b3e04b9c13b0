//! A pair ends in the order in which it began, even if its colliders change in between: an app that keeps ordered pairs of
//! handles must not keep one for ever.

#[path = "../../../tests/suite/order/pairs.rs"]
mod pairs;

use pbig_harness_036::world::{World, to_vector};
use rand::RngExt;
use rand::rngs::StdRng;
use rapier3d::prelude::BroadPhaseBvh;

type Subject = BroadPhaseBvh;

fn subject() -> Subject {
    rapier_pbig::broad_phase()
}

/// Changes who finds the pairs: nobody, by a save and a restore, with or without pbig afterwards, or at once.
fn hand_over(world: &mut World, broad_phase: &mut Subject, rng: &mut StdRng) {
    match rng.random_range(0..5) {
        0 => rapier_pbig::uninstall(broad_phase),
        1 => rapier_pbig::install(broad_phase),
        kind @ (2 | 3) => {
            let bytes = world.to_bytes(broad_phase);
            (*world, *broad_phase) = World::from_bytes(&bytes).expect("the bytes of a world");
            if kind == 3 {
                rapier_pbig::install(broad_phase);
            }
        }
        _ => *broad_phase = broad_phase.clone(),
    }
}
