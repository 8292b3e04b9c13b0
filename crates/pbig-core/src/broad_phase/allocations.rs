//! Steady state asks for no memory: every allocation of this thread is counted, or of all threads of a pool.

use crate::{Aabb, BroadPhase, Config, ProxyFilter, Study, Updates};
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

/// The system's allocator, with counters for each thread. (The harness has another one, for what holds memory; this crate
/// does not depend on it, not even for tests, as these run on targets for which the harness is not built.)
struct Counting;

thread_local! {
    static COUNT: Cell<u64> = const { Cell::new(0) };
    /// Bytes asked for.
    static BYTES: Cell<u64> = const { Cell::new(0) };
}

fn note(bytes: usize) {
    COUNT.set(COUNT.get() + 1);
    BYTES.set(BYTES.get() + bytes as u64);
}

// SAFETY: all is left to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        note(layout.size());
        // SAFETY: the caller's promise.
        unsafe { System.alloc(layout) }
    }

    unsafe fn realloc(&self, old: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        note(size);
        // SAFETY: the caller's promise.
        unsafe { System.realloc(old, layout, size) }
    }

    unsafe fn dealloc(&self, old: *mut u8, layout: Layout) {
        // SAFETY: the caller's promise.
        unsafe { System.dealloc(old, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// Allocations, and bytes that they asked for.
type Counts = [u64; 2];

/// Of the queue by which threads share work and what they find there, or of small lists that grow, at most.
const FEW: Counts = [20, 16_384];

/// So far, of a pool or of this thread.
fn counts(pool: Option<&ThreadPool>) -> Counts {
    let of_thread = || [COUNT.get(), BYTES.get()];
    let add = |sum: Counts, of: Counts| [sum[0] + of[0], sum[1] + of[1]];
    pool.map_or_else(of_thread, |pool| pool.broadcast(|_| of_thread()).into_iter().fold([0; 2], add))
}

fn since(before: Counts, pool: Option<&ThreadPool>) -> Counts {
    let now = counts(pool);
    [now[0] - before[0], now[1] - before[1]]
}

fn are_few(counted: Counts) -> bool {
    counted[0] <= FEW[0] && counted[1] <= FEW[1]
}

fn on<R: Send>(pool: Option<&ThreadPool>, work: impl FnOnce() -> R + Send) -> R {
    match pool {
        Some(pool) => pool.install(work),
        None => work(),
    }
}

/// Boxes that swing to and fro, so that pairs come and go and later frames need no more room than earlier ones.
fn place(id: u32, frame: u32, boxes: u32) -> Aabb {
    let edge = (2 * boxes) as f32;
    let at =
        |k: u32| (id.wrapping_mul(2_654_435_761).rotate_left(11 * k) % 4096) as f32 / 4096.0 * edge.cbrt();
    let swing = if frame.is_multiple_of(2) { 0.0 } else { 0.3 };
    Aabb::from_center([at(0) + swing, at(1), at(2) - swing], [0.5; 3])
}

/// Of an update in which one in `share` boxes moves: the most of any in 40, after as many to warm up.
fn most(boxes: u32, share: u32, pool: Option<&ThreadPool>) -> Counts {
    // Which way many go depends on time, as whose turn it is does, and the first to go one makes room.
    let updates = match pool {
        None => Updates::Auto,
        Some(_) if share >= 20 => Updates::Edits,
        Some(_) => Updates::Near,
    };
    let study = Study { updates, ..Study::DEFAULT };
    let config = Config { margin: 0.01, study, ..Config::DEFAULT };
    let mut broad_phase = BroadPhase::new(config).expect("a margin");
    broad_phase.small.turns = super::turns::Turns::none();
    let (mut most, mut events) = ([0; 2], 0);
    for frame in 0..80 {
        let step = if frame == 0 { 1 } else { share };
        let ids: Vec<u32> = (0..boxes).step_by(step as usize).collect();
        let before = counts(pool);
        on(pool, || {
            let at = |id| Some((place(id, frame, boxes), ProxyFilter::ALL));
            broad_phase.set_many(&ids, |id| id, at).expect("small ids");
            broad_phase.update().map(|_| ()).expect("few pairs");
        });
        let counted = since(before, pool);
        events += broad_phase.events().added.len() + broad_phase.events().removed.len();
        if frame >= 40 {
            most = [most[0].max(counted[0]), most[1].max(counted[1])];
        }
    }
    assert!(events > 40, "{events} events");
    most
}

#[test]
fn an_update_like_those_before_allocates_nothing() {
    for (boxes, share) in [(60, 1), (500, 1), (5000, 1)] {
        assert_eq!(most(boxes, share, None), [0; 2], "{boxes} boxes, one in {share} moves");
    }
}

#[test]
fn nor_does_one_in_which_few_boxes_move() {
    for (boxes, share) in [(500, 50), (5000, 100), (5000, 20)] {
        assert_eq!(most(boxes, share, None), [0; 2], "{boxes} boxes, one in {share} moves");
    }
}

#[test]
fn where_threads_share_work_they_only_ask_for_what_hands_it_over() {
    let pool = ThreadPoolBuilder::new().num_threads(2).build().expect("a pool");
    for share in [20, 2, 1] {
        let most = most(50_000, share, Some(&pool));
        assert!(are_few(most), "{most:?} where one in {share} moves");
    }
}

/// One box in `share` goes on and on, so that lists of near pairs are made anew: in the second half of the updates the lists,
/// and the updates that ask for more than a few small lists do.
fn lists_and_requests(boxes: u32, share: usize) -> (u32, u32) {
    let mut broad_phase = BroadPhase::new(Config { margin: 0.01, ..Config::DEFAULT }).expect("a margin");
    let edge = ((2 * boxes) as f32).cbrt();
    let (mut lists, mut requests) = (0, 0);
    for update in 0..400 {
        for id in (0..boxes).step_by(if update == 0 { 1 } else { share }) {
            let [x, y, z] = place(id, 0, boxes).min;
            let on = Aabb::from_center([(x + 0.05 * update as f32) % edge, y, z], [0.5; 3]);
            broad_phase.set(id, on, ProxyFilter::ALL).expect("a small id");
        }
        // Whether lists pay is measured: not here.
        broad_phase.near.worth.pause = 0;
        let before = counts(None);
        if update % 16 == 0 {
            broad_phase.drop_near();
        }
        broad_phase.update().expect("few pairs");
        if update >= 200 {
            lists += u32::from(broad_phase.near.is_on && broad_phase.near.age == 1);
            requests += u32::from(!are_few(since(before, None)));
        }
    }
    (lists, requests)
}

#[test]
fn lists_of_near_pairs_that_are_made_anew_use_the_memory_of_those_before() {
    for (boxes, share) in [(5000, 1), (20_000, 10)] {
        let (lists, requests) = lists_and_requests(boxes, share);
        // The longest list so far may need more.
        assert!(lists >= 10 && 5 * requests < lists, "{lists} lists, {requests} requests, one in {share}");
    }
}

/// Boxes that circle about their places, so that lists are made anew, of bases that are planned anew: plans ask for no memory.
#[test]
fn nor_do_new_plans_of_boxes_that_circle() {
    let alone = ThreadPoolBuilder::new().num_threads(1).build().expect("a pool");
    let (plans, requests) = alone.install(plans_and_requests);
    // The longest list so far may need more.
    assert!(plans > 3 && 2 * requests < plans, "{plans} plans, {requests} requests");
}

fn plans_and_requests() -> (u32, u32) {
    const BOXES: u32 = 3000;
    let study = Study { updates: Updates::Near, ..Study::DEFAULT };
    let mut broad_phase = BroadPhase::new(Config { study, ..Config::DEFAULT }).expect("a margin");
    let (mut plans, mut requests, mut last) = (0, 0, broad_phase.report().plan.levels.first().copied());
    for update in 0..160 {
        for id in 0..BOXES {
            let (sin, cos) = (0.1 * update as f32 + id as f32).sin_cos();
            let by = |corner: [f32; 3]| [corner[0] + cos, corner[1] + sin, corner[2]];
            let Aabb { min, max } = place(id, 0, BOXES);
            broad_phase.set(id, Aabb::new(by(min), by(max)), ProxyFilter::ALL).expect("a small id");
        }
        let before = counts(None);
        if update % 4 == 0 {
            broad_phase.drop_near();
        }
        broad_phase.update().expect("few pairs");
        let level = broad_phase.report().plan.levels.first().copied();
        let is_new = level != std::mem::replace(&mut last, level);
        if update >= 80 {
            plans += u32::from(is_new);
            requests += u32::from(is_new && since(before, None) != [0; 2]);
        }
    }
    (plans, requests)
}

#[test]
fn allocations_are_counted() {
    let before = counts(None);
    let some = std::hint::black_box(vec![1u8; 100]);
    assert_eq!((since(before, None), some.len()), ([1, 100], 100));
    let pool = ThreadPoolBuilder::new().num_threads(2).build().expect("a pool");
    let before = counts(Some(&pool));
    assert!(since(before, Some(&pool))[0] < 8, "to count is none");
    pool.broadcast(|_| std::hint::black_box(vec![1u8; 100]));
    // The queue of the threads grows now and then.
    let [counted, bytes] = since(before, Some(&pool));
    assert!((2..10).contains(&counted) && bytes >= 200, "one on each thread, and {counted} in all");
}
