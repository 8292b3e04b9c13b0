//! Crowds of boxes that may not pair with each other, and clusters far apart: no pair is missed.

use crate::follower::Follower;
use pbig_core::{Aabb, Finder, ProxyFilter, oracle};
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
fn crowds_that_change_sides_agree_on_every_strategy() {
    for (strategy, way) in strategies() {
        for seed in 0..8 {
            let (mut random, ids) = (StdRng::seed_from_u64(seed), [150, 400][seed as usize % 2]);
            let mut world = Follower::new(way.with(|it| it.margin = 0.01), ids);
            for round in 0..12u32 {
                let changes = if round % 4 == 0 { ids } else { ids / 12 };
                // First most are debris, then few, then most again.
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
fn crowds_that_exclude_themselves_agree_with_the_oracle() {
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
    }
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
fn clusters_far_apart_get_cells_as_small_as_others() {
    for fixed in [8, 16, 40] {
        let (boxes, filters) = towns(fixed);
        let mut finder = Finder::default();
        finder.find_filtered(&boxes, &filters).expect("within the limits");
        let report = finder.report();
        let most = 10 * (boxes.len() * fixed) as u64;
        assert!(report.checks.made < most, "{fixed}: {} of {most}: {}", report.checks.made, report.plan);
    }
}
