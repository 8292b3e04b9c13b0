//! Crowds of boxes that may not pair with each other: no pair is missed, and they cost nearly nothing.

use crate::follower::Follower;
use pbig_core::{Aabb, Config, Finder, ProxyFilter, oracle};
use pbig_tests::strategies;
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

const ALL: ProxyFilter = ProxyFilter::ALL;
const FIXED: ProxyFilter = ProxyFilter { kind: 2, accepted_kinds: 1, ..ALL };
const MOVING: ProxyFilter = ProxyFilter { accepted_kinds: 3, ..ALL };
/// Meets everything but its like.
const DEBRIS: ProxyFilter = ProxyFilter { memberships: 2, mask: !2, ..MOVING };

/// A box of about edge 1, or a large one, near one of few places.
fn crowded(random: &mut StdRng) -> Aabb {
    let place = random.random_range(0..3) as f32 * 50.0;
    let half = [0.5, 0.5, 0.5, 0.4, 0.03, 20.0, f32::INFINITY][random.random_range(0..7usize).min(6)];
    Aabb::from_center(std::array::from_fn(|_| place + random.random_range(-0.4..0.4)), [half; 3])
}

fn filter(random: &mut StdRng, share: u32) -> ProxyFilter {
    match random.random_range(0..10) {
        n if n < share => DEBRIS,
        n if n < share + 2 => FIXED,
        n if n < share + 3 => ProxyFilter { body: 3 + n % 2, ..MOVING },
        n => ProxyFilter { body: if n == 9 { 1 } else { random.random_range(10..200) }, ..MOVING },
    }
}

#[test]
fn crowds_that_change_sides_agree_with_the_oracle_on_every_strategy() {
    for (strategy, config) in strategies() {
        for seed in 0..8 {
            let (mut random, ids) = (StdRng::seed_from_u64(seed), [150, 400][seed as usize % 2]);
            let mut world = Follower::new(Config { margin: 0.01, ..config }, ids);
            for round in 0..12u32 {
                let changes = if round % 4 == 0 { ids } else { ids / 12 };
                // First most are debris, then few, then most again: camps come and go.
                let share = [6, 0, 5][round as usize / 4];
                for i in 0..changes {
                    let id = if changes == ids { i as u32 } else { random.random_range(0..ids as u32) };
                    match random.random_range(0..9) {
                        0 => world.remove(id),
                        _ => world.set(id, crowded(&mut random), filter(&mut random, share)),
                    }
                }
                world.update(&format!("{strategy}, seed {seed}, round {round}"));
            }
        }
    }
}

/// Boxes at one place by filter.
fn crowd(parts: &[(ProxyFilter, usize)]) -> (Vec<Aabb>, Vec<ProxyFilter>) {
    let filters: Vec<ProxyFilter> = parts.iter().flat_map(|(one, count)| vec![*one; *count]).collect();
    (vec![Aabb::from_center([1.0; 3], [0.5; 3]); filters.len()], filters)
}

#[test]
fn a_crowd_that_excludes_itself_costs_nearly_nothing() {
    let body = |body: u32| ProxyFilter { body, ..MOVING };
    let ground = Aabb::new([-1e3, -1.0, -1e3], [1e3, 0.6, 1e3]);
    for (what, parts, pairs) in [
        ("debris and a ground", &[(DEBRIS, 3000)][..], 3000),
        ("fixed bodies and a ground", &[(FIXED, 3000)], 0),
        ("one body", &[(body(4), 3000)], 3000),
        (
            "three bodies and debris",
            &[(body(4), 100), (DEBRIS, 3000), (body(5), 70)],
            3170 + 3000 * 170 + 7000,
        ),
    ] {
        let (mut boxes, mut filters) = crowd(parts);
        boxes.push(ground);
        filters.push(FIXED);
        let mut finder = Finder::default();
        let found = finder.find_filtered(&boxes, &filters).expect("within the limits").to_vec();
        assert_eq!(found.len(), pairs, "{what}");
        assert!(found == oracle::pairs_filtered(&boxes, &filters), "{what}");
        let (checks, plan) = (finder.report().checks.made, &finder.report().plan);
        assert!(checks <= 4 * pairs as u64 + 8000, "{what}: {checks} checks for {pairs} pairs: {plan}");
    }
}

#[test]
fn one_that_moves_in_a_crowd_that_excludes_it_is_tested_against_the_others_only() {
    let mut world = Follower::new(Config { margin: 0.01, ..Config::DEFAULT }, 2002);
    let at = |x: f32| Aabb::from_center([x, 0.0, 0.0], [0.5; 3]);
    for id in 0..2000 {
        world.set(id, at(0.0), DEBRIS);
    }
    world.set(2000, at(0.9), MOVING);
    world.set(2001, at(0.0), DEBRIS);
    world.update("all new");
    let mut moved_checks = |x: f32, filter: ProxyFilter| {
        world.set(2001, at(x), filter);
        world.update("one moved");
        world.broad_phase.report().checks.made
    };
    assert!(moved_checks(0.1, DEBRIS) < 10);
    assert!(moved_checks(0.2, DEBRIS) < 10);
    assert!(moved_checks(0.2, MOVING) >= 2000, "it has changed sides: all are to be met");
    assert!(moved_checks(0.3, DEBRIS) < 10, "and back");
}

/// Two towns far apart, each 1000 places with `fixed` fixed pieces and a moving ball in each.
fn towns(fixed: usize) -> (Vec<Aabb>, Vec<ProxyFilter>) {
    let (mut boxes, mut filters) = (Vec::new(), Vec::new());
    for (town, i) in [0.0, 3000.0].into_iter().flat_map(|town| (0..1000).map(move |i| (town, i))) {
        let corner = [i % 10, i / 10 % 10, i / 100].map(|x| x as f32 + town);
        for piece in 0..fixed {
            boxes.push(Aabb::from_center(corner.map(|x| x + 0.002 * piece as f32), [0.45; 3]));
            filters.push(FIXED);
        }
        boxes.push(Aabb::from_center(corner.map(|x| x + 0.3), [0.3; 3]));
        filters.push(MOVING);
    }
    (boxes, filters)
}

#[test]
fn camps_in_clusters_far_apart_get_cells_as_small_as_others() {
    for fixed in [8, 16, 40, 80] {
        let (boxes, filters) = towns(fixed);
        let mut finder = Finder::default();
        let mut checks = Vec::new();
        for _ in 0..3 {
            finder.find_filtered(&boxes, &filters).expect("within the limits");
            checks.push(finder.report().checks.made);
        }
        // Forty and more pieces in a place are a camp, which balls alone search.
        let report = finder.report();
        let most = if fixed < 40 { 10 * (boxes.len() * fixed) as u64 } else { 6 * report.pairs };
        assert!(checks.iter().all(|made| *made < most), "{fixed}: {checks:?}, {most}: {}", report.plan);
    }
}
