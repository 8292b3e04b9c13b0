//! Worlds that move far.

use super::through_updates;
use pbig_core::{Aabb, Backend, BroadPhase, Config, ProxyFilter};
use pbig_tests::{set, shifted};

/// Ever faster, until the coordinates are infinite and then no numbers, and from the beginning again.
#[test]
fn a_fall_beyond_the_range_of_f32_and_back() {
    let start = set("pile", 150, 3);
    let mut frames = vec![start.clone()];
    for decade in 0..40 {
        // From 10^39 on this is infinite.
        let depth = 10f64.powi(decade) as f32;
        frames.push(frames[frames.len() - 1].iter().map(|b| shifted(b, [0.0, -depth, 0.0])).collect());
    }
    assert!(frames[40].iter().all(|b| b.max[1] == f32::NEG_INFINITY));
    frames.push(vec![Aabb::NOWHERE; 150]);
    frames.push(start);
    through_updates("beyond the range", &frames);
}

/// One of many flies off each frame, and the others stay: no resolution is lost to those that have gone.
#[test]
fn debris_that_leaves_for_ever_does_not_cost_those_that_stay() {
    let heap = set("pile", 3000, 9);
    let mut broad_phase =
        BroadPhase::new(Config { backend: Backend::Cpu, ..Config::DEFAULT }).expect("a margin");
    let mut most = 0;
    for frame in 0..300 {
        for (id, aabb) in heap.iter().enumerate() {
            let flown = if id % 50 == 0 && id / 10 < frame { 10f32.powi((frame / 8) as i32) } else { 0.0 };
            let there = shifted(aabb, [flown, -flown * 0.5, flown * (id as f32 / 3000.0)]);
            broad_phase.set(id as u32, there, ProxyFilter::ALL).expect("a small id");
        }
        broad_phase.update().expect("few pairs");
        most = if frame > 0 { broad_phase.report().checks.made.max(most) } else { 0 };
    }
    assert!(most > 0 && most < 60 * 3000, "{most} checks in an update");
}
