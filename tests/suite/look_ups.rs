//! Few boxes of many change: look-ups, shared by threads, against the oracle.

use crate::follower::Follower;
use pbig_core::{Aabb, Algorithm, Config, Error, Limits, Pair, ProxyFilter};
use pbig_tests::{on_threads, set, shifted};

const BOXES: usize = 20_000;

/// Boxes that change in a round: enough for threads to share look-ups.
const CHANGED: usize = 1500;

/// A limit below the pairs of all boxes in one place.
const LIMIT: u64 = 300_000;

/// Pairs with nothing.
const LONE: ProxyFilter = ProxyFilter { memberships: 0, mask: 0, ..ProxyFilter::ALL };

/// Updates and compares; returns the number of pairs that ended although their boxes overlap.
fn check(world: &mut Follower, what: &str) -> usize {
    world.update(what);
    let overlap = |pair: &&Pair| {
        let [a, b] = [pair.a, pair.b].map(|id| world.boxes[id as usize]);
        a.zip(b).is_some_and(|((a, _), (b, _))| a.overlaps(&b))
    };
    world.broad_phase.events().removed.iter().filter(overlap).count()
}

/// In each round some boxes move to and fro, and some come, go, or get another filter.
fn change(world: &mut Follower, round: usize) {
    let first = round * CHANGED * 3 / 5;
    for k in 0..CHANGED {
        let id = ((first + k * 19) % BOXES) as u32;
        let by = if round.is_multiple_of(2) { 0.03 } else { -0.03 };
        match (valid(world, id), k % 100) {
            (Some(_), 0) => world.remove(id),
            (Some(_), 1) => world.set(id, Aabb::NOWHERE, ProxyFilter::ALL),
            (Some((aabb, _)), 2) => world.set(id, aabb, LONE),
            (Some((aabb, filter)), _) => world.set(id, shifted(&aabb, [by; 3]), filter),
            (None, _) => world.set(id, Aabb::from_center([k as f32 % 20.0; 3], [0.5; 3]), ProxyFilter::ALL),
        }
    }
}

fn valid(world: &Follower, id: u32) -> Option<(Aabb, ProxyFilter)> {
    world.boxes[id as usize].filter(|(aabb, _)| aabb.is_valid())
}

/// Too many boxes in one place, which is an error; later elsewhere, some of them gone or with another filter.
fn crowd_and_part(world: &mut Follower) {
    let places = (0..CHANGED as u32).filter_map(|id| Some((id, valid(world, id)?.0)));
    let places: Vec<(u32, Aabb)> = places.collect();
    for &(id, _) in &places {
        world.set(id, Aabb::from_center([10.0; 3], [0.5; 3]), ProxyFilter::ALL);
    }
    let error = world.broad_phase.update().expect_err("half a million pairs");
    assert!(matches!(error, Error::TooManyPairs { limit: LIMIT }), "{error}");
    for (id, place) in &places {
        world.set(*id, shifted(place, [0.4; 3]), ProxyFilter::ALL);
    }
    world.remove(5);
    let aabb = world.boxes[6].map_or(Aabb::NOWHERE, |(aabb, _)| aabb);
    world.set(6, aabb, LONE);
}

fn rounds() {
    let limits = Limits { max_pairs: LIMIT, ..Limits::DEFAULT };
    let mut world = Follower::new(Config { limits, ..Config::DEFAULT }, BOXES);
    (0..).zip(set("pile", BOXES, 3)).for_each(|(id, aabb)| world.set(id, aabb, ProxyFilter::ALL));
    check(&mut world, "the first");
    let (mut look_ups, mut parted) = (0, 0);
    for round in 0..12 {
        change(&mut world, round);
        parted += check(&mut world, &format!("round {round}"));
        look_ups += usize::from(world.broad_phase.report().plan.algorithm == Algorithm::LookUp);
    }
    crowd_and_part(&mut world);
    check(&mut world, "after an error");
    assert_eq!(world.broad_phase.report().plan.algorithm, Algorithm::Grid, "all are searched again");
    assert!(!world.broad_phase.events().removed.is_empty());
    change(&mut world, 13);
    parted += check(&mut world, "the last");
    assert!(look_ups >= 12 && parted > 100, "{look_ups} look-ups, {parted} parted");
}

#[test]
fn look_ups_make_the_events_of_a_full_search_on_any_threads() {
    rounds();
    [1, 2, 3, 16].into_iter().for_each(|threads| on_threads(threads, rounds));
}
