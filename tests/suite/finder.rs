//! Contract 1: every strategy returns the oracle's pairs, sorted, for all boxes and thread counts.

use pbig_core::{Aabb, Backend, Config, Error, Finder, Limits, Order, Pair, ProxyFilter, oracle};
use pbig_harness::hard::shapes;
use pbig_tests::{Way, corpus, difference, gpu, may_run, on_threads, set, shifted, strategies};

pub(crate) fn check(name: &str, boxes: &[Aabb]) {
    check_on(strategies(), name, boxes);
}

fn check_on(strategies: Vec<(&str, Way)>, name: &str, boxes: &[Aabb]) {
    for (strategy, way) in strategies {
        check_by(&mut way.finder(), way, &format!("{name}, {strategy}"), boxes);
    }
}

fn check_by(finder: &mut Finder, way: Way, what: &str, boxes: &[Aabb]) {
    let wanted = oracle::pairs(boxes);
    let invalid = boxes.iter().filter(|b| !b.is_valid()).count() as u64;
    let found = finder.find(boxes).expect("within the limits");
    assert_eq!(difference(found, &wanted), None, "{what}");
    let report = finder.report();
    assert_eq!(report.fallback, None, "{what}: a GPU's work must not be done by the CPU");
    assert_eq!((report.boxes, report.invalid), (boxes.len() as u64, invalid), "{what}");
    assert_eq!(report.pairs, wanted.len() as u64);
    if way.backend != Backend::Device || way.gpu.count_tests {
        let useful = report.checks.made - report.checks.unnecessary - report.checks.redundant;
        assert_eq!(useful, wanted.len() as u64, "{what}: each pair has one useful check");
    }
}

/// A finder that is used again forgets the boxes before.
#[test]
fn the_corpus_on_every_strategy() {
    for (strategy, way) in strategies() {
        let mut finder = way.finder();
        for case in corpus() {
            check_by(&mut finder, way, &format!("{}, {strategy}", case.name), &case.boxes);
        }
    }
}

#[test]
fn ten_thousand_random_sets_with_every_degenerate_kind() {
    for seed in 0..10_000 {
        let boxes = set("degenerate", (seed % 301) as usize, seed);
        // A software adapter takes 4 ms for what the CPU does in 10 us.
        let on_gpu = |name: &str| name.starts_with("gpu");
        let strategies = strategies().into_iter().filter(|(name, _)| !on_gpu(name) || seed % 25 == 0);
        let name = format!("degenerate, seed {seed}");
        check_on(strategies.collect(), &name, &boxes);
    }
}

#[test]
fn hard_shapes_on_every_strategy() {
    for (name, recipe) in shapes() {
        check(name, &recipe.boxes(300, 1));
    }
}

#[test]
fn the_same_bytes_for_any_number_of_threads() {
    for name in ["uniform", "gaussian", "mixed", "pile"] {
        let boxes = set(name, 40_000, 3);
        let with_threads = |threads, order| {
            on_threads(threads, || {
                let mut finder = Finder::new(Config { order, ..Config::DEFAULT });
                finder.find(&boxes).expect("within the limits").to_vec()
            })
        };
        let wanted = with_threads(1, Order::Sorted);
        assert_eq!(difference(&wanted, &oracle::pairs(&boxes)), None, "{name}");
        for threads in [2, 3, 5, 16] {
            assert!(with_threads(threads, Order::Sorted) == wanted, "{name}, {threads} threads");
            let mut unsorted = with_threads(threads, Order::Unspecified);
            unsorted.sort_unstable();
            assert!(unsorted == wanted, "{name}, {threads} threads, unsorted");
        }
    }
}

#[test]
fn filters_are_applied_while_searching() {
    let boxes = set("pile", 2000, 1);
    let filters: Vec<_> = (0..2000u32)
        .map(|i| ProxyFilter {
            body: i % 50,
            memberships: 1 << (i % 5),
            mask: !(1 << (i % 3)),
            ..ProxyFilter::ALL
        })
        .collect();
    let wanted = oracle::pairs_filtered(&boxes, &filters);
    assert!(!wanted.is_empty() && wanted.len() < oracle::pairs(&boxes).len());
    for (strategy, way) in strategies() {
        let mut finder = way.finder();
        assert_eq!(finder.find_filtered(&boxes, &filters).expect("one each"), wanted, "{strategy}");
    }
}

#[test]
fn limits_end_in_errors_that_name_them() {
    let boxes = vec![Aabb::new([0.0; 3], [1.0; 3]); 300];
    for (strategy, way) in strategies() {
        let with = |max_boxes, max_pairs| way.with(|it| it.limits = Limits { max_boxes, max_pairs });
        let pairs = 300 * 299 / 2;
        assert_eq!(
            with(300, pairs).finder().find(&boxes).map(<[Pair]>::len),
            Ok(pairs as usize),
            "{strategy}"
        );
        let error = with(300, pairs - 1).finder().find(&boxes).unwrap_err();
        assert_eq!(error, Error::TooManyPairs { limit: pairs - 1 }, "{strategy}");
        assert!(error.to_string().contains("max_pairs"));
        let error = with(299, pairs).finder().find(&boxes).unwrap_err();
        assert_eq!(error, Error::TooManyBoxes { boxes: 300, limit: 299 }, "{strategy}");
    }
    let error = Finder::default().find_filtered(&boxes, &[]).unwrap_err();
    assert_eq!(error, Error::FilterCount { boxes: 300, filters: 0 });
}

#[test]
fn clusters_do_not_cost_more_than_an_even_spread() {
    // 2 x 20,000 boxes far apart: cells sized for the whole world would hold a cluster each.
    for apart in [1e3f32, 1e6, 1e7] {
        let mut boxes = set("unit", 20_000, 1);
        boxes.extend(set("unit", 20_000, 2).iter().map(|aabb| shifted(aabb, [apart; 3])));
        checks_at_most(60 * 40_000, &boxes);
    }
}

#[test]
fn boxes_flung_far_away_do_not_coarsen_the_cells_of_others() {
    let mut boxes = set("pile", 9000, 1);
    boxes.extend((0..1000).map(|i| {
        let side = |k: u32| if i >> k & 1 == 0 { 1.0 } else { -1.0 };
        Aabb::from_center([side(0), side(1), side(2)].map(|s| s * (1e9 + 1e6 * i as f32)), [0.5; 3])
    }));
    checks_at_most(60 * 10_000, &boxes);
}

#[test]
fn points_among_identical_ones_cost_no_more_than_those() {
    let mut boxes: Vec<Aabb> = set("unit", 9000, 1).iter().map(|b| Aabb::new(b.min, b.min)).collect();
    boxes.extend(vec![boxes[17]; 300]);
    checks_at_most(300 * 300 / 2 + 60 * 9300, &boxes);
}

/// In each of three calls of one finder, which has learned from the calls before.
fn checks_at_most(most: u64, boxes: &[Aabb]) {
    // On a GPU a box has an entry in each of about eight cells.
    let all = [(Config::DEFAULT.into(), most), (gpu(), 8 * most)];
    for (way, most) in all.into_iter().filter(|(way, _): &(Way, _)| may_run(way)) {
        let mut finder = way.finder();
        for call in 0..3 {
            finder.find(boxes).expect("within the limits");
            let made = finder.report().checks.made;
            assert!(made < most, "call {call}: {made} checks: {}", finder.report().plan);
        }
    }
}

#[test]
fn a_limit_is_noticed_before_memory_runs_out() {
    // 5 * 10^9 pairs, 40 GB, if anything went on past the limit.
    let boxes = vec![Aabb::new([0.0; 3], [1.0; 3]); 100_000];
    for (strategy, way) in strategies() {
        let limits = Limits { max_pairs: 1000, ..Limits::DEFAULT };
        let error = way.with(|it| it.limits = limits).finder().find(&boxes).unwrap_err();
        assert_eq!(error, Error::TooManyPairs { limit: 1000 }, "{strategy}");
    }
}

#[test]
fn nothing_of_an_earlier_call_outlives_a_failed_one() {
    let boxes = vec![Aabb::new([0.0; 3], [1.0; 3]); 3];
    let limits = Limits { max_boxes: 3, ..Limits::DEFAULT };
    let mut finder = Finder::new(Config { limits, ..Config::DEFAULT });
    assert_eq!(finder.find(&boxes).map(<[Pair]>::len), Ok(3));
    assert!(finder.find_filtered(&boxes, &[]).is_err());
    assert!(finder.pairs().is_empty() && finder.report().boxes == 0);
}
