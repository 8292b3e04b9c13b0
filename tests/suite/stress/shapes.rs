//! Worlds that are flat, thin or on the borders of cells.

use super::everywhere;
use crate::follower::Follower;
use pbig_core::{Aabb, Algorithm, Config, Engine, Finder, Plan, ProxyFilter};
use pbig_harness::boxes::BoxSet;
use pbig_tests::{Way, shifted, strategies};

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

/// The boxes, every other one of them moved onto a border of the cells that the plan for them has. Cells follow the
/// boxes, so none leaves the space that all have, and it is tried again until they stay.
fn on_borders(start: &[Aabb]) -> (Vec<Aabb>, usize) {
    let (mut boxes, mut best) = (start.to_vec(), (start.to_vec(), 0));
    let space = start.iter().fold(Aabb::NOWHERE, |all, aabb| all.union(aabb));
    for _ in 0..8 {
        let mut finder = Finder::new(pbig_tests::grid());
        finder.find(&boxes).expect("few pairs");
        let plan = finder.report().plan.clone();
        let on = boxes.iter().filter(|aabb| on_border(aabb, &plan)).count();
        best = if on > best.1 { (boxes, on) } else { best };
        let put = |(i, aabb): (usize, &Aabb)| {
            let there = onto_border(aabb, &plan, i / 2);
            if i % 2 == 1 && space.contains(&there) { there } else { *aabb }
        };
        boxes = start.iter().enumerate().map(put).collect();
    }
    best
}

#[test]
fn boxes_on_the_borders_of_the_cells_that_are_planned_for_them() {
    for (name, start) in [("heaps", heaps()), ("one heap", heaps()[800..1600].to_vec())] {
        let (boxes, on) = on_borders(&start);
        println!("{name}: {on} boxes on borders");
        assert!(on > 100, "{name}: only {on} of {} boxes are on borders", boxes.len());
        for (strategy, way) in strategies().into_iter().filter(|(name, _)| !name.starts_with("gpu")) {
            everywhere_on(way, strategy, &boxes);
        }
    }
}

/// Few boxes at a time, so that the grid that is there stays: on the borders of its cells.
#[test]
fn boxes_on_the_borders_of_the_cells_of_an_edited_grid() {
    let start = heaps();
    let config = Config { engine: Some(Engine::Edit), ..Config::DEFAULT };
    let mut world = Follower::new(config, start.len());
    super::step(&mut world, &[], &start);
    world.update("the heaps");
    let (mut edits, mut on) = (0, 0);
    for round in 0..12 {
        let plan = world.broad_phase.report().plan.clone();
        for i in (round..start.len()).step_by(37) {
            let aabb = onto_border(&start[i], &plan, i / 37 + round);
            world.set(i as u32, aabb, ProxyFilter::ALL);
            on += usize::from(on_border(&aabb, &plan));
        }
        world.update(&format!("round {round}"));
        edits += usize::from(world.broad_phase.report().plan.algorithm == Algorithm::Edit);
    }
    assert!(edits == 12 && on > 200, "{edits} edits, {on} boxes on borders");
}

/// What lies on the borders of one strategy's cells is of no special place to another.
fn everywhere_on(way: Way, strategy: &str, boxes: &[Aabb]) {
    crate::finder::check_on(vec![(strategy, way)], "on borders", boxes);
    let mut world = Follower::new(way, boxes.len());
    super::play(&mut world, &super::shuffled(boxes), &format!("on borders, {strategy}"));
}
