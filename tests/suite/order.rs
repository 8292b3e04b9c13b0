//! A pair ends in the order in which it began, even if its colliders change in between: an app that keeps ordered pairs of
//! handles must not keep one for ever.

mod pairs;

use pbig_harness::world::{World, to_vector};
use rand::RngExt;
use rand::rngs::StdRng;
use rapier_pbig::PbigBroadPhase;

type Subject = PbigBroadPhase;

fn subject() -> Subject {
    PbigBroadPhase::new()
}

/// Restores the broad phase, or takes the world over with a new one.
fn hand_over(world: &mut World, broad_phase: &mut Subject, rng: &mut StdRng) {
    match rng.random_range(0..4) {
        0 => {
            *broad_phase = subject();
            broad_phase.adopt(&world.narrow_phase);
        }
        1 => broad_phase.adopt(&world.narrow_phase),
        2 => *broad_phase = broad_phase.clone(),
        _ => {
            let bytes = postcard::to_stdvec(broad_phase).expect("a snapshot");
            *broad_phase = postcard::from_bytes(&bytes).expect("what was saved");
            *world = World::from_bytes(&world.to_bytes()).expect("the bytes of a world");
        }
    }
}
