//! Worlds that are flat, thin or on the borders of cells.

use super::everywhere;
use crate::follower::Follower;
use pbig_core::{Aabb, Algorithm, Config, Engine, Plan, ProxyFilter};
use pbig_harness::boxes::BoxSet;
use pbig_tests::shifted;

#[test]
fn flat_worlds_of_any_thickness_on_every_axis() {
    for axis in 0..3 {
        for thickness in [0.0, f32::from_bits(1), 0.5] {
            let place = |i: usize| {
                let (u, v) = ((i % 36) as f32 * 0.97, (i / 36) as f32 * 1.03);
                let mut at = [[u, v, 0.0], [u, 0.0, v], [0.0, u, v]][axis].map(|x| x - 17.0);
                at[2 - axis] = 3.0;
                at
            };
            let mut half = [0.5; 3];
            half[2 - axis] = thickness;
            let boxes: Vec<Aabb> = (0..1200).map(|i| Aabb::from_center(place(i), half)).collect();
            everywhere(&format!("flat, normal to axis {}, thickness {thickness}", 2 - axis), &boxes);
        }
    }
}

#[test]
fn linear_worlds_along_axes_and_diagonals() {
    for direction in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 1.0, 0.0], [1.0, -1.0, 1e-3]] {
        let on_line =
            |i: usize, half: [f32; 3]| Aabb::from_center(direction.map(|d| d * i as f32 * 0.7), half);
        let beads: Vec<Aabb> = (0..1100).map(|i| on_line(i, [0.5; 3])).collect();
        everywhere(&format!("beads along {direction:?}"), &beads);
        // Thin as the line itself: segments that touch end to end.
        let segments: Vec<Aabb> =
            (0..300).map(|i| on_line(i, direction.map(|d: f32| d.abs() * 0.35))).collect();
        everywhere(&format!("segments along {direction:?}"), &segments);
    }
}

#[test]
fn needles_a_billion_times_longer_than_thick() {
    let needle = |i: usize| {
        let mut half = [1e-4; 3];
        half[i % 3] = [1e5, 10.0, 1.0][i / 3 % 3];
        let at = [i * 17 % 23, i * 29 % 31, i * 7 % 19].map(|x| x as f32 * 0.05);
        Aabb::from_center(at, half)
    };
    everywhere("needles", &(0..1100).map(needle).collect::<Vec<_>>());
}

/// The box moved so that its lower or upper corner is on a border of a plan's cells, or one ulp beside it.
fn onto_border(aabb: &Aabb, plan: &Plan, i: usize) -> Aabb {
    let by = |k: usize| {
        let corner = if i.is_multiple_of(2) { aabb.min[k] } else { aabb.max[k] };
        let (start, cell) = (plan.origin[k], f64::from(plan.cell[k]));
        let border = (start + ((f64::from(corner) - start) / cell).round() * cell) as f32;
        [border, border.next_up(), border.next_down()][i / 2 % 3] - corner
    };
    shifted(aabb, std::array::from_fn(by))
}

fn on_border(aabb: &Aabb, plan: &Plan) -> bool {
    let beside = |x: f32, k: usize| {
        let place = (f64::from(x) - plan.origin[k]) / f64::from(plan.cell[k]);
        (place - place.round()).abs() < 1e-4
    };
    (0..3).all(|k| beside(aabb.min[k], k)) || (0..3).all(|k| beside(aabb.max[k], k))
}

/// Three heaps of cubes, each a hundred times larger than the one before.
fn heaps() -> Vec<Aabb> {
    let pile = BoxSet::named("pile").expect("the set exists");
    let heap = |(scale, at): (f32, f32)| {
        let there = move |x: f32| x * scale + at;
        pile.boxes(800, 2).into_iter().map(move |b| Aabb::new(b.min.map(there), b.max.map(there)))
    };
    [(0.01, 0.0), (1.0, 50.0), (100.0, 500.0)].into_iter().flat_map(heap).collect()
}

/// Few boxes change at a time, so that the plan stays.
#[test]
fn boxes_on_the_borders_of_the_cells_of_a_grid() {
    let start = heaps();
    let mut world = Follower::new(Config { engine: Some(Engine::Grid), ..Config::DEFAULT }, start.len());
    super::step(&mut world, &[], &start);
    world.update("the heaps");
    let (mut plan, mut on) = (world.broad_phase.report().plan.clone(), 0);
    for round in 0..12 {
        let moved = (round..start.len()).step_by(37);
        for i in moved.clone() {
            world.set(i as u32, onto_border(&start[i], &plan, i / 37 + round), ProxyFilter::ALL);
        }
        world.update(&format!("round {round}"));
        plan = world.broad_phase.report().plan.clone();
        assert_eq!(plan.algorithm, Algorithm::Grid);
        on += moved.filter(|&i| world.boxes[i].is_some_and(|(aabb, _)| on_border(&aabb, &plan))).count();
    }
    assert!(on > 200, "{on} boxes on borders");
}
