//! Updates in two halves: the events are those of the beginning, whoever does the work and whatever happens meanwhile.

use pbig_core::gpu::{Fault, adapters};
use pbig_core::{
    Aabb, Backend, BroadPhase, Coding, Config, Events, GpuFinder, GpuOptions, Limits, Pair, ProxyFilter,
};
use pbig_harness::boxes::BoxSet;
use pbig_tests::{gpu, may_run, needs_gpu, strategies};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use std::time::Duration;

fn pile(n: usize) -> Vec<Aabb> {
    BoxSet::named("pile").expect("the set exists").boxes(n, 5)
}

fn set_all(broad_phase: &mut BroadPhase, boxes: &[Aabb]) {
    for (id, aabb) in (0..).zip(boxes) {
        broad_phase.set(id, *aabb, ProxyFilter::ALL).expect("few boxes");
    }
}

fn new(config: Config, boxes: &[Aabb]) -> BroadPhase {
    let mut broad_phase = BroadPhase::new(config).expect("a margin");
    set_all(&mut broad_phase, boxes);
    broad_phase
}

/// Some of the things that can happen to boxes, the same to both; what was answered must be the same too.
fn disturb(one: &mut BroadPhase, other: &mut BroadPhase, rng: &mut StdRng, calls: usize) {
    for _ in 0..calls {
        let id = rng.random_range(0..130);
        let at: [f32; 3] = std::array::from_fn(|_| rng.random_range(0.0..6.0));
        let motion = at.map(|x| 0.2 * (x - 3.0));
        let (cube, filter) =
            (Aabb::from_center(at, [0.6; 3]), ProxyFilter { body: id / 3, ..ProxyFilter::ALL });
        match rng.random_range(0..10) {
            0 | 1 => assert_eq!(one.remove(id), other.remove(id), "box {id}"),
            2 => assert_eq!(one.set_margin(0.02 * at[0]), other.set_margin(0.02 * at[0])),
            3 => assert_eq!(one.set(id, Aabb::NOWHERE, filter), other.set(id, Aabb::NOWHERE, filter)),
            4 => assert_eq!(one.set(id, cube, ProxyFilter::ALL), other.set(id, cube, ProxyFilter::ALL)),
            _ => {
                assert_eq!(one.set(id, cube.swept(motion), filter), other.set(id, cube.swept(motion), filter))
            }
        }
    }
}

#[test]
fn events_are_those_of_the_beginning_on_every_strategy() {
    for (name, config) in strategies() {
        let rng = &mut StdRng::seed_from_u64(3);
        let mut at_once = BroadPhase::new(config).expect("a margin");
        let mut in_halves = at_once.clone();
        let mut events = 0;
        for round in 0..30 {
            disturb(&mut at_once, &mut in_halves, rng, if round % 3 == 0 { 120 } else { 6 });
            let before = in_halves.events().clone();
            in_halves.begin();
            let wanted = at_once.update().expect("few pairs").clone();
            disturb(&mut at_once, &mut in_halves, rng, if round % 4 == 0 { 60 } else { 3 });
            // To begin again changes nothing, nor does it that a clone goes on.
            in_halves.begin();
            assert_eq!(in_halves.events(), &before, "{name}: as before until it is finished");
            if round % 5 == 0 {
                in_halves = in_halves.clone();
            }
            assert_eq!(in_halves.finish(), Ok(&wanted), "{name}, round {round}");
            assert!(!in_halves.has_begun());
            assert_eq!(in_halves.pair_count(), at_once.pair_count(), "{name}, round {round}");
            assert_eq!(in_halves.report().gpu.is_some(), at_once.report().gpu.is_some(), "{name}");
            events += wanted.added.len() + wanted.removed.len();
        }
        assert!(events > 500, "{name}: {events} events");
    }
}

#[test]
fn whatever_the_order_of_calls_nothing_is_lost() {
    let cube = |x: f32| Aabb::from_center([x, 0.0, 0.0], [0.5; 3]);
    let configs = [Backend::Cpu, Backend::Gpu].map(|backend| Config { backend, ..Config::DEFAULT });
    for config in configs.into_iter().filter(may_run) {
        let mut broad_phase = new(config, &[cube(0.0), cube(0.9), cube(5.0)]);
        let added = |events: &Events| events.added.iter().map(|p| (p.a, p.b)).collect::<Vec<_>>();
        assert_eq!(added(broad_phase.finish().expect("few pairs")), [(0, 1)], "not begun, so it begins");
        broad_phase.begin();
        assert!(broad_phase.finish().expect("few pairs").added.is_empty(), "nothing has changed");
        broad_phase.set(2, cube(1.8), ProxyFilter::ALL).expect("few boxes");
        broad_phase.begin();
        broad_phase.set(1, cube(50.0), ProxyFilter::ALL).expect("few boxes");
        broad_phase.begin();
        assert!(broad_phase.fat_aabb(1).is_some_and(|fat| fat.max[0] < 2.0), "as it was");
        assert_eq!(added(broad_phase.update().expect("few pairs")), [(1, 2)], "the one that has begun");
        let ended = broad_phase.update().expect("few pairs").removed.clone();
        assert_eq!(ended, [Pair::new(0, 1), Pair::new(1, 2)]);
    }
}

#[test]
fn a_box_that_is_removed_meanwhile_is_in_the_events_and_gone_afterwards() {
    needs_gpu!();
    let mut broad_phase = new(gpu(Coding::Plain), &[Aabb::new([0.0; 3], [1.0; 3]); 3]);
    broad_phase.begin();
    assert!(broad_phase.remove(1) && !broad_phase.remove(1) && !broad_phase.remove(7));
    assert!(broad_phase.contains(1), "until then");
    assert_eq!(broad_phase.finish().expect("few pairs").added.len(), 3);
    assert!(!broad_phase.contains(1));
    assert_eq!(broad_phase.pairs().collect::<Vec<_>>(), [Pair::new(0, 2)]);
    assert_eq!(broad_phase.update(), Ok(&Events::default()));
}

#[test]
fn an_error_comes_in_the_end_and_the_changes_are_kept() {
    let configs = [gpu(Coding::Plain), Config { backend: Backend::Cpu, ..Config::DEFAULT }];
    for config in configs.into_iter().filter(may_run) {
        let limits = Limits { max_pairs: 100, max_boxes: 80 };
        let mut broad_phase = new(Config { limits, ..config }, &[Aabb::new([0.0; 3], [1.0; 3]); 40]);
        broad_phase.begin();
        let far = Aabb::new([50.0; 3], [51.0; 3]);
        assert!(broad_phase.set(80, far, ProxyFilter::ALL).is_err(), "ids are checked at once");
        (5..40)
            .for_each(|id| broad_phase.set(id, far.swept([id as f32; 3]), ProxyFilter::ALL).expect("an id"));
        (8..40).for_each(|id| assert!(broad_phase.remove(id)));
        assert!(broad_phase.finish().is_err_and(|error| error.to_string().contains("100")));
        assert_eq!(broad_phase.update().expect("few pairs").added.len(), 10 + 3);
    }
}

/// A world on a device that is at work when `meanwhile` is called; the events must be those of the CPU.
fn interrupted(
    options: GpuOptions,
    device: GpuFinder,
    meanwhile: impl Fn(usize, &mut BroadPhase),
) -> Vec<bool> {
    let boxes = pile(500);
    let config = Config { gpu: options, ..gpu(options.coding) };
    let mut at_once = new(Config { backend: Backend::Cpu, ..Config::DEFAULT }, &boxes);
    let mut in_halves = BroadPhase::with_gpu(config, device).expect("a margin");
    set_all(&mut in_halves, &boxes);
    let mut on_gpu = Vec::new();
    for round in 0..4 {
        in_halves.begin();
        meanwhile(round, &mut in_halves);
        let wanted = at_once.update().expect("few pairs");
        assert_eq!(in_halves.finish(), Ok(wanted), "round {round}");
        assert!(!wanted.added.is_empty(), "round {round}: nothing to lose");
        on_gpu.push(in_halves.report().gpu.is_some());
        assert_eq!(in_halves.report().fallback.is_none(), on_gpu[round]);
        // Each box goes another way than its neighbours, further each time.
        let push = |i: usize| 0.4 * (round as f32 + 1.0) * ((i % 3) as f32 - 1.0);
        let moved: Vec<Aabb> = (0..).zip(&boxes).map(|(i, aabb)| aabb.swept([push(i); 3])).collect();
        set_all(&mut at_once, &moved[..400]);
        set_all(&mut in_halves, &moved[..400]);
    }
    on_gpu
}

#[test]
fn the_device_is_at_work_once_an_update_has_begun() {
    needs_gpu!();
    let device = GpuFinder::new().expect("an adapter");
    let other = device.clone();
    let mut broad_phase = BroadPhase::with_gpu(gpu(Coding::Plain), device).expect("a margin");
    set_all(&mut broad_phase, &pile(500));
    let pairs = broad_phase.update().expect("few pairs").added.len();
    broad_phase.set(7, Aabb::NOWHERE, ProxyFilter::ALL).expect("few boxes");
    broad_phase.begin();
    // The next submission loses the device: the few events need none after `begin`.
    other.inject(Fault::LoseDevice, 0);
    let ended = broad_phase.finish().expect("few pairs").removed.len();
    assert!(ended > 0 && ended + broad_phase.pair_count() == pairs);
    assert!(broad_phase.report().gpu.is_some(), "{:?}", broad_phase.report().fallback);
    broad_phase.set(8, Aabb::NOWHERE, ProxyFilter::ALL).expect("few boxes");
    assert!(!broad_phase.update().expect("few pairs").removed.is_empty());
    assert!(broad_phase.report().fallback.is_some(), "now it is lost");
}

#[test]
fn small_rooms_many_chunks_and_parts_are_finished_completely() {
    needs_gpu!();
    let tiny = GpuOptions { chunk: [3, 2], first_bytes: 0, ..GpuOptions::DEFAULT };
    for options in [tiny, GpuOptions { coding: Coding::Packed, ..tiny }] {
        let device = GpuFinder::new().expect("an adapter");
        assert_eq!(interrupted(options, device, |_, _| {}), [true; 4]);
    }
    // 1 MiB holds 21,845 boxes as they are and were.
    let options = GpuOptions { max_bytes: 1 << 20, ..GpuOptions::DEFAULT };
    let boxes = pile(22_000);
    let mut in_parts = new(Config { gpu: options, ..gpu(Coding::Plain) }, &boxes);
    let mut at_once = new(Config { backend: Backend::Cpu, ..Config::DEFAULT }, &boxes);
    in_parts.begin();
    in_parts.remove(0);
    assert_eq!(in_parts.finish(), at_once.update());
    assert!(in_parts.report().gpu.as_ref().is_some_and(|gpu| gpu.parts > 1));
}

#[test]
fn a_device_that_is_lost_meanwhile_loses_no_event() {
    needs_gpu!();
    let options = GpuOptions { pause: Duration::ZERO, ..GpuOptions::DEFAULT };
    for fault in [Fault::Timeout, Fault::Panic, Fault::OutOfMemory] {
        let device = GpuFinder::new().expect("an adapter");
        let other = device.clone();
        let on_gpu = interrupted(options, device, |round, _| {
            if round == 1 {
                other.inject(fault, 0);
            }
        });
        // Nothing is allocated in the second half, so memory runs out in the next first one, if at all.
        assert_eq!(on_gpu[..2], [true, fault == Fault::OutOfMemory], "{fault:?}");
    }
    // An app's own device, which is not replaced.
    let adapter = adapters().into_iter().next().expect("an adapter");
    let device = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor::default()));
    let (device, queue) = device.expect("a device");
    let finder = GpuFinder::from_device(device.clone(), queue).expect("a device");
    let lose = |round: usize, _: &mut BroadPhase| {
        if round == 1 {
            device.destroy();
        }
    };
    assert_eq!(interrupted(options, finder, lose), [true, false, false, false]);
}

#[test]
fn another_device_starts_from_the_same_boxes() {
    needs_gpu!();
    let device = GpuFinder::new().expect("an adapter");
    let other = device.clone();
    let on_gpu = interrupted(GpuOptions::DEFAULT, device, |round, broad_phase| {
        if round == 2 {
            broad_phase.set_gpu(other.clone());
        }
    });
    assert_eq!(on_gpu, [true; 4]);
}
