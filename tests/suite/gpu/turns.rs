//! Contract: updates on a device and on the CPU may take turns, and fail in between, and no event is lost.

use pbig_core::{Aabb, Backend, BroadPhase, Config, Limits, ProxyFilter};
use pbig_gpu::{GpuFinder, GpuOptions};
use pbig_harness::follower::Follower;
use pbig_tests::needs_gpu;
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

/// Boxes and filters fit a buffer each, and do not both fit one.
#[test]
fn lists_that_exceed_the_staging_buffer_together_are_complete() {
    needs_gpu!();
    let gpu = GpuFinder::new().expect("an adapter");
    let gpu = gpu.with_options(GpuOptions { max_bytes: 1 << 20, ..GpuOptions::DEFAULT });
    let on = |backend| Config { backend, ..Config::DEFAULT };
    let mut ours = BroadPhase::with_device(on(Backend::Device), Box::new(gpu)).expect("a margin");
    let mut cpu = BroadPhase::new(on(Backend::Cpu)).expect("a margin");
    for (seed, n) in [(1, 20_000), (2, 36_000)] {
        let boxes = pbig_tests::set("unit", n, seed);
        let ids: Vec<u32> = (0..n as u32).collect();
        let filter = ProxyFilter { memberships: 1 << seed, ..ProxyFilter::ALL };
        for world in [&mut ours, &mut cpu] {
            world.set_many(&ids, |id| Some((boxes[id as usize], filter))).expect("room for them");
            world.update().expect("few pairs");
        }
        assert_eq!((ours.events(), ours.report().fallback.as_ref()), (cpu.events(), None), "seed {seed}");
    }
    let report = ours.report().device.as_ref().expect("the device did the work");
    assert!(report.uploaded > 1 << 20, "{report:?}");
}

/// Events lead from the pairs of the last successful update to the present pairs, on every backend.
#[test]
fn devices_and_the_cpu_take_turns_and_updates_fail_in_between() {
    needs_gpu!();
    // With and without a grid: a plan outlives updates that fail.
    for all_pairs_up_to in [0, 1000] {
        take_turns(GpuOptions { all_pairs_up_to, ..GpuOptions::DEFAULT });
    }
}

fn take_turns(options: GpuOptions) {
    let gpu = GpuFinder::new().expect("an adapter").with_options(options);
    let broad_phase = BroadPhase::with_device(Config::DEFAULT, Box::new(gpu)).expect("a margin that is one");
    let (mut world, mut random) = (Follower::new(broad_phase, 400), StdRng::seed_from_u64(17));
    let home = |id: u32| [id % 8, id / 8 % 8, id / 64].map(|i| i as f32);
    // Updates on the device and on the CPU, successful and failed ones.
    let mut seen = [[0; 2]; 2];
    for round in 0..300 {
        let way = random.random_range(0..2);
        let max_pairs = if random.random_ratio(1, 6) { 40 } else { u64::MAX };
        let limits = Limits { max_pairs, ..Limits::DEFAULT };
        world.broad_phase.set_backend([Backend::Device, Backend::Cpu][way], limits);
        for id in 0..400 {
            let to = if random.random_ratio(1, 400) { random.random_range(0..400) } else { id };
            let center = home(to).map(|x| x + random.random_range(-0.02..0.02));
            if random.random_ratio(1, 400) {
                world.remove(id).expect("as both know");
            }
            if random.random_ratio(399, 400) {
                let memberships = 1 + u32::from(random.random_ratio(1, 400));
                let filter = ProxyFilter { memberships, ..ProxyFilter::ALL };
                world.set(id, Aabb::from_center(center, [0.5; 3]), filter).expect("room for it");
            }
        }
        let result = world.update();
        let report = world.broad_phase.report();
        assert!(result.is_err() || report.device.is_some() == (way == 0), "round {round}: the device works");
        assert_eq!(report.fallback, None, "round {round}: too many pairs are no fault of the device");
        seen[way][usize::from(result.is_err())] += 1;
        let is_limit = |why: &String| why.contains("max_pairs");
        assert!(result.as_ref().err().is_none_or(is_limit), "round {round}: {result:?}");
    }
    assert!(seen.as_flattened().iter().all(|updates| *updates > 10), "{seen:?}");
}
