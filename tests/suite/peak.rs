//! Memory comes back after a peak is over, piece by piece, and a clone copies no scratch. Bytes are counted, on one thread.

use pbig_core::{Aabb, BroadPhase, Config, Finder, ProxyFilter};
use pbig_harness::counting::{held, peak, requests};
use pbig_tests::on_threads;

const BOXES: u32 = 60_000;

/// Cubes on a lattice with a jitter, so that all move in each update and have some pairs; or all in a clump, with 48 pairs a box.
fn cube(id: u32, update: u32, is_clump: bool) -> Aabb {
    let side = 40;
    let jitter = (id.wrapping_add(977 * update).wrapping_mul(2_654_435_761) >> 24) as f32 / 256.0;
    let place = [id % side, id / side % side, id / side / side].map(|x| x as f32);
    let spread = if is_clump { 0.46 } else { 1.2 };
    Aabb::from_center(place.map(|x| (x + 0.3 * jitter) * spread), [0.5; 3])
}

fn step(broad_phase: &mut BroadPhase, update: u32, is_clump: bool) {
    for id in 0..BOXES {
        broad_phase.set(id, cube(id, update, is_clump), ProxyFilter::ALL).expect("an id below the limit");
    }
    broad_phase.update().expect("few enough pairs");
}

#[test]
fn an_update_gives_back_what_a_clump_has_left() {
    on_threads(1, || {
        let start = held();
        let mut broad_phase = BroadPhase::new(Config::DEFAULT).expect("no margin");
        (0..10).for_each(|update| step(&mut broad_phase, update, false));
        let before = held() - start;
        peak();
        (10..13).for_each(|update| step(&mut broad_phase, update, true));
        let pairs = broad_phase.pair_count() as i64;
        assert!(pairs > 25 * i64::from(BOXES), "{pairs} pairs");
        step(&mut broad_phase, 13, false);
        let peak = peak() - start;
        assert!(peak > 5 * before && peak - before < 70 * pairs, "{} bytes a pair", (peak - before) / pairs);
        let pieces = (14..213).map(|update| {
            let held_before = held();
            step(&mut broad_phase, update, false);
            held_before - held()
        });
        let largest = pieces.max().unwrap_or(0);
        let after = held() - start;
        assert!(2 * after < 3 * before, "{before}, then {peak}, then {after} bytes");
        assert!(largest < (peak - before) / 20, "{largest} of {} bytes at once", peak - before);
    });
}

/// Boxes that were added once and sleep keep what a search for their pairs needs. Removed boxes leave only their ids.
#[test]
fn memory_comes_back_without_changes_and_without_boxes() {
    on_threads(1, || {
        let start = held();
        let mut broad_phase = BroadPhase::new(Config::DEFAULT).expect("no margin");
        step(&mut broad_phase, 0, true);
        let pairs = broad_phase.pair_count() as i64;
        let idle = |broad_phase: &mut BroadPhase| {
            (0..200).for_each(|_| assert!(broad_phase.update().expect("no change").added.is_empty()));
            held() - start
        };
        let asleep = idle(&mut broad_phase);
        assert!(asleep < 180 * i64::from(BOXES) + 27 * pairs, "{asleep} bytes, {pairs} pairs");

        (100..BOXES).for_each(|id| _ = broad_phase.remove(id));
        let left = |update: u32| {
            (0..100).for_each(|id| {
                broad_phase.set(id, cube(id, update, true), ProxyFilter::ALL).expect("an id below the limit");
            });
            broad_phase.update().expect("few pairs");
            held() - start
        };
        let few = (0..400).map(left).last().unwrap_or(0);
        assert!(few < 100 * i64::from(BOXES), "{few} bytes for ids");
        broad_phase.shrink_to_fit();
        let shrunk = held() - start;
        assert!(shrunk < 50_000, "{shrunk} bytes for 100 boxes");
    });
}

#[test]
fn updates_in_a_steady_state_ask_for_no_memory() {
    on_threads(1, || {
        let mut broad_phase = BroadPhase::new(Config::DEFAULT).expect("no margin");
        // To and fro, so that no list grows any more.
        (0..40).for_each(|update| step(&mut broad_phase, update % 2, false));
        let before = requests();
        (40..60).for_each(|update| step(&mut broad_phase, update % 2, false));
        assert!(!broad_phase.events().added.is_empty());
        assert_eq!(requests(), before);
    });
}

#[test]
fn a_clone_copies_no_scratch() {
    on_threads(1, || {
        let mut broad_phase = BroadPhase::new(Config::DEFAULT).expect("no margin");
        (0..4).for_each(|update| step(&mut broad_phase, update, true));
        let start = held();
        let clone = broad_phase.clone();
        let copied = held() - start;
        let (boxes, pairs) = (i64::from(BOXES), clone.pair_count() as i64);
        // Boxes, filters, states and the grid; rows of pairs, and the events of the last update.
        let events = (clone.events().added.len() + clone.events().removed.len()) as i64;
        assert!(
            copied < 180 * boxes + 6 * pairs + 8 * events,
            "{copied} bytes, {boxes} boxes, {pairs} pairs"
        );
    });
}

#[test]
fn a_finder_shrinks_to_its_lists() {
    on_threads(1, || {
        let boxes: Vec<Aabb> = (0..BOXES).map(|id| cube(id, 0, true)).collect();
        let start = held();
        let mut finder = Finder::default();
        peak();
        let pairs = finder.find(&boxes).expect("few enough pairs").to_vec();
        let each = (peak() - start) / pairs.len() as i64;
        assert!((16..40).contains(&each), "{each} bytes a pair, with the copy");
        let before = held();
        let clone = finder.clone();
        let more = held() - before - 8 * clone.pairs().len() as i64;
        assert!((0..1000).contains(&more), "a clone has the list, and {more} bytes");
        drop(clone);
        finder.shrink_to_fit();
        // The thread itself keeps some.
        let more = held() - start - 16 * pairs.len() as i64;
        assert!((0..1000).contains(&more), "a list and its copy, and {more} bytes");
        assert_eq!(finder.find(&boxes).expect("few enough pairs"), pairs);
    });
}
