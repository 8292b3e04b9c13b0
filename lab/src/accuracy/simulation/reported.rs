//! Pairs that were reported against those whose boxes overlap.

use pbig_core::{Aabb, Pair, ProxyFilter, oracle};
use pbig_harness::world::World;
use rapier_pbig::{collision_aabb, filter_of};
use rapier3d::prelude::ColliderHandle;
use std::collections::BTreeSet;
use std::ops::AddAssign;

/// Counts of pairs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Reported {
    /// Pairs whose boxes, without any margin, overlap.
    pub(super) needed: u64,
    /// Needed pairs that are not reported.
    pub(super) missed: u64,
}

impl Reported {
    /// Compares the narrow phase's pairs after a step, which its broad phase has reported, with brute force over
    /// the boxes of enabled colliders that rapier's early filters allow.
    pub(super) fn of(world: &World) -> Self {
        let index = |collider: ColliderHandle| collider.into_raw_parts().0;
        let ids = world.colliders.iter().map(|(handle, _)| index(handle) as usize + 1).max().unwrap_or(0);
        let (mut boxes, mut filters) = (vec![Aabb::NOWHERE; ids], vec![ProxyFilter::ALL; ids]);
        for (handle, collider) in world.colliders.iter().filter(|(_, collider)| collider.is_enabled()) {
            let id = index(handle) as usize;
            boxes[id] = collision_aabb(&world.params, &world.bodies, collider);
            filters[id] = filter_of(&world.bodies, collider);
        }
        let reported = world.pairs().map(|pair| Pair::new(index(pair.collider1), index(pair.collider2)));
        let (reported, needed): (BTreeSet<Pair>, _) =
            (reported.collect(), oracle::pairs_filtered(&boxes, &filters));
        let missed = needed.iter().filter(|pair| !reported.contains(pair)).count() as u64;
        Self { needed: needed.len() as u64, missed }
    }
}

impl AddAssign for Reported {
    fn add_assign(&mut self, other: Self) {
        self.needed += other.needed;
        self.missed += other.missed;
    }
}

#[cfg(test)]
mod tests {
    use super::super::reordered::Reordered;
    use super::*;
    use glam::Vec3;
    use rapier_pbig::PbigBroadPhase;
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
    fn a_wrong_event_misses_a_pair() {
        assert_eq!(after_a_step(&mut PbigBroadPhase::new()), Reported { needed: 1, missed: 0 });
        let ends = |events: &mut [BroadPhasePairEvent]| {
            for event in events {
                let (BroadPhasePairEvent::AddPair(pair) | BroadPhasePairEvent::DeletePair(pair)) = *event;
                *event = BroadPhasePairEvent::DeletePair(pair);
            }
        };
        let mut wrong = Reordered(PbigBroadPhase::new(), ends);
        assert_eq!(after_a_step(&mut wrong), Reported { needed: 1, missed: 1 });
    }
}
