//! Updates that the suite does not reach from outside: their work, the ways they take, their threads. `tests/suite/incremental.rs` follows
//! random worlds with every engine.

use crate::{Aabb, Algorithm, BroadPhase, Config, Engine, Error, Pair, ProxyFilter, oracle};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

#[test]
fn many_gone_and_one_new_take_few_tests() {
    let at = |x: u32| Aabb::from_center([3.0 * x as f32, 0.0, 0.0], [1.0; 3]);
    let mut broad_phase =
        BroadPhase::new(Config { engine: Some(Engine::LookUp), ..Config::DEFAULT }).expect("a margin");
    (0..2000).for_each(|id| broad_phase.set(id, at(id), ProxyFilter::ALL).expect("few boxes"));
    broad_phase.update().expect("few pairs");
    (0..1900).for_each(|id| _ = broad_phase.remove(id));
    broad_phase.set(2000, at(2000), ProxyFilter::ALL).expect("few boxes");
    broad_phase.update().expect("few pairs");
    let work = broad_phase.report().work;
    assert!(work < 20_000, "{work} tests for 101 boxes");
}

#[test]
fn boxes_are_counted_and_given_back() {
    let mut broad_phase = BroadPhase::default();
    let cube = Aabb::new([0.0; 3], [1.0; 3]);
    for id in [0, 5, 7] {
        broad_phase.set(id, cube, ProxyFilter::ALL).expect("room");
    }
    assert_eq!((broad_phase.len(), broad_phase.get(5)), (3, Some((cube, ProxyFilter::ALL))));
    assert_eq!(broad_phase.update().expect("three pairs").added.len(), 3);
    let other = ProxyFilter { mask: 0, ..ProxyFilter::ALL };
    assert!(broad_phase.set_filter(7, other) && !broad_phase.set_filter(6, other));
    assert_eq!(broad_phase.update().expect("one pair").removed.len(), 2);
    assert!(broad_phase.remove(7) && !broad_phase.remove(7));
    broad_phase.shrink_to_fit();
    assert_eq!(broad_phase.update().expect("one pair").removed, []);
    broad_phase.shrink_to_fit();
    assert_eq!((broad_phase.id_count(), broad_phase.pair_count()), (6, 1));
    broad_phase.clear();
    assert!(broad_phase.is_empty() && broad_phase.pair_count() == 0 && broad_phase.id_count() == 0);
}

/// Small boxes by the thousand within one large box's volume, with one of `gap` ids each.
fn crowded(broad_phase: &mut BroadPhase, ids: std::ops::Range<u32>, gap: u32, shift: f32) {
    for id in ids {
        let at = [id % 20, id / 20 % 20, id / 400].map(|i| i as f32 * 0.05 + shift);
        let half = if id % 10 == 0 { [0.5; 3] } else { [0.02; 3] };
        let at = if id % 10 == 0 { at.map(|x| x * 100.0) } else { at };
        broad_phase.set(id * gap, Aabb::from_center(at, half), ProxyFilter::ALL).expect("few boxes");
    }
}

#[test]
fn a_clone_goes_on_as_the_original() {
    for gap in [1, 3] {
        let mut broad_phase = BroadPhase::default();
        crowded(&mut broad_phase, 0..8000, gap, 0.0);
        broad_phase.update().expect("few pairs");
        assert_eq!(broad_phase.report().plan.algorithm, Algorithm::Tree);
        let mut clone = broad_phase.clone();
        for one in [&mut broad_phase, &mut clone] {
            crowded(one, 100..200, gap, 0.01);
            // An id that had no box before, if there are gaps.
            one.set(1, Aabb::from_center([0.3; 3], [0.1; 3]), ProxyFilter::ALL).expect("few boxes");
            one.update().expect("few pairs");
            assert_eq!(one.report().plan.algorithm, Algorithm::LookUp);
            assert!(one.pairs().eq(oracle::pairs(one.fat_aabbs())));
        }
        assert_eq!(broad_phase.events(), clone.events());
    }
}

#[test]
fn an_id_far_above_the_others_is_an_error_and_takes_no_memory() {
    let mut broad_phase = BroadPhase::default();
    let cube = Aabb::new([0.0; 3], [1.0; 3]);
    broad_phase.set(3, cube, ProxyFilter::ALL).expect("a small id");
    let id = 100_000_000;
    assert_eq!(broad_phase.set(id, cube, ProxyFilter::ALL), Err(Error::SparseId { id, known: 4 }));
    assert_eq!((broad_phase.len(), broad_phase.id_count()), (1, 4));
    broad_phase.set((1 << 18) - 1, cube, ProxyFilter::ALL).expect("an id that costs 16 MB");
    // One more than 64 times the known ids.
    let id = (1 << 24) + 1;
    assert_eq!(broad_phase.set(id, cube, ProxyFilter::ALL), Err(Error::SparseId { id, known: 1 << 18 }));
}

#[test]
fn finders_and_broad_phases_can_be_sent_and_shared() {
    fn is_send_and_sync<T: Send + Sync + Clone + Default>() {}
    is_send_and_sync::<BroadPhase>();
    is_send_and_sync::<crate::Finder>();
}

#[test]
fn pairs_of_a_removed_box_end_for_the_other_in_a_search() {
    let mut broad_phase = BroadPhase::default();
    let at = |i: u32, x: f32| Aabb::from_center([0.9 * i as f32 + x, 0.0, 0.0], [0.5; 3]);
    (0..3000).for_each(|i| broad_phase.set(3 * i, at(i, 0.0), ProxyFilter::ALL).expect("few boxes"));
    broad_phase.update().expect("few pairs");
    assert!(broad_phase.pairs_of(3).eq([Pair { a: 0, b: 3 }, Pair { a: 3, b: 6 }]));
    assert!(broad_phase.remove(0));
    (1..3000).for_each(|i| assert!(broad_phase.set_aabb(3 * i, at(i, 0.01))));
    broad_phase.update().expect("few pairs");
    assert_eq!(broad_phase.report().plan.algorithm, Algorithm::Grid);
    assert!(broad_phase.pairs_of(3).eq([Pair { a: 3, b: 6 }]));
}

/// Boxes of one body, of which some grow as large as the world.
#[test]
fn look_ups_given_up_cost_at_most_64_tests_a_box() {
    let n = 9000u32;
    let filter = ProxyFilter { body: 1, ..ProxyFilter::ALL };
    let cube = |id: u32, half: f32| {
        Aabb::from_center([id % 20, id / 20 % 20, id / 400].map(|x| x as f32), [half; 3])
    };
    let (mut broad_phase, mut finder) = (BroadPhase::default(), crate::Finder::default());
    (0..n).for_each(|id| broad_phase.set(id, cube(id, 0.4), filter).unwrap());
    broad_phase.update().unwrap();
    (0..n / 21).for_each(|id| broad_phase.set(id, cube(id, 40.0), filter).unwrap());
    broad_phase.update().unwrap();
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
        let at = [id % 40, id / 40 % 40, id / 1600].map(|x| x as f32 * 1.1);
        let by = if (id + round).is_multiple_of(3) { 0.3 * round as f32 } else { 0.0 };
        let is_valid = !(id + round).is_multiple_of(97);
        let aabb = if is_valid { Aabb::from_center(at.map(|x| x + by), [0.5; 3]) } else { Aabb::NOWHERE };
        let body = if round > 1 && id.is_multiple_of(5) { id / 2 } else { ProxyFilter::ALL.body };
        (!(id * 7 + round).is_multiple_of(11)).then_some((aabb, ProxyFilter { body, ..ProxyFilter::ALL }))
    };
    let through_rounds = || {
        let (mut many, mut single) = (BroadPhase::default(), BroadPhase::default());
        for round in 0..5 {
            let ids: Vec<u32> = (0..n).filter(|id| round > 2 || id % 4 > round).collect();
            assert_eq!(many.set_many(&ids, |id| place(id, round)), Ok(()));
            let set = ids.iter().filter_map(|id| place(*id, round).map(|(aabb, filter)| (*id, aabb, filter)));
            set.for_each(|(id, aabb, filter)| single.set(id, aabb, filter).unwrap());
            let mut changes = [many.changes().to_vec(), single.changes().to_vec()];
            changes.iter_mut().for_each(|changes| changes.sort_unstable());
            assert_eq!(changes[0], changes[1], "round {round}");
            assert_eq!(many.world.noted.arrived, single.world.noted.arrived, "round {round}");
            assert_eq!(many.update(), single.update(), "round {round}");
            assert_eq!(many.report().invalid, single.report().invalid, "round {round}");
        }
        many
    };
    for threads in [1, 2, 4] {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| {
            let (mut many, ids) = (through_rounds(), (0..n).collect::<Vec<u32>>());
            let planted = |id: u32| if id == n - 5 { panic!("planted") } else { place(id, 7) };
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
    assert!(matches!(far, Err(crate::Error::TooManyBoxes { .. })), "{far:?}");
    assert!(broad_phase.len() > 18_000, "the others are set");
}

/// Jumps are not tried to be looked up again and again. After them the tree is in a bad order, which takes some updates to be known.
#[test]
fn boxes_that_jump_are_searched_and_those_that_move_are_looked_up() {
    let (n, mut random) = (3000, StdRng::seed_from_u64(4));
    let mut broad_phase = BroadPhase::default();
    let mut centers = vec![[0.0f32; 3]; n];
    for update in 0..60 {
        let (is_first, jumps) = (update == 0, (5..30).contains(&update));
        for id in (0..n as u32).filter(|id| is_first || (id + update).is_multiple_of(20)) {
            let center = &mut centers[id as usize];
            *center = if jumps || is_first {
                [0; 3].map(|_| random.random_range(0.0..40.0))
            } else {
                center.map(|x| x + 0.3)
            };
            broad_phase.set(id, Aabb::from_center(*center, [0.5; 3]), ProxyFilter::ALL).expect("room");
        }
        broad_phase.update().expect("few pairs");
        let is_look_up = broad_phase.report().plan.algorithm == Algorithm::LookUp;
        let is_unknown = (30..34).contains(&update);
        assert!(is_look_up != (jumps || is_first) || is_unknown, "update {update}");
    }
    assert!(broad_phase.pairs().eq(oracle::pairs(broad_phase.fat_aabbs())));
}

/// Boxes that are set again and again, or come and go before an update; that are removed and set where they were; points, whose
/// every move counts as a jump, because they have no edges.
#[test]
fn boxes_that_need_no_new_places_are_looked_up_whatever_is_done_with_them() {
    let n = 4000;
    let at = |id: u32, edge: f32, by: f32| {
        let apart = (id * 7919 % 101) as f32 / 101.0;
        let center = [id % 20, id / 20 % 20, id / 400].map(|x| 2.0 * x as f32 + apart + by);
        Aabb::from_center(center, [0.5 * edge; 3])
    };
    let few = |update: u32| (0..n).filter(move |id| (id + update).is_multiple_of(20));
    let set = |of: &mut BroadPhase, id, aabb| of.set(id, aabb, ProxyFilter::ALL).expect("room");
    let again = |of: &mut BroadPhase, update: u32| {
        for by in [30.0, 0.0, 30.0, 0.1] {
            few(update).take(20).for_each(|id| set(of, id, at(id, 1.0, by)));
        }
    };
    let for_a_moment = |of: &mut BroadPhase, update: u32| {
        (n..n + 400).for_each(|id| set(of, id, at(id - n, 1.0, 0.5)));
        (n..n + 400).for_each(|id| assert!(of.remove(id)));
        few(update).take(5).for_each(|id| set(of, id, at(id, 1.0, 0.2)));
    };
    let back = |of: &mut BroadPhase, update: u32| {
        few(update).for_each(|id| assert!(of.remove(id)));
        few(update).for_each(|id| set(of, id, at(id, 1.0, 0.01 * update as f32)));
    };
    let points = |of: &mut BroadPhase, update: u32| {
        few(update).for_each(|id| set(of, id, at(id, 0.0, 0.01 * (update + 1) as f32)));
    };
    type Change<'a> = &'a dyn Fn(&mut BroadPhase, u32);
    let changes: [Change<'_>; 4] = [&again, &for_a_moment, &back, &points];
    let names = [("again", 1.0), ("for a moment", 1.0), ("back", 1.0), ("points", 0.0)];
    for ((name, edge), change) in names.into_iter().zip(changes) {
        let mut broad_phase = BroadPhase::default();
        (0..n).for_each(|id| set(&mut broad_phase, id, at(id, edge, 0.0)));
        broad_phase.update().expect("few pairs");
        for update in 0..30 {
            change(&mut broad_phase, update);
            broad_phase.update().expect("few pairs");
            assert_eq!(broad_phase.report().plan.algorithm, Algorithm::LookUp, "{name}, update {update}");
        }
        assert!(broad_phase.pairs().eq(oracle::pairs(broad_phase.fat_aabbs())), "{name}");
    }
}

/// A burst of boxes that come, then one change an update: the boxes of the burst get places once.
#[test]
fn few_changes_after_a_burst_are_looked_up() {
    let cube = |id: u32, by: f32| {
        Aabb::from_center([id % 100, id / 100 % 100, id / 10_000].map(|x| x as f32), [0.4 + by; 3])
    };
    let mut broad_phase = BroadPhase::default();
    let set = |of: &mut BroadPhase, id: u32, by: f32| of.set(id, cube(id, by), ProxyFilter::ALL).unwrap();
    (0..20_000).for_each(|id| set(&mut broad_phase, id, 0.0));
    broad_phase.update().unwrap();
    set(&mut broad_phase, 0, 0.01);
    broad_phase.update().unwrap();
    for burst in 0..4 {
        (0..800).for_each(|id| set(&mut broad_phase, 20_000 + 800 * burst + id, 0.0));
        broad_phase.update().unwrap();
        for update in 0..20 {
            set(&mut broad_phase, update % 10, 0.02 + 0.001 * update as f32);
            broad_phase.update().unwrap();
            assert_eq!(
                broad_phase.report().plan.algorithm,
                Algorithm::LookUp,
                "burst {burst}, update {update}"
            );
            assert!(update == 0 || broad_phase.report().work < 2000, "{}", broad_phase.report().work);
        }
    }
    // A group that jumps and then stays in motion, and after it all that do.
    for (group, far) in [(800, 300.0), (20_000, 1000.0)] {
        let place = |id: u32, by: f32| {
            let Aabb { min, max } = cube(id, 0.0);
            Aabb::new(min.map(|x| x + far + by), max.map(|x| x + far + by))
        };
        let mut looked_up = 0;
        for update in 0..20 {
            let moved = if update == 0 { group } else { 800 };
            let by = update as f32 * 0.1;
            (0..moved).for_each(|id| broad_phase.set(id, place(id, by), ProxyFilter::ALL).unwrap());
            broad_phase.update().unwrap();
            looked_up += u32::from(broad_phase.report().plan.algorithm == Algorithm::LookUp);
        }
        assert!(looked_up >= 8, "{group} jump: {looked_up} of 20 updates looked up");
    }
}

/// Boxes that change again before an update are not listed twice, but the tree learns of it.
#[test]
fn the_tree_knows_boxes_that_threads_set_twice() {
    let n = 20_000;
    let cube = |id: u32, by: f32| {
        Aabb::from_center([id % 30, id / 30 % 30, id / 900].map(|x| x as f32 * 1.5 + by), [0.5; 3])
    };
    let ids: Vec<u32> = (0..n).collect();
    let mut broad_phase = BroadPhase::default();
    broad_phase.set_many(&ids, |id| Some((cube(id, 0.0), ProxyFilter::ALL))).unwrap();
    assert!(broad_phase.overlapping(&cube(7, 0.0)).contains(&7));
    broad_phase.set_many(&ids, |id| Some((cube(id, 100.0), ProxyFilter::ALL))).unwrap();
    assert!(
        broad_phase.overlapping(&cube(7, 0.0)).is_empty()
            && broad_phase.overlapping(&cube(7, 100.0)).contains(&7)
    );
    broad_phase.update().unwrap();
    broad_phase.set(7, cube(8, 100.1), ProxyFilter::ALL).unwrap();
    broad_phase.update().unwrap();
    assert_eq!(broad_phase.report().plan.algorithm, Algorithm::LookUp);
    assert!(broad_phase.pairs().eq(oracle_of(&broad_phase)));
    let last = [&ids[..], &[u32::MAX]].concat();
    let far = broad_phase.set_many(&last, |id| Some((cube(id % n, 0.0), ProxyFilter::ALL)));
    assert!(matches!(far, Err(Error::TooManyBoxes { .. })), "{far:?}");
}

fn oracle_of(broad_phase: &BroadPhase) -> Vec<Pair> {
    crate::find_pairs(broad_phase.fat_aabbs()).expect("few pairs")
}

/// The work of what was given up does not depend on where threads stop.
#[test]
fn reports_of_given_up_ways_do_not_depend_on_threads() {
    let needles = crate::bvh::tests::needles(30_000);
    let grown = |id: u32, by: f32| {
        Aabb::from_center([id % 40, id / 40 % 40, id / 1600].map(|x| x as f32 * 1.5), [0.1 + by; 3])
    };
    let told = |threads: usize| {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| {
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
                (from..to).for_each(|id| broad_phase.set(id, grown(id, by), ProxyFilter::ALL).unwrap());
                broad_phase.update().unwrap();
                told.push((broad_phase.report().work, broad_phase.report().plan.algorithm));
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
    let mut broad_phase = BroadPhase::new(Config { engine: None, ..Config::DEFAULT }).unwrap();
    let mut any = || Aabb::from_center([0; 3].map(|_| random.random_range(0.0f32..30.0)), [0.5; 3]);
    for round in 0..12 {
        let few = round % 3 == 2;
        for id in (0..5000).filter(|id| !few || id % 100 == 0) {
            broad_phase.set(id, any(), ProxyFilter::ALL).unwrap();
        }
        match round % 6 {
            0 => broad_phase.config.engine = Some(Engine::Tree),
            1 | 3 | 4 => {
                broad_phase.config.engine = None;
                broad_phase.search.give_up_grids_and_trees();
            }
            _ => broad_phase.config.engine = Some(Engine::LookUp),
        }
        broad_phase.update().unwrap();
        assert!(broad_phase.pairs().eq(oracle::pairs(broad_phase.fat_aabbs())), "round {round}");
        let asked = any().inflated(2.0);
        let mut met = broad_phase.overlapping(&asked);
        met.sort_unstable();
        let wanted = (0..5000).filter(|id| broad_phase.fat_aabbs()[*id as usize].overlaps(&asked));
        assert!(met.into_iter().eq(wanted), "round {round}");
    }
}
