//! Numbers: sizes and offsets by decades, the smallest, the largest, both zeros, infinities, no numbers.

use super::{everywhere, intervals, product, through_updates};
use crate::follower::Follower;
use pbig_core::{Aabb, ProxyFilter};
use pbig_tests::{set, shifted, strategies};

const INFINITY: f32 = f32::INFINITY;
const SMALLEST: f32 = f32::from_bits(1);

fn pile(n: usize) -> Vec<Aabb> {
    set("pile", n, 1)
}

#[test]
fn offsets_from_one_to_1e30_each_alone_and_all_at_once() {
    let near = pile(60);
    let mut all = vec![];
    for decade in (0..=30).step_by(3) {
        let offset = 10f32.powi(decade);
        // As large as a few ulps at least, or a box would be a point.
        let scale = (offset * 1e-6).max(1.0);
        let grown = |b: &Aabb| Aabb::new(b.min.map(|x| x * scale), b.max.map(|x| x * scale));
        let there: Vec<Aabb> = near.iter().map(|b| shifted(&grown(b), [offset, -offset, offset])).collect();
        everywhere(&format!("at 1e{decade}"), &there);
        all.extend(there);
    }
    everywhere("at all offsets", &all);
}

/// Every box between two of some numbers on one axis, and of fewer on the others: alone, and some of them among small ones.
#[test]
fn boxes_between_special_numbers() {
    let half_space = |far: f32| vec![-far, 2.0, 2.0f32.next_up(), far];
    let half = 0.5 * f32::MAX;
    for (name, numbers, few) in [
        ("denormals", vec![-1.0, -SMALLEST, 0.0, SMALLEST, f32::MIN_POSITIVE], vec![0.0, SMALLEST]),
        ("zeros", vec![-1.0, -SMALLEST, -0.0, 0.0, -0.0, 1.0], vec![-0.0, 0.0, -0.0]),
        ("largest", vec![-f32::MAX, (-f32::MAX).next_up(), 1.0, f32::MAX], vec![-f32::MAX, 0.0, f32::MAX]),
        ("infinities", vec![-INFINITY, -f32::MAX, 0.0, 1.0, INFINITY], vec![-INFINITY, 0.5, INFINITY]),
        ("half of the largest", half_space(half), vec![-half, half]),
        ("half-spaces to the largest", half_space(f32::MAX), vec![-f32::MAX, f32::MAX]),
        ("half-spaces", half_space(INFINITY), vec![-INFINITY, INFINITY]),
    ] {
        let few = intervals(&few);
        let boxes = product(&intervals(&numbers), &few, &few);
        everywhere(name, &boxes);
        let some: Vec<Aabb> = boxes.into_iter().step_by(11).collect();
        everywhere(&format!("{name} among small ones"), &[&pile(300)[..], &some].concat());
    }
}

/// Which of its six numbers are spoiled: a bit each.
fn spoiled(aabb: &Aabb, which: usize, with: impl Fn(f32) -> f32) -> Aabb {
    let mut numbers: [f32; 6] = bytemuck::cast(*aabb);
    for (k, number) in numbers.iter_mut().enumerate() {
        *number = if which >> k & 1 == 1 { with(*number) } else { *number };
    }
    bytemuck::cast(numbers)
}

/// Spoiled when it comes, while it moves, twice, when its filter changes, when it is removed and comes back in one update,
/// and between the two halves of an update.
#[test]
fn no_number_in_any_field_at_any_time() {
    for (strategy, way) in strategies() {
        // Each field, each axis, and all.
        for which in [1, 2, 4, 8, 16, 32, 9, 18, 36, 63] {
            let world = Follower::new(way.with(|it| it.margin = 0.01), 60);
            spoil_at_all_times(world, which, &format!("{strategy}, NaN in {which:06b}"));
        }
    }
}

fn spoil_at_all_times(mut world: Follower, which: usize, what: &str) {
    let boxes = pile(60);
    let bad = |id: usize| spoiled(&boxes[id], which, |_| f32::NAN);
    let one_body = ProxyFilter { body: 4, ..ProxyFilter::ALL };
    for (id, aabb) in boxes.iter().enumerate() {
        world.set(id as u32, if id % 5 == 0 { bad(id) } else { *aabb }, ProxyFilter::ALL);
    }
    world.update(&format!("{what}, at first"));
    for round in 0..5 {
        for id in (round..60).step_by(4) {
            let spoil = (id + round) % 3 != 0;
            match round {
                2 => world.remove(id as u32),
                _ => world.set(id as u32, boxes[id], one_body),
            }
            let filter = if id % 2 == 0 { ProxyFilter::ALL } else { one_body };
            world.set(id as u32, if spoil { bad(id) } else { boxes[id] }, filter);
        }
        world.update(&format!("{what}, round {round}"));
    }
    boxes.iter().enumerate().for_each(|(id, aabb)| world.set(id as u32, *aabb, ProxyFilter::ALL));
    world.update(&format!("{what}, mended"));
}

#[test]
fn inverted_boxes_on_any_axes_by_much_or_by_one_ulp() {
    let boxes = pile(120);
    let inverted = |b: &Aabb, axes: usize, by_an_ulp: bool| {
        let mut bad = *b;
        for k in (0..3).filter(|k| axes >> k & 1 == 1) {
            (bad.min[k], bad.max[k]) = (b.max[k], if by_an_ulp { b.max[k].next_down() } else { b.min[k] });
        }
        bad
    };
    for by_an_ulp in [false, true] {
        let bad: Vec<Aabb> = boxes
            .iter()
            .enumerate()
            .map(|(i, b)| inverted(b, if i % 3 == 0 { i / 3 % 8 } else { 0 }, by_an_ulp))
            .collect();
        assert!(bad.iter().filter(|b| !b.is_valid()).count() == 35);
        everywhere("inverted", &bad);
        // There and back: an inverted box was a good one, and is again.
        through_updates(
            "inverted and mended",
            &[boxes.clone(), bad.clone(), boxes.clone(), bad, boxes.clone()],
        );
    }
}
