//! Boxes by the thousand in one place: complete, or an error that names the limit.

use super::ways_to_update;
use crate::finder::check_on;
use crate::follower::Follower;
use pbig_core::{Aabb, Error, Limits, Pair, ProxyFilter};
use pbig_tests::{Way, strategies};

fn all_pairs(n: u32) -> impl Iterator<Item = Pair> {
    (0..n).flat_map(move |a| (a + 1..n).map(move |b| Pair { a, b }))
}

/// No two alike, each two overlapping.
fn nested(n: usize) -> Vec<Aabb> {
    let half = |i: usize| [i, i * 3 % 997, i * 5 % 991].map(|edge| 1.0 + edge as f32);
    (0..n).map(|i| Aabb::from_center([0.3; 3], half(i))).collect()
}

#[test]
fn identical_boxes_by_the_thousand_in_three_places() {
    let places = [[0.0; 3], [5.0, 0.0, 0.0], [1e7, -1e7, 3.0]];
    for half in [0.0, 0.5] {
        let boxes: Vec<Aabb> = (0..3003).map(|i| Aabb::from_center(places[i % 3], [half; 3])).collect();
        check_on(strategies(), &format!("identical, half extent {half}"), &boxes);
    }
}

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

#[test]
fn everything_overlapping_everything_in_updates() {
    ways_to_update()
        .into_iter()
        .for_each(|(strategy, way)| complete_in_updates(way, strategy, &nested(1200)));
}

/// All come at once, one goes and comes back; before, the same with too low a limit, which changes nothing.
fn complete_in_updates(way: Way, strategy: &str, boxes: &[Aabb]) {
    let n = boxes.len() as u32;
    let limits = Limits { max_pairs: 1000, ..Limits::DEFAULT };
    for (way, complete) in [(way.with(|it| it.limits = limits), false), (way, true)] {
        let mut broad_phase = way.broad_phase();
        for (id, aabb) in boxes.iter().enumerate() {
            broad_phase.set(id as u32, *aabb, ProxyFilter::ALL).expect("a small id");
        }
        if !complete {
            assert_eq!(broad_phase.update(), Err(Error::TooManyPairs { limit: 1000 }), "{strategy}");
            assert_eq!(broad_phase.pair_count(), 0, "{strategy}");
            continue;
        }
        assert!(
            broad_phase.update().expect("the default limit").added.iter().copied().eq(all_pairs(n)),
            "{strategy}"
        );
        broad_phase.remove(n / 2);
        broad_phase.update().expect("fewer pairs");
        assert_eq!(broad_phase.pair_count() as u64, u64::from(n - 1) * u64::from(n - 2) / 2, "{strategy}");
        broad_phase.set(n / 2, boxes[0], ProxyFilter::ALL).expect("a small id");
        assert_eq!(broad_phase.update().expect("the default limit").added.len() as u32, n - 1, "{strategy}");
    }
}
