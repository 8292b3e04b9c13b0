//! Pairs that were reported against those whose boxes overlap: what is extra, and what is missing.

use pbig_core::{Aabb, Pair, ProxyFilter, oracle};
use pbig_harness::world::World;
use rapier_pbig::{collision_aabb, filter_of};
use rapier3d::prelude::{ColliderHandle, ColliderPair};
use std::ops::AddAssign;

/// Counts of pairs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Reported {
    /// Pairs whose boxes, without any margin, overlap.
    pub needed: u64,
    /// Reported, and not among those.
    pub extra: u64,
    /// Among those, and not reported.
    pub missed: u64,
}

impl Reported {
    /// Compares reported pairs, in any order, with the needed ones.
    pub fn compare(mut reported: Vec<Pair>, needed: &[Pair]) -> Self {
        reported.sort_unstable();
        reported.dedup();
        let known = needed.iter().filter(|pair| reported.binary_search(pair).is_ok()).count();
        let (needed, extra) = (needed.len() as u64, (reported.len() - known) as u64);
        Self { needed, extra, missed: needed - known as u64 }
    }

    /// The narrow phase's pairs after a step, which are those that its broad phase has reported, against brute force.
    pub fn of(world: &World) -> Self {
        Self::compare(world.pairs().map(by_index).collect(), &needed(world))
    }

    /// Extra pairs for a hundred needed ones.
    pub fn extra_percent(&self) -> f64 {
        self.extra as f64 / self.needed.max(1) as f64 * 100.0
    }
}

impl AddAssign for Reported {
    fn add_assign(&mut self, other: Self) {
        self.needed += other.needed;
        self.extra += other.extra;
        self.missed += other.missed;
    }
}

fn index(collider: ColliderHandle) -> u32 {
    collider.into_raw_parts().0
}

fn by_index(pair: ColliderPair) -> Pair {
    Pair::new(index(pair.collider1), index(pair.collider2))
}

/// Brute force over the boxes of enabled colliders that rapier's early filters allow.
fn needed(world: &World) -> Vec<Pair> {
    let ids = world.colliders.iter().map(|(handle, _)| index(handle) as usize + 1).max().unwrap_or(0);
    let (mut boxes, mut filters) = (vec![Aabb::NOWHERE; ids], vec![ProxyFilter::ALL; ids]);
    for (handle, collider) in world.colliders.iter().filter(|(_, collider)| collider.is_enabled()) {
        let id = index(handle) as usize;
        boxes[id] = collision_aabb(&world.params, &world.bodies, collider);
        filters[id] = filter_of(&world.bodies, collider);
    }
    oracle::pairs_filtered(&boxes, &filters)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use rapier_pbig::{PbigBroadPhase, PbigConfig};
    use rapier3d::prelude::*;

    /// Reports nothing.
    struct Silent;

    impl BroadPhase for Silent {
        fn update(
            &mut self,
            _: &IntegrationParameters,
            _: &ColliderSet,
            _: &RigidBodySet,
            _: &[ColliderHandle],
            _: &[ColliderHandle],
            _: &mut Vec<BroadPhasePairEvent>,
        ) {
        }
    }

    /// Three balls in a row: the first two overlap, the third is 0.2 away.
    fn after_a_step(broad_phase: &mut dyn BroadPhase) -> Reported {
        let mut world = World::with_gravity(Vec3::ZERO);
        for x in [0.0, 0.9, 2.1] {
            world.add(World::dynamic(Vec3::X * x), ColliderBuilder::ball(0.5));
        }
        world.step(broad_phase);
        Reported::of(&world)
    }

    #[test]
    fn a_wide_margin_has_extra_pairs_and_silence_misses_some() {
        let config = |margin| PbigConfig { margin, ..PbigConfig::DEFAULT };
        let with = |margin| PbigBroadPhase::with_config(config(margin)).expect("a length");
        let counts = |needed, extra, missed| Reported { needed, extra, missed };
        assert_eq!(after_a_step(&mut with(0.01)), counts(1, 0, 0));
        assert_eq!(after_a_step(&mut with(0.15)), counts(1, 1, 0));
        assert_eq!(after_a_step(&mut Silent), counts(1, 0, 1));
    }
}
