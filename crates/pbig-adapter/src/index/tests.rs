use super::*;
use pbig_core::ProxyFilter;
use std::sync::{Barrier, mpsc};
use std::time::Duration;

/// Enough boxes for a refresh to share its work.
const BOXES: u32 = 40_000;

fn cube(id: u32, time: f32) -> Aabb {
    let place = [id % 40, id / 40 % 40, id / 1600].map(|x| 2.0 * x as f32);
    Aabb::from_center([place[0] + time, place[1], place[2]], [0.5; 3])
}

fn step(core: &mut BroadPhase, index: &mut SceneIndex, time: f32) {
    for id in 0..BOXES {
        core.set(id, cube(id, time), ProxyFilter::ALL).expect("an id below the limit");
    }
    index.note(core.changes(), BOXES);
}

fn met(core: &BroadPhase, index: &SceneIndex, aabb: &Aabb) -> Vec<u32> {
    let mut met = vec![];
    index.ask(core, |index| index.overlapping(aabb, |id| met.push(id)));
    met
}

/// A thread that refreshes the index must not wait for one of the pool, because all of these may wait for the refresh.
#[test]
fn a_thread_refreshes_the_index_although_all_of_the_pool_wait_for_it() {
    let (sender, receiver) = mpsc::channel();
    std::thread::spawn(move || {
        let (mut core, mut index) = (BroadPhase::default(), SceneIndex::default());
        let together = Barrier::new(rayon::current_num_threads() + 1);
        for time in 0..100 {
            step(&mut core, &mut index, time as f32);
            core.update().expect("no pairs");
            let ask = || {
                together.wait();
                assert_eq!(met(&core, &index, &cube(7, time as f32)), [7]);
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
fn an_update_prepares_the_index_only_for_queries_like_those_since_the_last_one() {
    let (mut core, mut index) = (BroadPhase::default(), SceneIndex::default());
    let mut prepared = vec![];
    for time in 0..6 {
        step(&mut core, &mut index, time as f32);
        index.prepare(&core);
        prepared.push(index.fresh.get().is_some());
        core.update().expect("no pairs");
        if [1, 2].contains(&time) {
            assert_eq!(met(&core, &index, &cube(77, time as f32)), [77]);
        }
    }
    assert_eq!(prepared, [false, false, true, true, false, false]);
}
