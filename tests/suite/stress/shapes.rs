//! Boxes on the borders of cells.

use crate::follower::Follower;
use pbig_core::{Aabb, Algorithm, Config, Engine, Plan, ProxyFilter};
use pbig_harness::boxes::BoxSet;
use pbig_tests::shifted;

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
