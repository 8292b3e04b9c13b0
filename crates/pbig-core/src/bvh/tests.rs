//! The index gives the answers of a scan of all boxes, after all kinds of changes, and looks at few boxes.

mod instructions;
mod room;

use super::{BoxIndex, LANES, NONE};
use crate::fixtures::{cube, random_point};
use crate::{Aabb, Config, Engine, Finder};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

fn random_box(rng: &mut StdRng, reach: f32) -> Aabb {
    let half = match rng.random_range(0..20) {
        0 => return Aabb::NOWHERE,
        1 => [reach, 0.1, reach],
        2 => [f32::INFINITY, 0.1, f32::INFINITY],
        _ => random_point(rng, 0.0..0.6),
    };
    Aabb::from_center(random_point(rng, -reach..reach), half)
}

/// Returns the times at which a box meets another one that stays, in f64; none if it never does before `max_time`.
fn meets(start: &Aabb, velocity: [f32; 3], max_time: f32, other: &Aabb) -> Option<f64> {
    let (mut enter, mut leave) = (0.0f64, f64::from(max_time));
    for k in 0..3 {
        let [low, high, min, max] = [start.min[k], start.max[k], other.min[k], other.max[k]].map(f64::from);
        let v = f64::from(velocity[k]);
        if v == 0.0 {
            if !(low <= max && min <= high) {
                return None;
            }
            continue;
        }
        let (a, b) = ((min - high) / v, (max - low) / v);
        enter = enter.max(a.min(b));
        leave = leave.min(a.max(b));
    }
    (other.is_valid() && enter <= leave).then_some(enter)
}

fn distance(point: [f32; 3], other: &Aabb) -> f64 {
    let gap = |k: usize| f64::from(other.min[k] - point[k]).max(f64::from(point[k] - other.max[k])).max(0.0);
    if other.is_valid() { (0..3).map(|k| gap(k).powi(2)).sum::<f64>().sqrt() } else { f64::INFINITY }
}

/// Returns the boxes that a cast meets, in the order of the visits.
fn met(index: &BoxIndex, start: &Aabb, velocity: [f32; 3], max_time: f32) -> Vec<u32> {
    let mut found = Vec::new();
    index.cast_aabb(start, velocity, max_time, |id| {
        found.push(id);
        max_time
    });
    found
}

/// Returns the boxes that overlap one, sorted.
fn overlapping(index: &BoxIndex, aabb: &Aabb) -> Vec<u32> {
    let mut met = vec![];
    index.overlapping(aabb, |id| met.push(id));
    met.sort_unstable();
    met
}

/// Asks one query of each kind, and compares with a scan.
fn check(index: &BoxIndex, boxes: &[Aabb], rng: &mut StdRng, reach: f32) {
    let half = [0.0, 0.3];
    let start =
        Aabb::from_center(random_point(rng, -reach..reach), [0; 3].map(|_| half[rng.random_range(0..2)]));
    let velocity =
        [0.0; 3].map(|_: f32| if rng.random_range(0..3) == 0 { 0.0 } else { rng.random_range(-1.0..1.0) });
    let max_time = [0.0, 5.0, f32::MAX, f32::INFINITY][rng.random_range(0..4)];
    let times: Vec<Option<f64>> =
        boxes.iter().map(|other| meets(&start, velocity, max_time, other)).collect();
    let wanted = (0..boxes.len()).filter(|&i| times[i].is_some());
    compare(met(index, &start, velocity, max_time), wanted, |i| {
        meets(&start.inflated(1e-3), velocity, max_time * 1.001, &boxes[i]).is_some()
    });

    let mut first = f64::INFINITY;
    index.cast_aabb(&start, velocity, max_time, |id| {
        first = times[id as usize].map_or(first, |time| time.min(first));
        max_time.min(first as f32)
    });
    let wanted = times.iter().flatten().copied().fold(f64::INFINITY, f64::min);
    assert_eq!(first, wanted, "the first box met");

    let (point, within) = (start.min, rng.random_range(0.0..4.0f32));
    let mut found = Vec::new();
    index.near(point, within, |id| {
        found.push(id);
        within
    });
    let is_near = |i: usize, factor: f64| distance(point, &boxes[i]) <= f64::from(within) * factor;
    compare(found, (0..boxes.len()).filter(|&i| is_near(i, 1.0)), |i| is_near(i, 1.001));
}

/// Each box has one place, each node's bounds are around its boxes, and free lanes are counted.
fn check_form(index: &BoxIndex, boxes: &[Aabb]) {
    let mut placed = 0;
    for (at, node) in index.nodes.iter().enumerate() {
        let free = node.children.iter().filter(|child| **child == NONE).count();
        let is_leaf = index.is_leaf(at as u32);
        let has_room = |child: &&u32| **child != NONE && index.room[**child as usize] > 0;
        let room = if is_leaf { free } else { node.children.iter().filter(has_room).count() };
        assert_eq!(usize::from(index.room[at]), room, "node {at}");
        for (lane, &child) in node.children.iter().enumerate().filter(|(_, child)| **child != NONE) {
            let inner = if is_leaf { boxes[child as usize] } else { index.bounds[child as usize] };
            if is_leaf {
                assert_eq!(index.places[child as usize] as usize, at * LANES + lane);
                placed += usize::from(inner.is_valid());
            } else {
                assert_eq!(index.parents[child as usize] as usize, at * LANES + lane);
            }
            if inner.is_valid() {
                assert!(
                    node.get(lane) == inner && index.bounds[at].union(&inner) == index.bounds[at],
                    "node {at}"
                );
            }
        }
    }
    assert_eq!(placed, boxes.iter().filter(|aabb| aabb.is_valid()).count());
}

/// All wanted boxes were found, each once, and besides only such as `may_be`.
fn compare(mut found: Vec<u32>, wanted: impl Iterator<Item = usize>, may_be: impl Fn(usize) -> bool) {
    found.sort_unstable();
    assert!(found.windows(2).all(|two| two[0] < two[1]), "a box was visited twice");
    for id in wanted {
        assert!(found.binary_search(&(id as u32)).is_ok(), "box {id} was missed");
    }
    assert!(found.iter().all(|&id| may_be(id as usize)), "a box far away was visited");
}

#[test]
fn answers_equal_a_scan_through_any_history() {
    for (seed, n) in [(1, 1), (2, 7), (3, 9), (4, 70), (5, 600), (6, 3000)] {
        let (mut rng, mut index) = (StdRng::seed_from_u64(seed), BoxIndex::default());
        let mut boxes: Vec<Aabb> = (0..n).map(|_| random_box(&mut rng, 10.0)).collect();
        index.refresh(&boxes, None);
        let (mut sorts, mut loose) = (0, 0);
        for round in 0..60 {
            let count = [1, 1 + n / 40, n][round % 3];
            let mut changed: Vec<u32> = (0..count).map(|_| rng.random_range(0..boxes.len() as u32)).collect();
            changed.iter().for_each(|&id| boxes[id as usize] = random_box(&mut rng, 10.0));
            for _ in 0..rng.random_range(0..1 + n / 20) {
                changed.push(boxes.len() as u32);
                boxes.push(random_box(&mut rng, 10.0));
            }
            index.refresh(&boxes, (round % 2 == 0).then_some(&changed[..]));
            loose += index.loose().len();
            check_form(&index, &boxes);
            (0..20).for_each(|_| check(&index, &boxes, &mut rng, 12.0));
            if round % 7 == 0 {
                index.sort(&boxes);
                sorts += 1;
            } else if round % 7 == 3 {
                index.refresh_present(&boxes, None, 0..boxes.len() as u32, true);
            }
        }
        assert!(sorts > 5 && (loose > 0 || n < 100), "{n} boxes: {sorts} sorts, {loose} loose leaves");
    }
}

/// After a visit returned 0, boxes at the start with lower ids are visited, and no others; after a negative number none.
#[test]
fn after_a_box_at_the_start_only_lower_ids_there_are_visited() {
    let mut rng = StdRng::seed_from_u64(5);
    let boxes: Vec<Aabb> = (0..500).map(|_| random_box(&mut rng, 1.0)).collect();
    let mut index = BoxIndex::default();
    for round in 0..6 {
        index.refresh(&boxes, None);
        let start = Aabb::from_center([0.1 * round as f32; 3], [0.2; 3]);
        let is_there = |id: &u32| boxes[*id as usize].is_valid() && start.overlaps(&boxes[*id as usize]);
        let there: Vec<u32> = (0..500).filter(is_there).collect();
        let all = met(&index, &start, [1.0; 3], 9.0);
        assert!(there.len() > 20 && all.len() > there.len() && there.iter().all(|id| all.contains(id)));
        // The box with this id is hit at time 0.
        let (hit, mut visited) = (there[there.len() / 2], Vec::new());
        index.cast_aabb(&start, [1.0; 3], 9.0, |id| {
            visited.push(id);
            if visited.contains(&hit) { 0.0 } else { 9.0 }
        });
        let until = visited.iter().position(|id| *id == hit).expect("the box was visited");
        assert!(visited[until + 1..].iter().all(|id| *id < hit && there.contains(id)));
        assert!(there.iter().filter(|id| **id < hit).all(|id| visited.contains(id)));
        let mut count = 0;
        index.cast_aabb(&start, [1.0; 3], 9.0, |_| {
            count += 1;
            if count < 3 { 9.0 } else { -1.0 }
        });
        assert_eq!(count, 3);
        index.sort(&boxes);
    }
}

#[test]
fn a_missed_box_is_noticed() {
    let mut rng = StdRng::seed_from_u64(7);
    let boxes: Vec<Aabb> = (0..50).map(|_| random_box(&mut rng, 3.0)).collect();
    let (mut index, mut stale) = (BoxIndex::default(), boxes.clone());
    let valid = stale.iter().position(Aabb::is_valid).expect("one of 50");
    stale[valid] = Aabb::NOWHERE;
    index.refresh(&stale, None);
    let mut ask = || (0..500).for_each(|_| check(&index, &boxes, &mut rng, 3.0));
    assert!(std::panic::catch_unwind(std::panic::AssertUnwindSafe(&mut ask)).is_err());
}

fn scattered(n: usize) -> Vec<Aabb> {
    let (mut rng, side) = (StdRng::seed_from_u64(9), (n as f32 * 4.0).cbrt());
    (0..n).map(|_| cube(random_point(&mut rng, 0.0..side), 0.4)).collect()
}

/// Casts rays to the first box. Returns the nodes that the last one hundred looked at, and the boxes that they visited.
fn cast(index: &mut BoxIndex, boxes: &[Aabb], rays: usize) -> (u64, u64) {
    let (mut rng, mut nodes, mut visited) = (StdRng::seed_from_u64(3), 0, 0);
    let side = (boxes.len() as f32 * 4.0).cbrt();
    for ray in 0..rays {
        let (from, along) = (random_point(&mut rng, 0.0..side), random_point(&mut rng, -1.0..1.0));
        let (start, mut first) = (Aabb::new(from, from), f32::MAX);
        let is_counted = ray + 100 >= rays;
        let looked_at = index.cast_aabb(&start, along, f32::MAX, |id| {
            visited += u64::from(is_counted);
            first =
                meets(&start, along, f32::MAX, &boxes[id as usize]).map_or(first, |t| first.min(t as f32));
            first
        });
        nodes += if is_counted { looked_at } else { 0 };
        if index.wants_sort() {
            index.sort(boxes);
        }
    }
    (nodes, visited)
}

#[test]
fn a_ray_looks_at_few_nodes_among_many_boxes() {
    for n in [1000, 10_000, 100_000] {
        let (boxes, mut index) = (scattered(n), BoxIndex::default());
        index.refresh(&boxes, None);
        let (few, _) = cast(&mut index, &boxes, 100);
        assert!(few < 100 * 160, "{n} boxes: {few} for 100 rays");
        // A box at the end of the world, huge ones and flat ones cost the others nothing.
        let mut odd = boxes.clone();
        odd[0] = Aabb::new([1e9; 3], [1e10; 3]);
        odd[1] = Aabb::new([f32::NEG_INFINITY, -1.0, f32::NEG_INFINITY], [f32::INFINITY, 0.0, f32::INFINITY]);
        odd.iter_mut().skip(2).step_by(50).for_each(|one| *one = one.inflated(n as f32));
        let mut index = BoxIndex::default();
        index.refresh(&odd, None);
        let (nodes, visited) = cast(&mut index, &odd, 100);
        assert!(visited < 100 * (n as u64 / 50 + 40), "{n} boxes: {visited} visited");
        assert!(nodes < 100 * (n as u64 / 300 + 200), "{n} boxes: {nodes} nodes");
    }
}

/// Returns the mean number of nodes that rays look at, straight down from random places.
fn look_down(index: &BoxIndex, side: f32) -> u64 {
    let mut rng = StdRng::seed_from_u64(4);
    let mut one = || {
        let place = [rng.random_range(0.0..side), rng.random_range(0.0..side), 1e4];
        index.cast_aabb(&Aabb::new(place, place), [0.0, 0.0, -1.0], f32::MAX, |_| f32::MAX)
    };
    (0..100).map(|_| one()).sum::<u64>() / 100
}

/// Tiles, and terraces: a cut between heights would leave nodes as wide as the world.
#[test]
fn flat_boxes_at_many_heights_are_not_cut_into_slabs() {
    let mut rng = StdRng::seed_from_u64(5);
    let side = 300.0;
    for (thickness, heights) in [(0.0, 1.0), (0.0, 1e-3), (1e-6, 1.0), (1e-3, 10.0), (0.01, 10.0), (0.0, 0.0)]
    {
        let mut tile = || {
            let [x, y, z] = [side, side, heights].map(|most| rng.random_range(0.0..=most));
            Aabb::new([x, y, z], [x + 2.0, y + 2.0, z + thickness])
        };
        let boxes: Vec<Aabb> = (0..10_000).map(|_| tile()).collect();
        let mut index = BoxIndex::default();
        index.sort(&boxes);
        let nodes = look_down(&index, side);
        assert!(nodes < 32, "tiles {thickness} thick, heights up to {heights}: {nodes} nodes a ray");
    }
}

/// A list that has become short, and one whose boxes are gone.
#[test]
fn an_index_forgets_a_peak() {
    let boxes = scattered(100_000);
    for rest in [
        boxes[..500].to_vec(),
        boxes[..500].iter().copied().chain(std::iter::repeat_n(Aabb::NOWHERE, 99_500)).collect(),
    ] {
        let mut index = BoxIndex::default();
        index.refresh(&boxes, None);
        index.refresh(&rest, None);
        assert!(index.nodes.len() < 100, "{} nodes for 500 boxes", index.nodes.len());
        check(&index, &rest, &mut StdRng::seed_from_u64(1), 70.0);
    }
}

/// Boxes that come after a sort make queries slow only until these have paid for the next one.
#[test]
fn later_boxes_are_sorted_in_once_queries_have_paid() {
    for n in [2000, 20_000] {
        let (mut boxes, mut index) = (scattered(n), BoxIndex::default());
        index.refresh(&boxes, None);
        index.sort(&boxes);
        let before = cast(&mut index, &boxes, 100).0;
        let new: Vec<Aabb> = boxes.iter().step_by(40).map(|one| one.inflated(-0.1)).collect();
        let ids: Vec<u32> = (0..new.len()).map(|i| (n + i) as u32).collect();
        boxes.extend(new);
        index.refresh(&boxes, Some(&ids));
        assert!(index.loose().len() > n / 400);
        let with_loose = cast(&mut index, &boxes, 100).0;
        let after = cast(&mut index, &boxes, 8 * n).0;
        assert!(with_loose > 2 * before && after < 2 * before, "{n}: {before}, {with_loose}, {after}");
    }
}

#[test]
fn queries_with_nans_visit_nothing() {
    let mut index = BoxIndex::default();
    let unit = Aabb::new([0.0; 3], [1.0; 3]);
    index.refresh(&[unit], None);
    for (start, velocity, time, visits) in [
        (unit, [f32::NAN, 0.0, 0.0], 1.0, 0),
        (unit, [1.0; 3], f32::NAN, 0),
        (unit, [1.0; 3], -1.0, 0),
        (Aabb::NOWHERE, [1.0; 3], 1.0, 0),
        (unit, [f32::INFINITY, 0.0, 0.0], 1.0, 1),
    ] {
        assert_eq!(met(&index, &start, velocity, time).len(), visits, "{start:?}, {velocity:?}, {time}");
    }
    for (point, distance) in [([f32::NAN; 3], 1.0), ([f32::NEG_INFINITY; 3], 1.0), ([0.5; 3], f32::NAN)] {
        assert_eq!(index.near(point, distance, |_| 1.0), 0);
    }
    // A box of a loose leaf, and the ends of a box in the wrong order.
    index.refresh(&[unit, Aabb::new([0.0; 3], [9.0; 3])], Some(&[1]));
    for invalid in [Aabb::new([6.0; 3], [4.0; 3]), Aabb { min: [f32::NAN; 3], ..unit }] {
        assert_eq!(index.overlapping(&invalid, |id| panic!("box {id}")), 0);
    }
}

/// Leaves of points around an edge of the crowd have bounds that all of its boxes overlap.
#[test]
fn a_crowd_does_not_test_the_points_around_it() {
    let mut random = StdRng::seed_from_u64(4);
    let mut point = |i: usize| {
        let mut at = random_point(&mut random, 0.0..1.0);
        at[i % 3] = [-1e-4, 1.0001][i / 3 % 2];
        Aabb::new(at, at)
    };
    // One of each set is far away, so that the bounds of a set do not drop the others.
    let [low, high] = [-5.0, 5.0].map(|at| Aabb::new([at; 3], [at + 0.5; 3]));
    let mut ratio = |n: usize| {
        let crowd: Vec<Aabb> =
            [low, high].into_iter().chain((0..n).map(|_| Aabb::new([0.0; 3], [1.0; 3]))).collect();
        let points: Vec<Aabb> = [low, high].into_iter().chain((0..n).map(&mut point)).collect();
        let mut finder = Finder::new(Config { engine: Some(Engine::Tree), ..Config::DEFAULT });
        assert_eq!(finder.find_between(&crowd, &points).expect("few pairs").len(), 2);
        let report = finder.report();
        report.work as f64 / (report.boxes as f64 * (report.boxes as f64).log2())
    };
    let ratios = [5000, 40_000].map(&mut ratio);
    assert!(ratios[1] < 0.25 * crate::WORK_LIMIT as f64, "{ratios:?}");
}

#[test]
fn a_box_without_bounds_meets_no_removed_one() {
    let unit = Aabb::new([0.0; 3], [1.0; 3]);
    let mut index = BoxIndex::default();
    index.refresh(&[unit; 2], None);
    index.refresh(&[unit, Aabb::NOWHERE], Some(&[1]));
    assert_eq!(overlapping(&index, &Aabb::new([f32::NEG_INFINITY; 3], [f32::INFINITY; 3])), [0]);
}

#[test]
fn ids_beyond_a_shorter_list_are_not_visited() {
    let unit = Aabb::new([0.0; 3], [1.0; 3]);
    let (mut index, mut boxes) = (BoxIndex::default(), vec![unit; 100]);
    index.refresh(&boxes, None);
    for (len, changed) in
        [(50, Some(&[][..])), (60, Some(&[59])), (40, Some(&[7])), (30, None), (5, Some(&[]))]
    {
        let before = boxes.len();
        boxes.resize(len, unit);
        index.refresh(&boxes, changed);
        let stale = if len > before { before as u32..len as u32 - 1 } else { 0..0 };
        let wanted: Vec<u32> = (0..len as u32).filter(|id| !stale.contains(id)).collect();
        assert_eq!(overlapping(&index, &unit), wanted, "{len}");
    }
}
