//! Runs the corpus through `Finder` and `BroadPhase`, and a rapier world, on targets where the test suite cannot run.
//!
//! `run.mjs` calls the exported functions in node; `main.rs` calls the same checks in a native program. The first difference is a panic.

pub mod exports;

use pbig_core::{Aabb, Backend, BroadPhase, Config, Finder, ProxyFilter, oracle};
use pbig_harness::boxes::moved;
use pbig_harness::corpus::{corpus, difference};
use pbig_harness::follower::Follower;
use pbig_scenes::scenes::Scene;
use pbig_scenes::world::World;
use rapier_pbig::PbigBroadPhase;
use rapier_pbig::shadow::Shadow;

/// The backends that need no device.
const BACKENDS: [Backend; 3] = [Backend::Auto, Backend::Cpu, Backend::Brute];

/// Margins in the unit of the boxes: none, and one that most small motions stay within.
const MARGINS: [f32; 2] = [0.0, 0.05];

/// Number of frames in which boxes move, leave, return and change their filters.
const FRAMES: usize = 13;

/// Runs every case of the corpus on every backend, all at once and in motion, and the rapier world as one more case. Returns a report.
pub fn run() -> String {
    let cases = corpus();
    for case in &cases {
        for backend in BACKENDS {
            let what = format!("{}, {backend:?}", case.name);
            find(&case.boxes, backend, &what);
            MARGINS.iter().for_each(|&margin| {
                update(&case.boxes, Config { backend, margin, ..Config::DEFAULT }, &what)
            });
        }
    }
    let world = step();
    format!("{} cases passed, 0 failed\n{world}", cases.len() + 1)
}

/// Compares the pairs of a set of boxes with the oracle's, with filters. The second call meets the buffers of the first.
fn find(boxes: &[Aabb], backend: Backend, what: &str) {
    let filters: Vec<_> = (0..boxes.len() as u32).map(|id| filter(id, 0)).collect();
    let mut finder = Finder::new(Config { backend, ..Config::DEFAULT });
    for boxes in [boxes, &moved(boxes, 0.5, 1)] {
        let found = finder.find(boxes).expect("within the limits");
        assert_eq!(difference(found, &oracle::pairs(boxes)), None, "{what}, found");
        let found = finder.find_filtered(boxes, &filters).expect("one each");
        assert_eq!(difference(found, &oracle::pairs_filtered(boxes, &filters)), None, "{what}, with filters");
    }
}

/// Puts every seventh box into one body, and even and odd boxes into groups.
fn filter(id: u32, frame: u32) -> ProxyFilter {
    ProxyFilter { body: (id + frame) % 7, memberships: 1 + id % 2, mask: 3 - id % 3, ..ProxyFilter::ALL }
}

/// Compares every frame with the oracle. All boxes change in some frames, and few in others, so that look-ups and searches both run.
fn update(boxes: &[Aabb], config: Config, what: &str) {
    let mut world = Follower::new(BroadPhase::new(config).expect("a margin"), boxes.len());
    for frame in 0..FRAMES {
        let (share, distance) = ([1, 40, 6, 60, 3][frame % 5], [0.0, 0.02, 1.5, 30.0][frame % 4]);
        let there = moved(boxes, distance, frame as u64);
        for (turn, at) in (0..boxes.len()).step_by(share).enumerate() {
            let (id, filter) = (at as u32, filter(at as u32, frame as u32));
            // One in five leaves, or comes back: some after another one at their id.
            let leaves = (turn + frame) % 5 == 4 && world.has(id);
            let done = if leaves { world.remove(id) } else { Ok(()) };
            let stays = if leaves && turn % 2 == 0 { Ok(()) } else { world.set(id, there[at], filter) };
            done.and(stays).expect("a small id, present as both know");
        }
        world.update().unwrap_or_else(|why| panic!("{what}, margin {}, frame {frame}: {why}", config.margin));
    }
}

const BODIES: usize = 200;
const STEPS: usize = 60;

/// Drops a column of bodies beside brute force and rapier's own broad phase. Returns what happened.
fn step() -> String {
    let mut broad_phase = PbigBroadPhase::new().with_shadow(Shadow::Stock).with_shadow(Shadow::Oracle);
    let mut world = Scene::named("column").expect("the scene exists").build(BODIES, 1);
    let start = lowest(&world);
    (0..STEPS).for_each(|_| world.step(&mut broad_phase));
    let checker = broad_phase.shadow().expect("it was added");
    assert!(checker.differences.is_empty(), "rapier world: {}", checker.differences[0]);
    let (compared, pairs, lowest) = (checker.compared, broad_phase.pair_count(), lowest(&world));
    assert!(
        compared > 0 && pairs > 0 && (0.0..start).contains(&lowest),
        "{compared} updates, {pairs} pairs, {lowest}"
    );
    format!(
        "rapier world: {STEPS} steps, {pairs} pairs, the lowest body at {lowest:.3}; {compared} updates compared"
    )
}

/// Returns the height of the lowest body that can move.
fn lowest(world: &World) -> f32 {
    let movers = world.bodies.iter().filter(|(_, body)| body.is_dynamic());
    movers.map(|(_, body)| body.translation().y).fold(f32::MAX, f32::min)
}
