//! Crowds of boxes that may not pair with each other: no pair is missed.

use crate::follower::Follower;
use pbig_core::{Aabb, ProxyFilter};
use pbig_tests::strategies;
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

const ALL: ProxyFilter = ProxyFilter::ALL;
const FIXED: ProxyFilter = ProxyFilter { kind: 2, accepted_kinds: 1, ..ALL };
const MOVING: ProxyFilter = ProxyFilter { accepted_kinds: 3, ..ALL };
/// Meets everything but its like.
const DEBRIS: ProxyFilter = ProxyFilter { memberships: 2, mask: !2, ..MOVING };

/// A box of about edge 1, or a large one, near one of few places.
fn crowded(random: &mut StdRng) -> Aabb {
    let place = random.random_range(0..3) as f32 * 50.0;
    let half = [0.5, 0.5, 0.5, 0.4, 0.03, 20.0, f32::INFINITY][random.random_range(0..7usize).min(6)];
    Aabb::from_center(std::array::from_fn(|_| place + random.random_range(-0.4..0.4)), [half; 3])
}

fn filter(random: &mut StdRng, share: u32) -> ProxyFilter {
    match random.random_range(0..10) {
        n if n < share => DEBRIS,
        n if n < share + 2 => FIXED,
        n if n < share + 3 => ProxyFilter { body: 3 + n % 2, ..MOVING },
        n => ProxyFilter { body: if n == 9 { 1 } else { random.random_range(10..200) }, ..MOVING },
    }
}

#[test]
fn crowds_that_change_sides_agree_on_every_strategy() {
    for (strategy, way) in strategies() {
        for seed in 0..8 {
            let (mut random, ids) = (StdRng::seed_from_u64(seed), [150, 400][seed as usize % 2]);
            let mut world = Follower::new(way.with(|it| it.margin = 0.01), ids);
            for round in 0..12u32 {
                let changes = if round % 4 == 0 { ids } else { ids / 12 };
                // First most are debris, then few, then most again.
                let share = [6, 0, 5][round as usize / 4];
                for i in 0..changes {
                    let id = if changes == ids { i as u32 } else { random.random_range(0..ids as u32) };
                    match random.random_range(0..9) {
                        0 => world.remove(id),
                        _ => world.set(id, crowded(&mut random), filter(&mut random, share)),
                    }
                }
                world.update(&format!("{strategy}, seed {seed}, round {round}"));
            }
        }
    }
}
