//! Pairs without a list: each pair once, in memory that does not grow with the pairs. And pairs without a shared key.

use pbig_core::{Aabb, Backend, Boxes, Config, Finder, Keys, Limits, NO_KEY, Pair, ProxyFilter, oracle};
use pbig_harness::counting::{held, largest};
use pbig_tests::{corpus, difference, on_cpu, on_threads, set, strategies};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Returns the pairs that a closure got, sorted; twice is twice.
fn visited<'a>(config: Config, boxes: impl Into<Boxes<'a>>) -> Vec<Pair> {
    visited_by(&mut Finder::new(config), boxes)
}

fn visited_by<'a>(finder: &mut Finder, boxes: impl Into<Boxes<'a>>) -> Vec<Pair> {
    let got = Mutex::new(Vec::new());
    let count = finder.for_each_pair(boxes, |pair| got.lock().expect("no panic").push(pair));
    let mut got = got.into_inner().expect("no panic");
    got.sort_unstable();
    assert_eq!((count, finder.report().pairs), (Ok(got.len() as u64), got.len() as u64));
    assert!(finder.pairs().is_empty());
    got
}

#[test]
fn a_closure_gets_each_pair_of_the_corpus_once() {
    for case in corpus() {
        let wanted = oracle::pairs(&case.boxes);
        for (_, config) in on_cpu() {
            let got = visited(config, &case.boxes);
            assert_eq!(difference(&got, &wanted), None, "{}, {config:?}", case.name);
        }
    }
}

#[test]
fn a_closure_gets_each_pair_once_from_several_threads() {
    let boxes = set("mixed", 40_000, 3);
    let filters: Vec<_> = (0..40_000).map(|i| ProxyFilter { body: i % 3, ..ProxyFilter::ALL }).collect();
    for (_, config) in on_cpu().into_iter().filter(|(name, _)| *name != "brute") {
        let got = on_threads(5, || visited(config, Boxes::new(&boxes).with_filters(&filters)));
        assert_eq!(difference(&got, &oracle::pairs_filtered(&boxes, &filters)), None, "{config:?}");
        let (of_a, of_b) = boxes.split_at(17_000);
        let (got, mut finder) = (Mutex::new(Vec::new()), Finder::new(config));
        let visit = |pair| got.lock().expect("no panic").push(pair);
        let count = on_threads(5, || finder.for_each_pair_between(of_a, of_b, visit));
        let mut got = got.into_inner().expect("no panic");
        got.sort_unstable();
        assert_eq!(count, Ok(got.len() as u64));
        assert!(got == oracle::pairs_between(of_a, of_b), "{config:?}");
    }
}

#[test]
fn a_finder_works_after_a_closure_has_panicked() {
    let boxes: Vec<_> =
        (0..20_000).map(|i| Aabb::from_center([i as f32 * 0.4, 0.0, 0.0], [0.5; 3])).collect();
    let wanted: Vec<_> = (0..19_999).flat_map(|a| [a + 1, a + 2].map(|b| Pair { a, b })).collect();
    for (_, config) in on_cpu().into_iter().filter(|(name, _)| *name != "brute") {
        let mut finder = Finder::new(config);
        for last in [1, 30_000] {
            let visits = AtomicU64::new(0);
            let visit = |_| assert!(visits.fetch_add(1, Relaxed) < last, "planted");
            let end =
                catch_unwind(AssertUnwindSafe(|| on_threads(5, || finder.for_each_pair(&boxes, visit))));
            assert!(end.is_err() && finder.pairs().is_empty(), "{config:?}");
            let got = on_threads(5, || visited_by(&mut finder, &boxes));
            assert_eq!(difference(&got, &wanted[..wanted.len() - 1]), None, "{config:?}");
        }
    }
}

/// Boxes on one spot, among large ones that meet all.
fn crowd(n: usize) -> Vec<Aabb> {
    let half = |i: usize| if i % 100 == 7 { 50.0 } else { 0.5 };
    (0..n).map(|i| Aabb::from_center([i as f32 * 1e-5; 3], [half(i); 3])).collect()
}

#[test]
fn twenty_million_pairs_take_no_list() {
    const BOXES: usize = 7000;
    const PAIRS: u64 = (BOXES * (BOXES - 1) / 2) as u64;
    let boxes = crowd(BOXES);
    // One thread, whose requests for memory are counted. No limit on pairs applies.
    for (_, config) in on_cpu() {
        let limits = Limits { max_pairs: 10, ..Limits::DEFAULT };
        let config = Config { limits, ..config };
        on_threads(1, || {
            let (before, sum) = (held(), AtomicU64::new(0));
            largest();
            let mut finder = Finder::new(config);
            let add = |pair: Pair| _ = sum.fetch_add(u64::from(pair.b), Relaxed);
            assert_eq!(finder.for_each_pair(&boxes, add), Ok(PAIRS), "{config:?}");
            // Each box is `b` of as many pairs as boxes come before it.
            assert_eq!(sum.into_inner(), (0..BOXES as u64).map(|b| b * b).sum::<u64>());
            let bytes = (held() - before, largest());
            assert!(bytes.0 > 0 && bytes.0 < 4_000_000 && bytes.1 < 1_000_000, "{bytes:?} bytes, {config:?}");
            let [a, b] = [&boxes[..3000], &boxes[3000..]];
            assert_eq!(finder.for_each_pair_between(a, b, |_| ()), Ok(3000 * 4000), "{config:?}");
            let bytes = (held() - before, largest());
            assert!(bytes.0 < 8_000_000 && bytes.1 < 1_000_000, "{bytes:?} bytes, {config:?}");
        });
    }
}

fn share(one: &Keys, other: &Keys) -> bool {
    one.iter().any(|key| *key != NO_KEY && other.contains(key))
}

#[test]
fn pairs_with_a_key_in_common_are_left_out_on_every_strategy() {
    let mut random = StdRng::seed_from_u64(8);
    for (name, n) in [("pile", 2000), ("degenerate", 300), ("unit", 40)] {
        let boxes = set(name, n, 4);
        let mut key = || if random.random_range(0..3) == 0 { NO_KEY } else { random.random_range(0..12) };
        let keys: Vec<Keys> = (0..n).map(|_| [0; 4].map(|_| key())).collect();
        let wanted = oracle::pairs_where(&boxes, |a, b| !share(&keys[a as usize], &keys[b as usize]));
        assert!(!wanted.is_empty() && wanted.len() < oracle::pairs(&boxes).len());
        for (strategy, way) in strategies() {
            let mut finder = way.finder();
            let found = finder.find_without_shared(&boxes, &keys).expect("one each");
            assert_eq!(difference(found, &wanted), None, "{name}, {strategy}");
            assert_eq!(finder.report().pairs, wanted.len() as u64, "{name}, {strategy}");
        }
        for (_, config) in on_cpu() {
            let got = visited(config, Boxes::new(&boxes).with_keys(&keys));
            assert_eq!(difference(&got, &wanted), None, "{name}, {config:?}");
        }
    }
}

#[test]
fn a_device_is_not_asked_for_what_it_cannot_do() {
    let boxes = crowd(50);
    let mut finder = Finder::new(Config { backend: Backend::Device, ..Config::DEFAULT });
    assert_eq!(finder.for_each_pair(&boxes, |_| ()), Ok(50 * 49 / 2));
    assert!(finder.report().fallback.as_ref().is_some_and(|why| why.contains("one set")));
    assert_eq!(finder.find_between(&boxes, &boxes[..2].to_vec()).map(<[_]>::len), Ok(100));
    assert!(finder.report().fallback.is_some());
}
