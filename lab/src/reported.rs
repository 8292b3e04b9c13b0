//! Pairs that were reported against those whose boxes overlap: what is extra, and what is missing.

use pbig_core::{Aabb, Pair, ProxyFilter, oracle};
use pbig_harness::world::World;
use rapier_pbig::{collision_aabb, filter_of};
use rapier3d::prelude::ColliderHandle;
use std::ops::AddAssign;

/// Counts of pairs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Reported {
    /// Pairs whose boxes, without any margin, overlap.
    pub(crate) needed: u64,
    /// Reported pairs that are not needed.
    pub(crate) extra: u64,
    /// Needed pairs that are not reported.
    pub(crate) missed: u64,
}

impl Reported {
    /// Compares reported pairs, in any order, with the needed ones.
    pub(crate) fn compare(mut reported: Vec<Pair>, needed: &[Pair]) -> Self {
        reported.sort_unstable();
        reported.dedup();
        let known = needed.iter().filter(|pair| reported.binary_search(pair).is_ok()).count();
        let (needed, extra) = (needed.len() as u64, (reported.len() - known) as u64);
        Self { needed, extra, missed: needed - known as u64 }
    }

    /// Compares the narrow phase's pairs after a step, which its broad phase has reported, with brute force over
    /// the boxes of enabled colliders that rapier's early filters allow.
    pub(crate) fn of(world: &World) -> Self {
        let index = |collider: ColliderHandle| collider.into_raw_parts().0;
        let ids = world.colliders.iter().map(|(handle, _)| index(handle) as usize + 1).max().unwrap_or(0);
        let (mut boxes, mut filters) = (vec![Aabb::NOWHERE; ids], vec![ProxyFilter::ALL; ids]);
        for (handle, collider) in world.colliders.iter().filter(|(_, collider)| collider.is_enabled()) {
            let id = index(handle) as usize;
            boxes[id] = collision_aabb(&world.params, &world.bodies, collider);
            filters[id] = filter_of(&world.bodies, collider);
        }
        let reported = world.pairs().map(|pair| Pair::new(index(pair.collider1), index(pair.collider2)));
        Self::compare(reported.collect(), &oracle::pairs_filtered(&boxes, &filters))
    }
}

impl AddAssign for Reported {
    fn add_assign(&mut self, other: Self) {
        self.needed += other.needed;
        self.extra += other.extra;
        self.missed += other.missed;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reordered::Reordered;
    use glam::Vec3;
    use rapier_pbig::{PbigBroadPhase, PbigConfig};
    use rapier3d::prelude::*;

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
    fn a_wide_margin_has_extra_pairs_and_a_wrong_event_misses_one() {
        let config = |margin| PbigConfig { margin, ..PbigConfig::DEFAULT };
        let with = |margin| PbigBroadPhase::with_config(config(margin)).expect("a length");
        let counts = |needed, extra, missed| Reported { needed, extra, missed };
        assert_eq!(after_a_step(&mut with(0.01)), counts(1, 0, 0));
        assert_eq!(after_a_step(&mut with(0.15)), counts(1, 1, 0));
        let ends = |events: &mut [BroadPhasePairEvent]| {
            for event in events {
                let (BroadPhasePairEvent::AddPair(pair) | BroadPhasePairEvent::DeletePair(pair)) = *event;
                *event = BroadPhasePairEvent::DeletePair(pair);
            }
        };
        assert_eq!(after_a_step(&mut Reordered(with(0.01), ends)), counts(1, 0, 1));
    }
}
