use crate::{Aabb, BroadPhase, ProxyFilter};
use std::sync::{Barrier, mpsc};
use std::time::Duration;

/// Enough boxes for a refit to share its work.
const BOXES: u32 = 40_000;

fn cube(id: u32, time: f32) -> Aabb {
    let place = [id % 40, id / 40 % 40, id / 1600].map(|x| 2.0 * x as f32);
    Aabb::from_center([place[0] + time, place[1], place[2]], [0.5; 3])
}

fn step(broad_phase: &mut BroadPhase, time: f32, step: usize) {
    for id in (0..BOXES).step_by(step) {
        broad_phase.set(id, cube(id, time), ProxyFilter::ALL).expect("an id below the limit");
    }
    broad_phase.update().expect("no pairs");
}

fn met(broad_phase: &BroadPhase, aabb: &Aabb) -> Vec<u32> {
    let mut met = broad_phase.overlapping(aabb);
    met.sort_unstable();
    met
}

/// Whoever refits must not wait for a thread of the pool, because all of them may wait for the refit.
#[test]
fn a_thread_refits_the_tree_although_all_of_the_pool_wait_for_it() {
    let (sender, receiver) = mpsc::channel();
    std::thread::spawn(move || {
        let mut broad_phase = BroadPhase::default();
        let together = Barrier::new(rayon::current_num_threads() + 1);
        for time in 0..100 {
            step(&mut broad_phase, time as f32, 1);
            // So that the update has not made it fresh.
            broad_phase.set_aabb(0, cube(0, time as f32 + 0.1));
            let ask = || {
                together.wait();
                assert_eq!(met(&broad_phase, &cube(7, time as f32)), [7]);
            };
            std::thread::scope(|scope| {
                scope.spawn(ask);
                rayon::broadcast(|_| ask());
            });
        }
        sender.send(()).expect("the test waits");
    });
    receiver.recv_timeout(Duration::from_secs(300)).expect("no thread waits for ever");
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

/// Look-ups and queries share the tree, which knows each change: between updates, within one and after several.
#[test]
fn the_tree_knows_all_changes() {
    let mut broad_phase = BroadPhase::default();
    let all = Aabb::new([f32::MIN; 3], [f32::MAX; 3]);
    for time in 0..40u32 {
        let now = time as f32 / 8.0;
        step(&mut broad_phase, now, [1, 9, 100, 2000][time as usize % 4]);
        if time % 3 == 0 {
            let id = 37 * time;
            broad_phase.remove(id);
            assert_eq!(met(&broad_phase, &all).len(), broad_phase.len());
            broad_phase.set(id, cube(id, now), ProxyFilter::ALL).expect("an id below the limit");
        }
        for id in (0..BOXES).step_by(997 + time as usize) {
            let fat = broad_phase.fat_aabb(id).expect("a box");
            assert!(met(&broad_phase, &fat).contains(&id), "update {time}, box {id}");
        }
    }
}
