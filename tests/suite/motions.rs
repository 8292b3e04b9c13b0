//! Contract 1 in motion: boxes that drift, jitter, swing, fall, jump, rest, come and go have the oracle's pairs after every
//! update, with the policy's engine and with each one that can be asked for, on any number of threads.

use crate::follower::Follower;
use pbig_core::{BroadPhase, Config, Events, ProxyFilter};
use pbig_harness::motions::{Density, Motion, MovingBoxes};
use pbig_tests::{engines, on_threads};

const FRAMES: usize = 14;

/// Sets the boxes that changed in a frame, and removes the absent ones.
fn tell(world: &mut Follower, scene: &MovingBoxes, changed: &[u32]) {
    for &id in changed {
        let aabb = scene.boxes()[id as usize];
        if aabb.is_valid() {
            world.set(id, aabb, ProxyFilter::ALL);
        } else if world.has(id) {
            world.remove(id);
        }
    }
}

/// Plays a sequence, compared with the oracle in every frame.
fn play(config: Config, motion: Motion, density: Density, n: usize, seed: u64) {
    let mut scene = MovingBoxes::new(motion, density, n, seed);
    let mut world = Follower::new(config, n);
    let all: Vec<u32> = (0..n as u32).collect();
    tell(&mut world, &scene, &all);
    for frame in 0..FRAMES {
        world.update(&format!("{motion:?}, {density:?}, {n} boxes, seed {seed}, frame {frame}"));
        let changed = scene.step().to_vec();
        tell(&mut world, &scene, &changed);
    }
}

#[test]
fn a_thousand_sequences_of_every_motion_agree_with_the_oracle() {
    let mut sequences = 0;
    for seed in 0..38 {
        for motion in Motion::ALL {
            for density in Density::ALL {
                let n = [60, 150, 400, 1100][seed as usize % 4];
                let engines = engines();
                let (_, asked) = engines[seed as usize / 4 % engines.len()];
                let config = if seed % 2 == 0 { Config::DEFAULT } else { asked.config };
                let margin = [0.0, 0.02][seed as usize / 8 % 2];
                play(Config { margin, ..config }, motion, density, n, seed);
                sequences += 1;
            }
        }
    }
    assert!(sequences >= 1000, "{sequences} sequences");
}

/// Returns the events of enough boxes for several threads.
fn events(motion: Motion, threads: usize) -> Vec<Events> {
    on_threads(threads, || {
        let mut scene = MovingBoxes::new(motion, Density::Dense, 20_000, 7);
        let ids: Vec<u32> = (0..20_000).collect();
        let mut broad_phase = BroadPhase::default();
        let mut all = Vec::new();
        for _ in 0..6 {
            let boxes = scene.boxes();
            let present: Vec<u32> = ids.iter().copied().filter(|&id| boxes[id as usize].is_valid()).collect();
            ids.iter()
                .filter(|&&id| !boxes[id as usize].is_valid())
                .for_each(|&id| _ = broad_phase.remove(id));
            let of = |id: u32| Some((boxes[id as usize], ProxyFilter::ALL));
            broad_phase.set_many(&present, of).expect("small ids");
            all.push(broad_phase.update().expect("few pairs").clone());
            scene.step();
        }
        all
    })
}

#[test]
fn every_motion_has_the_same_events_on_1_2_5_and_16_threads() {
    for motion in Motion::ALL {
        let wanted = events(motion, 1);
        assert!(wanted[0].added.len() > 20_000, "{motion:?}");
        for threads in [2, 5, 16] {
            assert!(events(motion, threads) == wanted, "{motion:?}, {threads} threads");
        }
    }
}
