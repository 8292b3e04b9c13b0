use super::*;
use crate::cpu::record::Item;

/// By the costs of the reference: by those measured here, ways that are close to each other may change places.
const CONFIG: Config = Config { costs: Some(Costs::REFERENCE), ..Config::DEFAULT };

/// Builds in one call: how often the boxes were sorted.
fn builds(map: &mut Map<Item>, boxes: &[Aabb]) -> usize {
    builds_filtered(map, boxes, None)
}

fn builds_filtered(map: &mut Map<Item>, boxes: &[Aabb], filters: Option<&[ProxyFilter]>) -> usize {
    let summary = LazySummary::new(boxes, None);
    let before = map.builds;
    let set = Set { boxes, filters, summary: &summary, before: &[] };
    map.plan_and_build(&set, &CONFIG, &mut StageTimes::default());
    map.builds - before
}

fn lattice(side: usize, step: f32, half: f32, at: f32) -> Vec<Aabb> {
    let corner = |i: usize| [i % side, i / side % side, i / side / side].map(|c| c as f32 * step + at);
    (0..side.pow(3)).map(|i| Aabb::from_center(corner(i), [half; 3])).collect()
}

#[test]
fn cells_that_were_divided_for_clusters_stay_so() {
    for apart in [3e3, 1e4, 1e5, 1e7] {
        let mut boxes = lattice(12, 1.02, 0.5, 0.0);
        boxes.extend(lattice(12, 1.02, 0.5, apart));
        let mut map = Map::new();
        let calls: Vec<usize> = (0..5).map(|_| builds(&mut map, &boxes)).collect();
        assert!(calls[0] > 1 && calls[0] < 16, "{apart}: {calls:?}");
        assert_eq!(calls[1..], [1; 4], "{apart}");
    }
}

#[test]
fn boxes_that_no_cell_can_part_do_not_ruin_the_cells_of_the_others() {
    let mut boxes = lattice(20, 1.0, 0.0, 0.0);
    boxes.extend(vec![Aabb::from_center([5.5; 3], [0.0; 3]); 2000]);
    let mut map = Map::new();
    let calls: Vec<usize> = (0..4).map(|_| builds(&mut map, &boxes)).collect();
    assert_eq!(calls[1..], [1; 3], "{calls:?}");
    assert!(map.crowding.factor > 0.2, "{:?}", map.crowding);
    let even = lattice(20, 1.0, 0.3, 0.0);
    for _ in 0..8 {
        builds(&mut map, &even);
    }
    assert_eq!(map.crowding.factor, 1.0, "an even world gets its cells back");
}

#[test]
fn a_crowd_of_small_boxes_among_large_ones_gets_a_level_of_its_own() {
    let mut boxes = lattice(10, 10.0, 5.0, 0.0);
    boxes.extend(lattice(20, 0.1, 0.0005, 0.0));
    let mut map = Map::new();
    let calls: Vec<usize> = (0..4).map(|_| builds(&mut map, &boxes)).collect();
    assert!(map.levels.len() > 1 && map.crowd() < CROWDED, "{} levels, {}", map.levels.len(), map.crowd());
    assert_eq!(calls[1..], [1; 3], "{calls:?}");
}

/// Cubes whose edges differ up to 500 times, few of them large, at pseudorandom places: so close that cells which
/// hold the largest are fuller than others would be in a crowd. On each axis the mean of so many numbers is taken.
fn of_many_sizes(n: u32, side: f32, of_mean: u32) -> Vec<Aabb> {
    let mut state = 1_u32;
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1 << 24) as f32
    };
    let edge = |random: f32| 500_f32.powf(random - 0.5);
    let mut cube = |_| {
        let center = [0; 3].map(|_| side / of_mean as f32 * (0..of_mean).map(|_| random()).sum::<f32>());
        Aabb::from_center(center, [edge(random()) / 2.0; 3])
    };
    (0..n).map(&mut cube).collect()
}

#[test]
fn a_crowd_that_the_plan_has_counted_on_is_none() {
    // Cells of a third of the world and of a sixth; and in a cloud with a dense middle.
    for (n, side, of_mean) in [(4000, 60.0, 1), (32_000, 120.0, 1), (32_000, 240.0, 4)] {
        let boxes = of_many_sizes(n, side, of_mean);
        let plan = Plan::new(&Summary::of(&boxes, None), &CONFIG, 1.0);
        let mut map = Map::new();
        let calls: Vec<usize> = (0..3).map(|_| builds(&mut map, &boxes)).collect();
        let levels = (plan.levels.len(), map.levels.len());
        assert_eq!((levels, &calls[..]), ((1, 1), &[1; 3][..]), "{n} in {side}");
        assert!(map.crowd() > 1.2 * CROWDED, "{}", map.crowd());
    }
}

#[test]
fn camps_stay_while_the_crowd_does_and_no_longer() {
    for (bodies, each) in [(1, 60), (3, 18), (4, 14), (6, 9), (6, 20), (7, 40)] {
        let places = lattice(5, 1.0, 0.45, 0.0);
        let mut boxes = Vec::new();
        let mut filters = Vec::new();
        for body in 0..bodies {
            boxes.extend((0..each).flat_map(|_| places.iter().copied()));
            filters.resize(boxes.len(), ProxyFilter { body, ..ProxyFilter::ALL });
        }
        let mut map = Map::new();
        let calls: Vec<usize> = (0..5).map(|_| builds_filtered(&mut map, &boxes, Some(&filters))).collect();
        assert_eq!(
            (map.has_camps(), &calls[1..]),
            (true, &[1; 4][..]),
            "{bodies} bodies of {each}: {calls:?}"
        );
        let even = lattice(9, 1.0, 0.3, 0.0);
        let after: Vec<usize> =
            (0..3).map(|_| builds_filtered(&mut map, &even, Some(&filters[..even.len()]))).collect();
        assert_eq!((map.has_camps(), after[2]), (false, 1), "{bodies} bodies of {each}: {after:?}");
    }
}
