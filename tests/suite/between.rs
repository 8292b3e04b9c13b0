//! Pairs between two sets: those of the oracle, in order, at the cost of what is across.

use pbig_core::{
    Aabb, Algorithm, Boxes, Config, CrossPair, Engine, Error, Finder, Keys, Limits, NO_KEY, Order, Plan,
    ProxyFilter, Report, WORK_LIMIT, oracle,
};
use pbig_harness::hard::{Recipe, ratio, shapes};
use pbig_tests::{corpus, on_cpu, on_threads, set};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

/// A way to divide a list of boxes into two sets.
type Division = (&'static str, fn(usize, &Aabb, usize) -> bool);

/// True for a box of the first set, by its index, itself and the number of boxes.
const DIVISIONS: [Division; 6] = [
    ("in turns", |i, _, _| i % 2 == 0),
    ("three kinds in turns", |i, _, _| i % 3 == 0),
    ("halves of the list", |i, _, n| i < n / 2),
    ("a few and the others", |i, _, n| i % (n / 40 + 1) == 3),
    ("by place", |_, aabb, _| aabb.min[0] < 30.0),
    ("by shape", |_, aabb, _| aabb.max[0] - aabb.min[0] > aabb.max[1] - aabb.min[1]),
];

fn divide(boxes: &[Aabb], (_, is_first): Division) -> (Vec<Aabb>, Vec<Aabb>) {
    let all: Vec<_> =
        boxes.iter().enumerate().map(|(i, aabb)| (is_first(i, aabb, boxes.len()), *aabb)).collect();
    let part = |wanted: bool| all.iter().filter(|(is, _)| *is == wanted).map(|(_, aabb)| *aabb).collect();
    (part(true), part(false))
}

/// Returns the first difference of two sorted lists in words.
fn difference(found: &[CrossPair], wanted: &[CrossPair]) -> Option<String> {
    if found == wanted {
        return None;
    }
    let differ = found.iter().zip(wanted).find(|(found, wanted)| found != wanted);
    Some(format!("{} instead of {} pairs, first {differ:?}", found.len(), wanted.len()))
}

fn check(name: &str, a: &[Aabb], b: &[Aabb]) {
    let wanted = oracle::pairs_between(a, b);
    let invalid = a.iter().chain(b).filter(|aabb| !aabb.is_valid()).count() as u64;
    for (way, config) in on_cpu() {
        let mut finder = Finder::new(config);
        let found = finder.find_between(a, b).expect("within the limits");
        assert_eq!(difference(found, &wanted), None, "{name}, {way}");
        let report = finder.report();
        let counts = (report.boxes, report.invalid, report.pairs);
        assert_eq!(counts, ((a.len() + b.len()) as u64, invalid, wanted.len() as u64), "{name}, {way}");
        assert_eq!(report.checks.made - report.checks.unnecessary, wanted.len() as u64, "{name}, {way}");
    }
}

#[test]
fn the_corpus_divided_in_every_way() {
    for case in corpus() {
        for division in DIVISIONS {
            let (a, b) = divide(&case.boxes, division);
            check(&format!("{}, {}", case.name, division.0), &a, &b);
            check(&format!("{}, {}, the other way", case.name, division.0), &b, &a);
        }
    }
}

#[test]
fn random_sets_with_every_degenerate_kind() {
    for seed in 0..2000 {
        let [a, b] = [(seed % 211, seed), (seed % 137, seed + 7000)]
            .map(|(n, seed)| set("degenerate", n as usize, seed));
        check(&format!("degenerate, seed {seed}"), &a, &b);
    }
}

/// A sample of a set does not see one box of thousands: then no box is dropped before the search.
#[test]
fn a_few_invalid_and_far_boxes_among_many() {
    let odd = [
        Aabb::NOWHERE,
        Aabb::new([3.0; 3], [2.0; 3]),
        Aabb::new([f32::NAN; 3], [1.0; 3]),
        Aabb::from_center([1e9; 3], [1.0; 3]),
        Aabb::new([f32::NEG_INFINITY; 3], [f32::INFINITY; 3]),
    ];
    for (seed, sizes) in [[3000, 3000], [10, 3000], [3000, 70]].into_iter().enumerate() {
        for odd in odd {
            let [mut a, mut b] = [0, 1].map(|side| set("unit", sizes[side], 10 * seed as u64 + side as u64));
            // A small set gets a huge box, so that no box of the other set misses its bounds.
            [&mut a, &mut b].into_iter().filter(|set| set.len() < 100).for_each(|set| {
                set[0] = Aabb::from_center([0.0; 3], [1e4; 3]);
            });
            for at in 700..703 {
                a.get_mut(at).into_iter().chain(b.get_mut(at)).for_each(|aabb| *aabb = odd);
            }
            check(&format!("{sizes:?} with {odd:?}"), &a, &b);
            check(&format!("{sizes:?} with {odd:?}, the other way"), &b, &a);
        }
    }
}

#[test]
fn a_finder_used_for_one_set_and_two_mixes_nothing_up() {
    let [a, b] = [1, 2].map(|seed| set("unit", 3000, seed));
    let mut finder = Finder::default();
    for set in [&a, &b] {
        assert!(finder.find(set).expect("within the limits") == oracle::pairs(set));
        assert!(finder.find_between(set, &b).expect("within the limits") == oracle::pairs_between(set, &b));
        finder.for_each_pair_between(&b, &a, |_| ()).expect("within the limits");
        finder.for_each_pair(&a[..9], |_| ()).expect("within the limits");
        // Each list is that of the last call that makes one of its kind.
        assert!(finder.pairs() == oracle::pairs(set));
        assert!(finder.pairs_between() == oracle::pairs_between(set, &b));
    }
    assert!(finder.find_between(&a, Boxes::new(&b).with_filters(&[])).is_err());
    assert!(finder.pairs_between().is_empty() && !finder.pairs().is_empty());
    assert!(finder.find_filtered(&a, &[]).is_err() && finder.pairs().is_empty());
}

#[test]
fn the_same_bytes_between_sets_for_any_number_of_threads() {
    for (name, way) in on_cpu().into_iter().filter(|(name, _)| *name != "brute") {
        let [a, b] = [5, 6].map(|seed| set("mixed", 30_000, seed));
        let with_threads = |threads, order| {
            on_threads(threads, || {
                let mut finder = Finder::new(Config { order, ..way });
                finder.find_between(&a, &b).expect("within the limits").to_vec()
            })
        };
        let wanted = with_threads(1, Order::Sorted);
        assert!(wanted.len() > 10_000 && wanted == oracle::pairs_between(&a, &b), "{name}");
        for threads in [2, 5] {
            assert!(with_threads(threads, Order::Sorted) == wanted, "{name}, {threads} threads");
            let mut unsorted = with_threads(threads, Order::Unspecified);
            unsorted.sort_unstable();
            assert!(unsorted == wanted, "{name}, {threads} threads, unsorted");
        }
    }
}

#[test]
fn filters_and_keys_of_two_sets_agree_with_the_oracle() {
    let mut random = StdRng::seed_from_u64(3);
    let [a, b] = [1, 2].map(|seed| set("pile", 2000, seed));
    let bodies: Vec<ProxyFilter> = (0..2000)
        .map(|i| ProxyFilter { body: i % 9, memberships: 1 << (i % 3), mask: 6, ..ProxyFilter::ALL })
        .collect();
    let mut keys =
        || -> Vec<Keys> { (0..2000).map(|_| [0; 4].map(|_| random.random_range(0..20))).collect() };
    let (of_a, of_b) = (keys(), keys());
    let share =
        |pair: &CrossPair| of_a[pair.a as usize].iter().any(|key| of_b[pair.b as usize].contains(key));
    let allow = |pair: &CrossPair| bodies[pair.a as usize].allows(&ProxyFilter::ALL);
    let all = oracle::pairs_between(&a, &b);
    for (way, config) in on_cpu() {
        let mut finder = Finder::new(config);
        let filtered = Boxes::new(&a).with_filters(&bodies);
        let found = finder.find_between(filtered, &b).expect("one each").to_vec();
        assert!(found.iter().eq(all.iter().filter(|pair| allow(pair))), "{way}, filters");
        let (one, other) = (filtered.with_keys(&of_a), Boxes::new(&b).with_keys(&of_b));
        let found = finder.find_between(one, other).expect("one each").to_vec();
        let wanted: Vec<_> = all.iter().filter(|pair| allow(pair) && !share(pair)).copied().collect();
        assert!(found == wanted && !wanted.is_empty() && wanted.len() < all.len() / 2, "{way}, keys");
    }
}

#[test]
fn limits_and_lists_of_other_lengths_end_in_errors() {
    let boxes = vec![Aabb::new([0.0; 3], [1.0; 3]); 300];
    for (way, config) in on_cpu() {
        let with =
            |max_boxes, max_pairs| Finder::new(Config { limits: Limits { max_boxes, max_pairs }, ..config });
        let found = with(600, 90_000).find_between(&boxes, &boxes).map(<[_]>::len);
        assert_eq!(found, Ok(90_000), "{way}");
        let mut finder = with(600, 89_999);
        let error = finder.find_between(&boxes, &boxes).unwrap_err();
        assert_eq!(error, Error::TooManyPairs { limit: 89_999 }, "{way}");
        assert!(finder.pairs_between().is_empty());
        let error = with(599, 90_000).find_between(&boxes, &boxes).unwrap_err();
        assert_eq!(error, Error::TooManyBoxes { boxes: 600, limit: 599 }, "{way}");
    }
    let short = Boxes::new(&boxes).with_keys(&[[NO_KEY; 4]]);
    let error = Finder::default().find_between(&boxes, short).unwrap_err();
    assert_eq!(error, Error::KeyCount { boxes: 300, keys: 1 });
    let short = Boxes::new(&boxes).with_filters(&[]);
    let error = Finder::default().find_between(short, &boxes).unwrap_err();
    assert_eq!(error, Error::FilterCount { boxes: 300, filters: 0 });
}

fn crowd(n: usize, at: [f32; 3]) -> Vec<Aabb> {
    vec![Aabb::from_center(at, [0.5; 3]); n]
}

#[test]
fn a_crowd_costs_nothing_if_the_other_set_is_elsewhere() {
    let mut finder = Finder::default();
    let a = crowd(1_000_000, [0.0; 3]);
    assert!(finder.find_between(&a, &crowd(17, [9.0; 3])).expect("no pairs").is_empty());
    assert_eq!((finder.report().work, finder.report().plan.algorithm), (0, Algorithm::Nothing));
    // A few boxes are tested at once, without a look at the bounds.
    assert!(finder.find_between(&a, &crowd(16, [9.0; 3])).expect("no pairs").is_empty());
    assert_eq!((finder.report().work, finder.report().plan.algorithm), (16_000_000, Algorithm::Brute));
    // An invalid box is no reason to look farther.
    let inverted = Aabb::new([-9.0, 0.4, -9.0], [9.0, 0.3, 9.0]);
    let elsewhere = [crowd(20, [9.0; 3]), vec![inverted; 20], vec![Aabb::NOWHERE; 20]].concat();
    let with_one_there = [&a[..], &crowd(1, [9.0; 3])].concat();
    for (one, other) in [(&with_one_there, &elsewhere), (&elsewhere, &with_one_there)] {
        assert_eq!(finder.find_between(one, other).map(<[_]>::len), Ok(20));
        assert_eq!((finder.report().plan.boxes, finder.report().invalid), (21, 40));
    }
    // However far away.
    let a = [crowd(5000, [2e37; 3]), vec![Aabb::new([2e37; 3], [3.3e38; 3])]].concat();
    assert_eq!(finder.find_between(&a, &crowd(5000, [3e38; 3])).map(<[_]>::len), Ok(5000));
    assert_eq!(finder.report().plan.boxes, 5001);
    // All boxes of the other set are dropped, although its bounds hold the crowd.
    let a = crowd(1000, [0.0; 3]);
    let around = [crowd(9, [-9.0; 3]), crowd(9, [9.0; 3])].concat();
    for (one, other) in [(&a, &around), (&around, &a)] {
        assert!(finder.find_between(one, other).expect("no pairs").is_empty());
        assert_eq!((finder.report().work, finder.report().plan.algorithm), (0, Algorithm::Nothing));
    }
}

#[test]
fn each_box_of_sparse_sets_visits_four_rows_at_most() {
    let mut rng = StdRng::seed_from_u64(7);
    // Numbers of boxes, the side of their space, and the most work and tests of each box of the smaller set: 16 for four rows, and 5 for
    // each candidate. Below a side of 37 cells are as long as boxes; a window of these has up to nine rows, which count as 32 each.
    let cases = [
        (20_000, 20_000, 70.0, (24, 16)),
        (20_000, 20_000, 150.0, (24, 16)),
        (20_000, 20_000, 38.7, (32, 32)),
        (20_000, 20_000, 33.0, (310, 32)),
        (2000, 38_000, 70.0, (32, 32)),
        (38_000, 2000, 38.7, (64, 64)),
    ];
    for (n, m, side, (most_rows, most_tests)) in cases {
        let [a, b] = [n, m].map(|n| {
            let at = |rng: &mut StdRng| [(); 3].map(|()| rng.random_range(0.0..side));
            (0..n).map(|_| Aabb::from_center(at(&mut rng), [0.5; 3])).collect::<Vec<_>>()
        });
        let mut finder = Finder::default();
        let found = finder.find_between(&a, &b).expect("few pairs");
        assert_eq!(difference(found, &oracle::pairs_between(&a, &b)), None);
        let Report { work, checks, .. } = *finder.report();
        let few = n.min(m) as u64;
        let (rows, tests) = ((work - checks.made) / few, checks.made / few);
        assert!(rows <= most_rows && tests <= most_tests, "{n}, {m}, {side}: {rows} for rows, {tests} tests");
    }
}

#[test]
fn a_crowd_in_a_sparse_space_keeps_cells_short() {
    let mut rng = StdRng::seed_from_u64(9);
    for (in_crowd, side, is_long) in [(0, 60.0, true), (16_000, 34.0, false)] {
        let [a, b] = [(); 2].map(|()| {
            let mut boxes = |n: usize, side: f32, half: f32| {
                let at = |rng: &mut StdRng| [(); 3].map(|()| rng.random_range(10.0..10.0 + side));
                (0..n).map(|_| Aabb::from_center(at(&mut rng), [half; 3])).collect::<Vec<_>>()
            };
            [boxes(20_000 - in_crowd, side, 0.5), boxes(in_crowd, 6.8, 0.05)].concat()
        });
        let mut finder = Finder::default();
        let found = finder.find_between(&a, &b).expect("few pairs");
        assert_eq!(difference(found, &oracle::pairs_between(&a, &b)), None);
        let Plan { algorithm, cell, .. } = finder.report().plan;
        assert_eq!((algorithm, cell[0] > 2.0), (Algorithm::Grid, is_long), "{in_crowd}: {cell:?}");
    }
}

#[test]
fn boxes_that_miss_the_other_set_are_dropped_wherever_they_are_listed() {
    let mut rng = StdRng::seed_from_u64(8);
    // Enough for several threads. Every third box of a set is far on its own side.
    let [a, b] = [-900.0, 900.0].map(|far| {
        let at = |rng: &mut StdRng| [(); 3].map(|()| rng.random_range(0.0..50.0f32));
        let boxes = (0..20_000).map(|i| (i, at(&mut rng)));
        let moved = |(i, [x, y, z]): (u32, [f32; 3])| [if i % 3 == 1 { x + far } else { x }, y, z];
        boxes.map(|one| Aabb::from_center(moved(one), [0.5; 3])).collect::<Vec<_>>()
    });
    let mut finder = Finder::default();
    let found = finder.find_between(&a, &b).expect("few pairs");
    assert_eq!(difference(found, &oracle::pairs_between(&a, &b)), None);
    let listed = finder.report().plan.boxes;
    assert!((26_000..26_668).contains(&listed), "{listed}");
}

#[test]
fn a_crowd_costs_its_number_if_a_few_boxes_surround_it() {
    // Bounds do not part these: each set has boxes on all sides of the other's crowd.
    let corners = |half: f32| {
        (0..8).map(move |i| {
            Aabb::from_center([i & 1, i >> 1 & 1, i >> 2].map(|x| x as f32 * 90.0 - 40.0), [half; 3])
        })
    };
    for few in [0, 100] {
        let mut a = crowd(100_000, [0.0; 3]);
        let mut b = crowd(100_000, [1.01, 0.0, 0.0]);
        a.extend(corners(0.1));
        b.extend(corners(0.2));
        b.extend(crowd(few, [0.0, 5.0, 0.0]));
        let mut finder = Finder::default();
        assert_eq!(finder.find_between(&a, &b).map(<[_]>::len), Ok(8));
        let (work, plan) = (finder.report().work, &finder.report().plan);
        // The grid is given up after 40 binary logarithms of their number each.
        assert!(work < (40 + 40 * 18) * (a.len() + b.len()) as u64, "{work}: {plan}");
    }
}

/// Numbers of boxes of both sets: a work that is not bounded grows faster than they do.
const SIZES: [usize; 2] = [5000, 20_000];

/// Returns the work of a search for each box and pair, in binary logarithms.
fn ratio_between(recipe: &Recipe, n: usize, division: Division, engine: Option<Engine>) -> f64 {
    let (a, b) = divide(&recipe.boxes(n, 1), division);
    let mut finder = Finder::new(Config { engine, ..Config::DEFAULT });
    let found = finder.find_between(&a, &b).expect("few pairs");
    if n == SIZES[0] {
        assert_eq!(difference(found, &oracle::pairs_between(&a, &b)), None);
    }
    ratio(finder.report())
}

/// Rods in two directions share their cells, and miss each other.
#[test]
fn rods_that_share_their_cells_leave_the_grid() {
    let mut random = StdRng::seed_from_u64(12);
    let mut at = |low: [f32; 3], width: [f32; 3]| -> [f32; 3] {
        std::array::from_fn(|k| low[k] + width[k] * random.random::<f32>())
    };
    let rod = |[x, y, z]: [f32; 3], axis: usize| {
        let long = |k: usize| if k == axis { 1.0 } else { 1e-5 };
        Aabb::new([x, y, z], [x + long(0), y + long(1), z + long(2) * 0.01])
    };
    let a: Vec<Aabb> = (0..3000).map(|_| rod(at([0.0; 3], [0.0, 1.0, 0.8]), 0)).collect();
    let b: Vec<Aabb> = (0..20_000).map(|_| rod(at([0.0, 0.0, 0.001], [1.0, 0.0, 0.8]), 1)).collect();
    let mut finder = Finder::default();
    let found = finder.find_between(&a, &b).expect("few pairs").to_vec();
    assert!(found == oracle::pairs_between(&a, &b));
    assert!(ratio(finder.report()) < 36.0, "{:?}", finder.report());
}

#[test]
fn no_two_sets_take_work_without_bound() {
    for engine in [None, Some(Engine::Tree)] {
        for (name, recipe) in shapes() {
            for division in DIVISIONS {
                let [small, large] = SIZES.map(|n| ratio_between(&recipe, n, division, engine));
                let what = format!("{name}, {}, {engine:?}: {small:.2}, {large:.2}", division.0);
                println!("{what}");
                assert!(small.max(large) <= WORK_LIMIT as f64, "{what}");
                // Up to a ratio of 40 a grid is searched. Needles in three directions double.
                assert!(large <= (2.0 * small).max(45.0), "{what}");
            }
        }
    }
}
