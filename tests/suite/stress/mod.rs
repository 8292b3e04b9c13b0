//! Numbers and worlds at which broad phases break, compared with the oracle: each through the finder on every backend, and
//! through updates with every engine. CONTRIBUTING.md lists the tests.

mod extremes;
mod fuzzed;
mod motion;
mod multitudes;
mod shapes;
mod soak;

use crate::finder::check;
use crate::follower::Follower;
use pbig_core::{Aabb, Backend, Config, ProxyFilter};
use pbig_tests::{Way, corpus, engines, gpu, may_run};

/// Tests a set through the finder, and through updates in which its boxes change places.
fn everywhere(name: &str, boxes: &[Aabb]) {
    check(name, boxes);
    through_updates(name, &shuffled(boxes));
}

/// Returns the ways to update: as the policy chooses, with each engine of the CPU, and with the grid of a GPU.
fn ways_to_update() -> Vec<(&'static str, Way)> {
    let mut ways = vec![("auto", Way::from(Config::DEFAULT))];
    ways.extend(engines());
    ways.push(("gpu grid", gpu()));
    ways.into_iter().filter(|(_, way)| may_run(way)).collect()
}

#[test]
fn the_corpus_through_updates() {
    corpus().iter().for_each(|case| through_updates(&case.name, &shuffled(&case.boxes)));
}

/// Plays the frames of a world one after the other. On the CPU also with a margin; on a GPU that would take too long.
fn through_updates(name: &str, frames: &[Vec<Aabb>]) {
    for (strategy, way) in ways_to_update() {
        let margins: &[f32] = if way.backend == Backend::Device { &[0.0] } else { &[0.0, 0.01] };
        for &margin in margins {
            let ids = frames.iter().map(Vec::len).max().unwrap_or(0);
            let mut world = Follower::new(way.with(|it| it.margin = margin), ids);
            play(&mut world, frames, &format!("{name}, {strategy}, margin {margin}"));
        }
    }
}

/// A box that stays is not set again.
fn play(world: &mut Follower, frames: &[Vec<Aabb>], what: &str) {
    let mut before: &[Aabb] = &[];
    for (number, frame) in frames.iter().enumerate() {
        step(world, before, frame);
        world.update(&format!("{what}, frame {number}"));
        before = frame;
    }
}

fn step(world: &mut Follower, before: &[Aabb], frame: &[Aabb]) {
    let bits = bytemuck::bytes_of::<Aabb>;
    for (id, aabb) in frame.iter().enumerate() {
        if before.get(id).is_none_or(|old| bits(old) != bits(aabb)) {
            world.set(id as u32, *aabb, ProxyFilter::ALL);
        }
    }
    (frame.len()..before.len()).for_each(|id| world.remove(id as u32));
}

/// Returns the boxes in other places: a few moved, all moved, a third gone, a few nowhere, all back.
fn shuffled(boxes: &[Aabb]) -> Vec<Vec<Aabb>> {
    let n = boxes.len();
    let of = |id: usize| boxes[id % n.max(1)];
    let few = (0..n).map(|id| if id % 11 == 0 { of(id * 7 + 3) } else { of(id) }).collect();
    let all = (0..n).map(|id| of(id + 1)).collect();
    let nowhere = (0..n).map(|id| if id % 13 == 0 { Aabb::NOWHERE } else { of(id) }).collect();
    vec![boxes.to_vec(), few, all, boxes[..n - n / 3].to_vec(), nowhere, boxes.to_vec()]
}

/// Every closed interval between two of these numbers, points included.
fn intervals(numbers: &[f32]) -> Vec<[f32; 2]> {
    let from = |i: usize| numbers[i..].iter().map(move |high| [numbers[i], *high]);
    (0..numbers.len()).flat_map(from).collect()
}

/// Every box of these intervals.
fn product(x: &[[f32; 2]], y: &[[f32; 2]], z: &[[f32; 2]]) -> Vec<Aabb> {
    let column =
        |x: [f32; 2], y: [f32; 2]| z.iter().map(move |z| Aabb::new([x[0], y[0], z[0]], [x[1], y[1], z[1]]));
    x.iter().flat_map(|x| y.iter().flat_map(move |y| column(*x, *y))).collect()
}
