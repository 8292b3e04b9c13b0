//! The index gives the answers of a scan of all boxes, after all kinds of changes, and looks at few boxes.

use super::BoxIndex;
use crate::grid::{Hits, Rule};
use crate::{Aabb, Config, Engine, Finder, Pair, oracle};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use std::sync::atomic::AtomicU64;

fn random_box(rng: &mut StdRng, reach: f32) -> Aabb {
    let half = match rng.random_range(0..20) {
        0 => return Aabb::NOWHERE,
        1 => [reach, 0.1, reach],
        2 => [f32::INFINITY, 0.1, f32::INFINITY],
        _ => [0.0; 3].map(|_: f32| rng.random_range(0.0..0.6)),
    };
    Aabb::from_center([0.0; 3].map(|_: f32| rng.random_range(-reach..reach)), half)
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

/// Returns the boxes that a sweep meets, in the order of the visits.
fn met(index: &BoxIndex, start: &Aabb, velocity: [f32; 3], max_time: f32) -> Vec<u32> {
    let mut found = Vec::new();
    index.sweep(start, velocity, max_time, &mut |id| {
        found.push(id);
        max_time
    });
    found
}

/// Asks one question of each kind, and compares with a scan.
fn check(index: &BoxIndex, boxes: &[Aabb], rng: &mut StdRng, reach: f32) {
    let start = Aabb::from_center(
        [0.0; 3].map(|_: f32| rng.random_range(-reach..reach)),
        [0.0; 3].map(|_: f32| if rng.random_range(0..2) == 0 { 0.0 } else { 0.3 }),
    );
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
    index.sweep(&start, velocity, max_time, &mut |id| {
        first = times[id as usize].map_or(first, |time| time.min(first));
        max_time.min(first as f32)
    });
    let wanted = times.iter().flatten().copied().fold(f64::INFINITY, f64::min);
    assert_eq!(first, wanted, "the first box met");

    let (point, within) = (start.min, rng.random_range(0.0..4.0f32));
    let mut found = Vec::new();
    index.near(point, within, &mut |id| {
        found.push(id);
        within
    });
    let is_near = |i: usize, factor: f64| distance(point, &boxes[i]) <= f64::from(within) * factor;
    compare(found, (0..boxes.len()).filter(|&i| is_near(i, 1.0)), |i| is_near(i, 1.001));
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

/// Returns all pairs that a sorted index finds on this number of threads.
fn joined(boxes: &[Aabb], threads: usize) -> Vec<Pair> {
    let mut index = BoxIndex::default();
    index.sort(boxes);
    let found = AtomicU64::new(0);
    let rule = Rule::listing(None, &found);
    let mut hits = vec![Hits::default(); threads];
    hits.iter_mut().for_each(|hits| hits.begin(0, 0));
    index.find_pairs(None, &rule, &mut hits);
    let mut pairs: Vec<Pair> = hits.iter().flat_map(|hits| hits.pairs.iter().copied()).collect();
    pairs.sort_unstable();
    pairs
}

#[test]
fn a_join_finds_the_pairs_of_the_oracle() {
    let mut random = StdRng::seed_from_u64(5);
    for n in (0..100).chain([1000, 20_000]) {
        let width = (n as f32).cbrt() * 1.5;
        let mut boxes: Vec<Aabb> = (0..n)
            .map(|i| {
                let size = 2f32.powi(i % 7 * (i % 3) - 3);
                let half = [size, 1.0, 0.3].map(|half| half * random.random_range(0.2..0.5));
                Aabb::from_center([0; 3].map(|_| random.random_range(0.0..=width)), half)
            })
            .collect();
        let odd = [
            Aabb::NOWHERE,
            Aabb::new([1.0; 3], [0.0; 3]),
            Aabb::new([f32::NEG_INFINITY; 3], [f32::INFINITY; 3]),
        ];
        boxes.iter_mut().skip(5).step_by(41).zip(odd.iter().cycle()).for_each(|(to, odd)| *to = *odd);
        assert_eq!(joined(&boxes, 1 + n as usize % 3), oracle::pairs(&boxes), "{n} boxes");
    }
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
            (0..20).for_each(|_| check(&index, &boxes, &mut rng, 12.0));
            if round % 7 == 0 {
                index.sort(&boxes);
                sorts += 1;
            }
        }
        assert!(sorts > 5 && (loose > 0 || n < 20), "{n} boxes: {sorts} sorts, {loose} loose leaves");
    }
}

/// Among boxes at the start the lowest id comes first, and the others are not looked at once it is found.
#[test]
fn boxes_at_the_start_come_first_and_by_id() {
    let mut rng = StdRng::seed_from_u64(5);
    let boxes: Vec<Aabb> = (0..500).map(|_| random_box(&mut rng, 1.0)).collect();
    let mut index = BoxIndex::default();
    for round in 0..3 {
        index.refresh(&boxes, None);
        let start = Aabb::from_center([0.1 * round as f32; 3], [0.2; 3]);
        let wanted: Vec<u32> = (0..500)
            .filter(|&id| boxes[id as usize].is_valid() && start.overlaps(&boxes[id as usize]))
            .collect();
        let (all, mut first) = (met(&index, &start, [1.0; 3], 9.0), Vec::new());
        index.sweep(&start, [1.0; 3], 9.0, &mut |id| {
            first.push(id);
            if id < wanted[3] { 9.0 } else { 0.0 }
        });
        assert!(wanted.len() > 20 && all.len() > wanted.len());
        assert_eq!((&all[..wanted.len()], &first[..]), (&wanted[..], &wanted[..4]));
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
    (0..n).map(|_| Aabb::from_center([0.0; 3].map(|_: f32| rng.random_range(0.0..side)), [0.4; 3])).collect()
}

/// Casts rays to the first box. Returns the nodes that the last one hundred looked at, and the boxes that they visited.
fn cast(index: &mut BoxIndex, boxes: &[Aabb], rays: usize) -> (u64, u64) {
    let (mut rng, mut nodes, mut visited) = (StdRng::seed_from_u64(3), 0, 0);
    let side = (boxes.len() as f32 * 4.0).cbrt();
    for ray in 0..rays {
        let from = [0.0; 3].map(|_: f32| rng.random_range(0.0..side));
        let along = [0.0; 3].map(|_: f32| rng.random_range(-1.0..1.0));
        let (start, mut first) = (Aabb::new(from, from), f32::MAX);
        let is_counted = ray + 100 >= rays;
        let looked_at = index.sweep(&start, along, f32::MAX, &mut |id| {
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
fn a_crowd_of_questions_pays_for_a_sort_and_single_ones_do_not() {
    for n in [1000, 10_000, 100_000] {
        let (boxes, mut index) = (scattered(n), BoxIndex::default());
        index.refresh(&boxes, None);
        let many = (n / 40) as u64;
        let (one, _) = cast(&mut index, &boxes, 1);
        assert!(one >= many, "{n} boxes: {one}: not sorted for one ray");
        let (few, _) = cast(&mut index, &boxes, 500);
        assert!(few < 100 * 160, "{n} boxes: {few} for 100 rays");
        // A box at the end of the world, huge ones and flat ones cost the others nothing.
        let mut odd = boxes.clone();
        odd[0] = Aabb::new([1e9; 3], [1e10; 3]);
        odd[1] = Aabb::new([f32::NEG_INFINITY, -1.0, f32::NEG_INFINITY], [f32::INFINITY, 0.0, f32::INFINITY]);
        odd.iter_mut().skip(2).step_by(50).for_each(|one| *one = one.inflated(n as f32));
        let mut index = BoxIndex::default();
        index.refresh(&odd, None);
        index.sort(&odd);
        let (nodes, visited) = cast(&mut index, &odd, 100);
        assert!(visited < 100 * (n as u64 / 50 + 40), "{n} boxes: {visited} visited");
        assert!(nodes < 100 * (n as u64 / 300 + 200), "{n} boxes: {nodes} nodes");
    }
}

/// Boxes that come after a sort make questions slow only until these have paid for the next one.
#[test]
fn later_boxes_are_sorted_in_once_questions_have_paid() {
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
fn questions_with_nans_visit_nothing() {
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
        assert_eq!(index.near(point, distance, &mut |_| 1.0), 0);
    }
}

/// Leaves of points around an edge of the crowd have bounds that all of its boxes overlap.
#[test]
fn a_crowd_does_not_test_the_points_around_it() {
    let mut random = StdRng::seed_from_u64(4);
    let mut point = |i: usize| {
        let mut at = [0; 3].map(|_| random.random_range(0.0f32..1.0));
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

/// Returns boxes that cross in three directions, and that no tree can cut apart.
pub(crate) fn needles(n: usize) -> Vec<Aabb> {
    let mut random = StdRng::seed_from_u64(1);
    let needle = |i: usize| {
        let (mut at, mut half) = ([0; 3].map(|_| random.random_range(0.0f32..1.0)), [1e-9; 3]);
        (at[i % 3], half[i % 3]) = (0.5, 0.5);
        Aabb::from_center(at, half)
    };
    (0..n).map(needle).collect()
}

#[test]
fn the_work_of_a_join_is_estimated_from_some_leaves() {
    let boxes = needles(20_000);
    let (mut index, found, mut hits) = (BoxIndex::default(), AtomicU64::new(0), [Hits::default()]);
    let rule = Rule::listing(None, &found);
    for split in [None, Some(10_000)] {
        index.sort_sets(&boxes, split);
        let estimated = index.vain_work(split, u64::MAX, &mut hits[0]);
        hits[0].begin(0, 0);
        index.find_pairs(split, &rule, &mut hits);
        let work = hits[0].tests + hits[0].runs;
        assert!(estimated.abs_diff(work) < work / 4, "{estimated} for {work}");
        assert!(index.vain_work(split, work / 4, &mut hits[0]) < work / 2, "stops soon");
    }
}

#[test]
fn a_box_without_bounds_meets_no_removed_one() {
    let unit = Aabb::new([0.0; 3], [1.0; 3]);
    let mut index = BoxIndex::default();
    index.refresh(&[unit; 2], None);
    index.refresh(&[unit, Aabb::NOWHERE], Some(&[1]));
    let mut met = vec![];
    index.overlapping(&Aabb::new([f32::NEG_INFINITY; 3], [f32::INFINITY; 3]), &mut |id| met.push(id));
    assert_eq!(met, [0]);
}
