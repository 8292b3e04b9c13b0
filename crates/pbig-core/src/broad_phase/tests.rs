//! What is taken in: which boxes count, and when one has changed.

use super::BroadPhase;
use crate::{Aabb, Config, ProxyFilter};

const MARGIN: f32 = 0.1;

fn broad_phase() -> BroadPhase {
    BroadPhase::new(Config { margin: MARGIN, ..Config::DEFAULT }).expect("a margin")
}

fn cube() -> Aabb {
    Aabb::from_center([3.0, -2.0, 1.0], [0.5; 3])
}

/// The cube, one side of which has moved outward.
fn with_side(side: usize, by: f32) -> Aabb {
    let mut aabb = cube();
    if side < 3 {
        aabb.min[side] -= by;
    } else {
        aabb.max[side - 3] += by;
    }
    aabb
}

#[test]
fn a_box_has_changed_once_any_side_leaves_its_margin_or_has_shrunk_by_more() {
    for side in 0..6 {
        for (by, changes) in [(0.05, 0), (0.15, 1), (-0.05, 0), (-0.15, 1)] {
            let mut broad_phase = broad_phase();
            broad_phase.set(0, cube(), ProxyFilter::ALL).expect("a small id");
            broad_phase.update().expect("one box");
            broad_phase.set(0, with_side(side, by), ProxyFilter::ALL).expect("a small id");
            assert_eq!(broad_phase.changes().count(), changes, "side {side} by {by}");
        }
    }
}

#[test]
fn boxes_that_are_invalid_are_there_and_do_not_count_in_the_plan() {
    let mut broad_phase = broad_phase();
    for (id, aabb) in [cube(), Aabb::NOWHERE, cube()].into_iter().enumerate() {
        broad_phase.set(id as u32, aabb, ProxyFilter::ALL).expect("a small id");
    }
    broad_phase.update().expect("three boxes");
    let report = broad_phase.report();
    assert_eq!((report.boxes, report.invalid, report.plan.boxes), (3, 1, 2));
}
