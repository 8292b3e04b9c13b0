//! Boxes by the thousand in one place.

use super::ways_to_update;
use crate::follower::Follower;
use pbig_core::{Aabb, ProxyFilter};

/// Thousands in one place of which few may pair, through updates in which some leave and come back.
#[test]
fn identical_boxes_by_the_thousand_that_come_and_go() {
    let cube = Aabb::from_center([1.0; 3], [0.5; 3]);
    let (crowd, guest) = (
        ProxyFilter { memberships: 1, mask: 2, ..ProxyFilter::ALL },
        ProxyFilter { memberships: 2, mask: 3, ..ProxyFilter::ALL },
    );
    for (strategy, way) in ways_to_update() {
        let mut world = Follower::new(way, 2400);
        let filter = |id: u32| if id.is_multiple_of(480) { guest } else { crowd };
        (0..2400).for_each(|id| world.set(id, cube, filter(id)));
        world.update(&format!("{strategy}, all come"));
        for round in 0..3 {
            for id in (round..2400).step_by(240) {
                world.remove(id);
            }
            world.update(&format!("{strategy}, some leave"));
            (round..2400).step_by(240).for_each(|id| world.set(id, cube, filter(id)));
            world.update(&format!("{strategy}, they return"));
        }
    }
}
