//! Updates that the suite does not reach from outside: their work, the ways they take, their threads. `tests/suite/incremental.rs` and
//! the suite's checks of random bytes follow random worlds with every engine.

use crate::fixtures::{assert_right, cube, lattice, met, on_threads, random_point, set, update};
use crate::{Aabb, Algorithm, BroadPhase, Config, Engine, Error, ProxyFilter};
use rand::SeedableRng;
use rand::rngs::StdRng;

fn algorithm(of: &BroadPhase) -> Algorithm {
    of.report().plan.algorithm
}

#[test]
fn many_gone_and_one_new_take_few_tests() {
    let at = |x: u32| (x, cube([3.0 * x as f32, 0.0, 0.0], 1.0));
    let config = Config { engine: Some(Engine::LookUp), ..Config::DEFAULT };
    let mut broad_phase = BroadPhase::new(config).expect("a margin");
    update(&mut broad_phase, (0..2000).map(at));
    (0..1900).for_each(|id| _ = broad_phase.remove(id));
    update(&mut broad_phase, [at(2000)]);
    let work = broad_phase.report().work;
    assert!(work < 20_000, "{work} tests for 101 boxes");
}

#[test]
fn a_clone_goes_on_as_the_original() {
    let mut broad_phase = BroadPhase::default();
    let crowd = |ids: std::ops::Range<u32>, by: f32| {
        ids.map(move |id| (3 * id, cube(lattice(id, 20).map(|x| 1.1 * x + by), [0.5, 3.0][id as usize % 2])))
    };
    update(&mut broad_phase, crowd(0..8000, 0.0));
    let mut clone = broad_phase.clone();
    for one in [&mut broad_phase, &mut clone] {
        // An id that had no box before, too.
        update(one, crowd(100..200, 0.01).chain([(1, cube([0.3; 3], 0.1))]));
        assert_eq!(algorithm(one), Algorithm::LookUp);
        assert_right(one, "a clone, or its original");
    }
    assert_eq!(broad_phase.events(), clone.events());
}

#[test]
fn an_id_far_above_the_others_is_an_error_and_takes_no_memory() {
    let mut broad_phase = BroadPhase::default();
    let cube = Aabb::new([0.0; 3], [1.0; 3]);
    set(&mut broad_phase, [(3, cube)]);
    let id = 100_000_000;
    assert_eq!(broad_phase.set(id, cube, ProxyFilter::ALL), Err(Error::SparseId { id, known: 4 }));
    assert_eq!((broad_phase.len(), broad_phase.id_count()), (1, 4));
    // An id that costs 16 MB.
    set(&mut broad_phase, [((1 << 18) - 1, cube)]);
    // One more than 64 times the known ids.
    let id = (1 << 24) + 1;
    assert_eq!(broad_phase.set(id, cube, ProxyFilter::ALL), Err(Error::SparseId { id, known: 1 << 18 }));
    assert!(broad_phase.remove((1 << 18) - 1));
    for ids in [1 << 18, 4] {
        broad_phase.shrink_to_fit();
        assert_eq!(broad_phase.id_count(), ids, "ids are known until the update after their removal");
        broad_phase.update().expect("no pairs");
    }
}

#[test]
fn finders_and_broad_phases_can_be_sent_and_shared() {
    fn is_send_and_sync<T: Send + Sync + Clone + Default>() {}
    is_send_and_sync::<BroadPhase>();
    is_send_and_sync::<crate::Finder>();
}

/// Boxes of one body, of which some grow as large as the world.
#[test]
fn look_ups_given_up_cost_at_most_64_tests_a_box() {
    let n = 9000u32;
    let filter = ProxyFilter { body: 1, ..ProxyFilter::ALL };
    let (mut broad_phase, mut finder) = (BroadPhase::default(), crate::Finder::default());
    for (boxes, half) in [(n, 0.4), (n / 21, 40.0)] {
        (0..boxes).for_each(|id| broad_phase.set(id, cube(lattice(id, 20), half), filter).unwrap());
        broad_phase.update().unwrap();
    }
    finder.find_filtered(broad_phase.fat_aabbs(), &vec![filter; n as usize]).unwrap();
    let [update, search] = [broad_phase.report(), finder.report()].map(|report| report.work);
    assert!(update > search + 6 * u64::from(n), "{update}: no look-up was given up");
    assert!(update <= search + 64 * u64::from(n), "{update}, and {search} in a search");
}

/// Known and new ids, ids that are left alone, changed filters, boxes that become invalid, and a closure that panics.
#[test]
fn many_boxes_set_on_threads_are_those_set_one_by_one() {
    let n = 40_000;
    let place = |id: u32, round: u32| {
        let by = if (id + round).is_multiple_of(3) { 0.3 * round as f32 } else { 0.0 };
        let is_valid = !(id + round).is_multiple_of(97);
        let at = lattice(id, 40).map(|x| 1.1 * x + by);
        let aabb = if is_valid { cube(at, 0.5) } else { Aabb::NOWHERE };
        let body = if round > 1 && id.is_multiple_of(5) { id / 2 } else { ProxyFilter::ALL.body };
        (!(id * 7 + round).is_multiple_of(11)).then_some((aabb, ProxyFilter { body, ..ProxyFilter::ALL }))
    };
    let through_rounds = || {
        let (mut many, mut single) = (BroadPhase::default(), BroadPhase::default());
        for round in 0..5 {
            let ids: Vec<u32> = (0..n).filter(|id| round > 2 || id % 4 > round).collect();
            let was_there: Vec<bool> = (0..n).map(|id| single.contains(id)).collect();
            assert_eq!(many.set_many(&ids, |id| place(id, round)), Ok(()));
            let set = ids.iter().filter_map(|id| place(*id, round).map(|(aabb, filter)| (*id, aabb, filter)));
            set.for_each(|(id, aabb, filter)| single.set(id, aabb, filter).unwrap());
            // In the same order, but those that are inserted come last.
            let changes = [&many, &single].map(|one| {
                let (known, new): (Vec<u32>, Vec<u32>) =
                    one.changes().iter().partition(|id| was_there[**id as usize]);
                [known, new].concat()
            });
            assert_eq!(changes[0], changes[1], "round {round}");
            assert_eq!(many.world.noted.arrived, single.world.noted.arrived, "round {round}");
            assert_eq!(many.update(), single.update(), "round {round}");
            assert_eq!(many.report().invalid, single.report().invalid, "round {round}");
        }
        many
    };
    for (threads, at) in [(1, n - 5), (2, 5), (2, n - 5), (4, n - 5)] {
        on_threads(threads, || {
            let (mut many, ids) = (through_rounds(), (0..n).collect::<Vec<u32>>());
            let planted = |id: u32| if id == at { panic!("planted") } else { place(id, 7) };
            let panics = std::panic::AssertUnwindSafe(|| many.set_many(&ids, planted));
            assert!(std::panic::catch_unwind(panics).is_err());
            // The boxes that were set before the panic are not lost.
            many.update().unwrap();
            let filters: Vec<_> =
                ids.iter().map(|id| many.filter(*id).copied().unwrap_or_default()).collect();
            let mut finder = crate::Finder::default();
            let wanted = finder.find_filtered(many.fat_aabbs(), &filters).unwrap();
            assert!(many.pairs().eq(wanted.iter().copied()), "{threads} threads");
        });
    }
    let ids: Vec<u32> = (0..20_000).chain([1 << 28]).collect();
    let mut broad_phase = BroadPhase::default();
    let far = broad_phase.set_many(&ids, |id| place(id, 0));
    assert!(matches!(far, Err(Error::TooManyBoxes { .. })), "{far:?}");
    assert!(broad_phase.len() > 18_000, "the others are set");
}

/// Jumps are not tried to be looked up again and again. After them the tree is in a bad order, which takes some updates to be known.
#[test]
fn boxes_that_jump_are_searched_and_those_that_move_are_looked_up() {
    let (n, mut random) = (3000, StdRng::seed_from_u64(4));
    let mut broad_phase = BroadPhase::default();
    let mut centers = vec![[0.0f32; 3]; n];
    for round in 0..60 {
        let (is_first, jumps) = (round == 0, (5..30).contains(&round));
        let changed = (0..n as u32).filter(|id| is_first || (id + round).is_multiple_of(20));
        let moved = changed.map(|id| {
            let center = &mut centers[id as usize];
            *center = if jumps || is_first {
                random_point(&mut random, 0.0..40.0)
            } else {
                center.map(|x| x + 0.3)
            };
            (id, cube(*center, 0.5))
        });
        update(&mut broad_phase, moved);
        let is_look_up = algorithm(&broad_phase) == Algorithm::LookUp;
        let is_unknown = (30..34).contains(&round);
        assert!(is_look_up != (jumps || is_first) || is_unknown, "update {round}");
    }
    assert_right(&broad_phase, "the last update");
}

/// Boxes that are set again and again, or come and go before an update; that are removed and set where they were; points, whose
/// every move counts as a jump, because they have no edges.
#[test]
fn boxes_that_need_no_new_places_are_looked_up_whatever_is_done_with_them() {
    let n = 4000;
    let at = |id: u32, edge: f32, by: f32| {
        let apart = (id * 7919 % 101) as f32 / 101.0;
        (id, cube(lattice(id, 20).map(|x| 2.0 * x + apart + by), 0.5 * edge))
    };
    let few = |round: u32| (0..n).filter(move |id| (id + round).is_multiple_of(20));
    let again = |of: &mut BroadPhase, round: u32| {
        for by in [30.0, 0.0, 30.0, 0.1] {
            set(of, few(round).take(20).map(|id| at(id, 1.0, by)));
        }
    };
    let for_a_moment = |of: &mut BroadPhase, round: u32| {
        set(of, (0..400).map(|id| (n + id, at(id, 1.0, 0.5).1)));
        (n..n + 400).for_each(|id| assert!(of.remove(id)));
        set(of, few(round).take(5).map(|id| at(id, 1.0, 0.2)));
    };
    let back = |of: &mut BroadPhase, round: u32| {
        few(round).for_each(|id| assert!(of.remove(id)));
        set(of, few(round).map(|id| at(id, 1.0, 0.01 * round as f32)));
    };
    let points = |of: &mut BroadPhase, round: u32| {
        set(of, few(round).map(|id| at(id, 0.0, 0.01 * (round + 1) as f32)));
    };
    type Change<'a> = &'a dyn Fn(&mut BroadPhase, u32);
    let changes: [Change<'_>; 4] = [&again, &for_a_moment, &back, &points];
    let names = [("again", 1.0), ("for a moment", 1.0), ("back", 1.0), ("points", 0.0)];
    for ((name, edge), change) in names.into_iter().zip(changes) {
        let mut broad_phase = BroadPhase::default();
        update(&mut broad_phase, (0..n).map(|id| at(id, edge, 0.0)));
        for round in 0..30 {
            change(&mut broad_phase, round);
            broad_phase.update().expect("few pairs");
            assert_eq!(algorithm(&broad_phase), Algorithm::LookUp, "{name}, update {round}");
        }
        assert_right(&broad_phase, name);
    }
}

/// A burst of boxes that come, then one change an update: the boxes of the burst get places once.
#[test]
fn few_changes_after_a_burst_are_looked_up() {
    let at = |id: u32, by: f32| (id, cube(lattice(id, 100), 0.4 + by));
    let mut broad_phase = BroadPhase::default();
    update(&mut broad_phase, (0..20_000).map(|id| at(id, 0.0)));
    update(&mut broad_phase, [at(0, 0.01)]);
    for burst in 0..4 {
        update(&mut broad_phase, (0..800).map(|id| at(20_000 + 800 * burst + id, 0.0)));
        for round in 0..20 {
            update(&mut broad_phase, [at(round % 10, 0.02 + 0.001 * round as f32)]);
            let is_look_up = algorithm(&broad_phase) == Algorithm::LookUp;
            assert!(is_look_up, "burst {burst}, update {round}");
            assert!(round == 0 || broad_phase.report().work < 2000, "{}", broad_phase.report().work);
        }
    }
    // A group that jumps and then stays in motion, and after it all that do.
    for (group, far) in [(800, 300.0), (20_000, 1000.0)] {
        let mut looked_up = 0;
        for round in 0..20 {
            let (moved, by) = (if round == 0 { group } else { 800 }, far + round as f32 * 0.1);
            let place = |id: u32| (id, cube(lattice(id, 100).map(|x| x + by), 0.4));
            update(&mut broad_phase, (0..moved).map(place));
            looked_up += u32::from(algorithm(&broad_phase) == Algorithm::LookUp);
        }
        assert!(looked_up >= 8, "{group} jump: {looked_up} of 20 updates looked up");
    }
}

/// Boxes that change again before an update are not listed twice, but the tree learns of it.
#[test]
fn the_tree_knows_boxes_that_threads_set_twice() {
    let n = 20_000;
    let at = |id: u32, by: f32| cube(lattice(id, 30).map(|x| x * 1.5 + by), 0.5);
    let ids: Vec<u32> = (0..n).collect();
    let mut broad_phase = BroadPhase::default();
    for by in [0.0, 100.0] {
        broad_phase.set_many(&ids, |id| Some((at(id, by), ProxyFilter::ALL))).unwrap();
        let is_met = [0.0, 100.0].map(|at_by| broad_phase.overlapping(&at(7, at_by)).contains(&7));
        assert_eq!(is_met, [by == 0.0, by == 100.0]);
    }
    broad_phase.update().unwrap();
    update(&mut broad_phase, [(7, at(8, 100.1))]);
    assert_eq!(algorithm(&broad_phase), Algorithm::LookUp);
    assert!(broad_phase.pairs().eq(crate::find_pairs(broad_phase.fat_aabbs()).expect("few pairs")));
    let last = [&ids[..], &[u32::MAX]].concat();
    let far = broad_phase.set_many(&last, |id| Some((at(id % n, 0.0), ProxyFilter::ALL)));
    assert!(matches!(far, Err(Error::TooManyBoxes { .. })), "{far:?}");
}

/// The work of what was given up does not depend on where threads stop.
#[test]
fn reports_of_given_up_ways_do_not_depend_on_threads() {
    let needles = crate::fixtures::needles(30_000);
    let grown = |id: u32, by: f32| (id, cube(lattice(id, 40).map(|x| x * 1.5), 0.1 + by));
    let told = |threads: usize| {
        on_threads(threads, || {
            let mut finder = crate::Finder::default();
            finder.find(&needles).unwrap();
            let mut told = vec![(finder.report().work, finder.report().plan.algorithm)];
            let (count, mut broad_phase) = (std::sync::atomic::AtomicU64::new(0), BroadPhase::default());
            let visit = |_| _ = count.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            assert_eq!(finder.for_each_pair(&needles, visit), Ok(count.into_inner()));
            told.push((finder.report().work, finder.report().plan.algorithm));
            for (from, to, by) in
                [(0, 30_000, 0.0), (0, 1, 0.01), (0, 3000, 8.0), (0, 3000, 0.001), (5, 6, 0.2)]
            {
                update(&mut broad_phase, (from..to).map(|id| grown(id, by)));
                told.push((broad_phase.report().work, algorithm(&broad_phase)));
            }
            told
        })
    };
    let one = told(1);
    assert!((0..4).all(|_| told(2) == one && told(4) == one), "{one:?}");
}

/// Streamed segment trees leave no tree: queries and look-ups after them must not read that of an earlier search.
#[test]
fn a_search_by_streams_leaves_no_old_tree() {
    let mut random = StdRng::seed_from_u64(4);
    let mut broad_phase = BroadPhase::default();
    let mut any = || cube(random_point(&mut random, 0.0..30.0), 0.5);
    for round in 0..12 {
        set(&mut broad_phase, (0..5000).step_by(if round % 3 == 2 { 100 } else { 1 }).map(|id| (id, any())));
        match round % 6 {
            0 => broad_phase.config.engine = Some(Engine::Tree),
            1 | 3 | 4 => {
                broad_phase.config.engine = None;
                broad_phase.search.give_up_grids_and_trees();
            }
            _ => broad_phase.config.engine = Some(Engine::LookUp),
        }
        broad_phase.update().unwrap();
        assert_right(&broad_phase, &format!("round {round}"));
        let asked = any().inflated(2.0);
        let wanted = (0..5000).filter(|id| broad_phase.fat_aabbs()[*id as usize].overlaps(&asked));
        assert!(met(&broad_phase, &asked).into_iter().eq(wanted), "round {round}");
    }
}
