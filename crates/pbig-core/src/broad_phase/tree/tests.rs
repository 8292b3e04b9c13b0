use crate::fixtures::{lattice, met, random_point, update};
use crate::{Aabb, Algorithm, BroadPhase, ProxyFilter};
use rand::SeedableRng;
use rand::rngs::StdRng;
use std::sync::{Barrier, mpsc};
use std::time::Duration;

/// Enough boxes for a refit to share its work.
const BOXES: u32 = 40_000;

fn cube(id: u32, time: f32) -> Aabb {
    let [x, y, z] = lattice(id, 40).map(|x| 2.0 * x);
    Aabb::from_center([x + time, y, z], [0.5; 3])
}

fn step(broad_phase: &mut BroadPhase, time: f32, step: usize) {
    update(broad_phase, (0..BOXES).step_by(step).map(|id| (id, cube(id, time))));
}

/// Asks on a thread outside the pool and on all of the pool at once.
fn ask_together(ask: &(impl Fn() + Sync)) {
    let together = Barrier::new(rayon::current_num_threads() + 1);
    let ask = || {
        together.wait();
        ask();
    };
    std::thread::scope(|scope| {
        scope.spawn(ask);
        rayon::broadcast(|_| ask());
    });
}

/// Asserts that work comes to an end.
fn ends(work: impl FnOnce() + Send + 'static) {
    let (sender, receiver) = mpsc::channel();
    std::thread::spawn(move || {
        work();
        sender.send(()).expect("the test waits");
    });
    receiver.recv_timeout(Duration::from_secs(300)).expect("no thread waits for ever");
}

/// A thread that refits the tree must not wait for one of the pool, because all of these may wait for the refit.
#[test]
fn a_thread_refits_the_tree_although_all_of_the_pool_wait_for_it() {
    ends(|| {
        let mut broad_phase = BroadPhase::default();
        for time in 0..100 {
            step(&mut broad_phase, time as f32, 1);
            // A change after the update makes the tree stale.
            broad_phase.set_aabb(0, cube(0, time as f32 + 0.1));
            ask_together(&|| assert_eq!(met(&broad_phase, &cube(7, time as f32)), [7]));
        }
    });
}

/// The first question for the pairs of a box after a search makes backward rows, by the same rule.
#[test]
fn a_thread_makes_backward_rows_although_all_of_the_pool_wait_for_them() {
    ends(|| {
        let mut broad_phase = BroadPhase::default();
        for time in 0..40 {
            let boxes = (0..BOXES).map(|id| (id, cube(id, 0.1 * time as f32).inflated(0.51)));
            update(&mut broad_phase, boxes);
            ask_together(&|| assert!(broad_phase.pairs_of(777).count() > 3));
        }
    });
}

#[test]
fn an_update_refits_the_tree_only_for_queries_like_those_since_the_last_one() {
    let (mut broad_phase, mut fresh) = (BroadPhase::default(), vec![]);
    for time in 0..6 {
        step(&mut broad_phase, time as f32, 1);
        fresh.push(broad_phase.world.tree.fresh.get().is_some());
        if [1, 2].contains(&time) {
            assert_eq!(met(&broad_phase, &cube(77, time as f32)), [77]);
        }
    }
    assert_eq!(fresh, [false, false, true, true, false, false]);
}

/// Boxes of several sizes and shapes, in parts of the tree of several heights. Some jump, some go, some come back elsewhere, and after
/// a while all move. Answers are those of a scan, and pairs those of a search from nothing.
#[test]
fn jumps_and_returns_among_many_sizes_are_known_exactly() {
    let n = 18_000u32;
    let mut random = StdRng::seed_from_u64(8);
    let mut any = |id: u32| {
        let at = random_point(&mut random, 0.0..60.0);
        let size = [0.3, 0.5, 6.0, 0.5, 0.02][id as usize % 5];
        let flat = if id.is_multiple_of(7) { 0.01 } else { 1.0 };
        Aabb::from_center(at, [size, size * flat, size])
    };
    let (mut broad_phase, mut finder) = (BroadPhase::default(), crate::Finder::default());
    (0..n).for_each(|id| broad_phase.set(id, any(id), ProxyFilter::ALL).expect("a small id"));
    let mut looked_up = 0;
    for update in 0..30u32 {
        let (changed, by) = ([3, 200, 900, n][update as usize % 4], update * 577);
        for id in (0..changed).map(|i| (i * 13 + by) % n) {
            match (id + update) % 4 {
                0 => _ = broad_phase.remove(id),
                1 => broad_phase.set(id, any(id), ProxyFilter::ALL).expect("a small id"),
                _ if broad_phase.contains(id) => {
                    let aabb = broad_phase.fat_aabb(id).map_or(Aabb::NOWHERE, |aabb| aabb.inflated(0.01));
                    broad_phase.set(id, aabb, ProxyFilter::ALL).expect("a small id");
                }
                _ => {}
            }
        }
        broad_phase.update().expect("few pairs");
        looked_up += u32::from(broad_phase.report().plan.algorithm == Algorithm::LookUp);
        let found = finder.find(broad_phase.fat_aabbs()).expect("few pairs");
        assert!(broad_phase.pairs().eq(found.iter().copied()), "update {update}");
        for _ in 0..5 {
            let asked = any(3);
            let scanned =
                (0..n).filter(|id| broad_phase.fat_aabb(*id).is_some_and(|aabb| aabb.overlaps(&asked)));
            assert!(met(&broad_phase, &asked).into_iter().eq(scanned), "update {update}");
        }
    }
    assert!(looked_up >= 10, "{looked_up} updates looked changed boxes up");
}
