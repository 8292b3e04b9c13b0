//! The contract of `PairDevice`: whatever a device does, a call is complete, and nothing panics.

mod double;

use double::{Double, Fault};
use pbig_core::{
    Aabb, Backend, BroadPhase, Config, Engine, Error, Finder, Limits, NoDevice, Order, Pair, ProxyFilter,
    oracle,
};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

const IDS: u32 = 120;

const ON_DEVICE: Config = Config { backend: Backend::Device, margin: 0.1, ..Config::DEFAULT };

/// Faults that the core notices, or that are none.
const HARMLESS: [Fault; 10] = [
    Fault::Nothing,
    Fault::Fails,
    Fault::Declines,
    Fault::IsLost,
    Fault::Disorder,
    Fault::Twice,
    Fault::CountsNone,
    Fault::BeyondTheLast,
    Fault::Inverted,
    Fault::MoreThanAll,
];

fn on_device(fault: Fault) -> BroadPhase {
    BroadPhase::with_device(ON_DEVICE, Double::new(fault)).expect("a margin")
}

fn on_cpu() -> BroadPhase {
    BroadPhase::new(Config { backend: Backend::Cpu, ..ON_DEVICE }).expect("a margin")
}

fn random_box(rng: &mut StdRng) -> Aabb {
    let center = std::array::from_fn(|_| rng.random_range(0.0..5.0));
    if rng.random_ratio(1, 40) { Aabb::NOWHERE } else { Aabb::from_center(center, [0.5; 3]) }
}

fn random_boxes(seed: u64) -> Vec<Aabb> {
    let mut rng = StdRng::seed_from_u64(seed);
    (0..IDS).map(|_| random_box(&mut rng)).collect()
}

/// A device that fails does not cost the CPU the tree that it keeps.
#[test]
fn look_ups_go_on_beside_a_device_that_fails() {
    let mut world = on_device(Fault::IsLost);
    let at = |x: u32| Aabb::from_center([2.0 * x as f32, 0.0, 0.0], [0.5; 3]);
    (0..5000).for_each(|id| world.set(id, at(id), ProxyFilter::ALL).expect("few boxes"));
    let mut look_ups = 0;
    for moved in 0..8 {
        world.set(moved, at(moved + 9000), ProxyFilter::ALL).expect("few boxes");
        world.update().expect("few pairs");
        look_ups += u32::from(world.report().plan.algorithm == pbig_core::Algorithm::LookUp);
    }
    assert_eq!(look_ups, 6, "{}", world.report().plan);
}

/// Changes some boxes, the same ones in every world.
fn disturb(worlds: &mut [&mut BroadPhase], rng: &mut StdRng) {
    for _ in 0..rng.random_range(0..IDS / 2) {
        let (id, aabb, kind) = (rng.random_range(0..IDS), random_box(rng), rng.random_range(0..10));
        let filter = ProxyFilter { body: rng.random_range(0..40), ..ProxyFilter::ALL };
        for world in &mut *worlds {
            match kind {
                0 => _ = world.remove(id),
                1 => _ = world.set_filter(id, filter),
                _ => world.set(id, aabb, filter).expect("a small id"),
            }
        }
    }
}

#[test]
fn updates_equal_those_of_the_cpu_whatever_fails() {
    for fault in HARMLESS {
        let (mut ours, mut cpu, mut rng) = (on_device(fault), on_cpu(), StdRng::seed_from_u64(1));
        let mut done_by_device = 0;
        for update in 0..40 {
            disturb(&mut [&mut ours, &mut cpu], &mut rng);
            assert_eq!(ours.update(), cpu.update(), "{fault:?}, update {update}");
            assert!(ours.pairs().eq(cpu.pairs()), "{fault:?}, update {update}");
            assert_eq!(ours.report().invalid, cpu.report().invalid, "{fault:?}, update {update}");
            done_by_device += usize::from(ours.report().device.is_some());
        }
        let wanted = match fault {
            Fault::Fails | Fault::Declines => 15..=25,
            Fault::IsLost => 2..=2,
            Fault::BeyondTheLast | Fault::Inverted | Fault::MoreThanAll | Fault::CountsNone => 0..=0,
            _ => 35..=40,
        };
        assert!(wanted.contains(&done_by_device), "{fault:?}: {done_by_device} updates");
    }
}

/// A structure that is not brought up to date by a device's update would lose pairs in the next one on the CPU.
#[test]
fn device_and_cpu_take_turns_with_each_engine() {
    for engine in Engine::ALL {
        let config = Config { engine: Some(engine), ..ON_DEVICE };
        let mut ours = BroadPhase::with_device(config, Double::new(Fault::Nothing)).expect("a margin");
        let (mut cpu, mut rng) = (on_cpu(), StdRng::seed_from_u64(3));
        for update in 0..60 {
            let backend = if update % 5 < 2 { Backend::Device } else { Backend::Cpu };
            ours.set_backend(backend, Limits::DEFAULT);
            disturb(&mut [&mut ours, &mut cpu], &mut rng);
            assert_eq!(ours.update(), cpu.update(), "{engine:?}, update {update}");
            assert_eq!(ours.report().device.is_some(), backend == Backend::Device);
        }
    }
}

#[test]
fn searches_equal_those_of_the_cpu_whatever_fails() {
    for fault in HARMLESS.into_iter().filter(|fault| *fault != Fault::Twice) {
        for order in [Order::Sorted, Order::Unspecified] {
            let mut finder = Finder::with_device(Config { order, ..ON_DEVICE }, Double::new(fault));
            for seed in 0..5 {
                let boxes = random_boxes(seed);
                let mut found = finder.find(&boxes).expect("few pairs").to_vec();
                if order == Order::Unspecified {
                    found.sort_unstable();
                }
                assert_eq!(found, oracle::pairs(&boxes), "{fault:?}");
                let report = finder.report();
                assert_ne!(report.device.is_some(), report.fallback.is_some(), "{fault:?}");
            }
        }
    }
}

#[test]
fn lies_about_pairs_do_not_panic_and_end_with_a_new_start() {
    for fault in [Fault::TooFew, Fault::TooMany, Fault::Twice, Fault::Nowhere] {
        let (mut ours, mut rng) = (on_device(fault), StdRng::seed_from_u64(2));
        for update in 0..60 {
            // The CPU's engines go on from what the device has said.
            let backend = if update % 3 == 2 { Backend::Cpu } else { Backend::Device };
            ours.set_backend(backend, Limits::DEFAULT);
            disturb(&mut [&mut ours], &mut rng);
            ours.update().expect("few pairs");
            assert_eq!(ours.pairs().count(), ours.pair_count(), "{fault:?}, update {update}");
            let are_there = |pair: Pair| ours.contains(pair.a) && ours.contains(pair.b);
            assert!(ours.pairs().all(are_there), "{fault:?}, update {update}: pairs of removed boxes");
        }
        ours.clear();
        ours.set_device(Double::new(Fault::Nothing));
        ours.set_backend(Backend::Device, Limits::DEFAULT);
        let mut cpu = on_cpu();
        disturb(&mut [&mut ours, &mut cpu], &mut rng);
        assert_eq!(ours.update(), cpu.update(), "{fault:?}");
        let mut finder = Finder::with_device(ON_DEVICE, Double::new(fault));
        (0..5).for_each(|seed| _ = finder.find(&random_boxes(seed)).expect("few pairs"));
    }
}

#[test]
fn a_failure_is_reported_and_the_device_is_asked_again() {
    let boxes = random_boxes(1);
    let on_device = |fault| Finder::with_device(ON_DEVICE, Double::new(fault));
    for (mut finder, whys) in [
        (on_device(Fault::Fails), [None, Some("no luck"), None, Some("no luck")]),
        (on_device(Fault::IsLost), [None, None, Some("lost"), Some("lost")]),
        (Finder::new(ON_DEVICE), [Some("no device was given"); 4]),
    ] {
        for why in whys {
            assert_eq!(finder.find(&boxes).expect("few pairs"), oracle::pairs(&boxes));
            let fallback = why.map(|why| format!("{why}: the CPU does the work"));
            assert_eq!(finder.report().fallback, fallback);
            let is_there = why.is_none_or(|why| why == "no luck");
            assert_eq!(finder.device_name(), is_there.then_some("a double"), "{why:?}");
        }
    }
}

#[test]
fn auto_searches_on_hardware_from_a_hundred_thousand_boxes_on() {
    let mut boxes = vec![Aabb::NOWHERE; 100_000];
    boxes[7..9].fill(Aabb::new([0.0; 3], [1.0; 3]));
    let pair = [Pair::new(7, 8)];
    let mut software = Double::new(Fault::Nothing);
    software.is_software = true;
    for (device, n, reason) in [
        (software, 100_000, Some(NoDevice::Software)),
        (Double::new(Fault::Nothing), 99_999, Some(NoDevice::FewBoxes)),
        (Double::new(Fault::Nothing), 100_000, None),
    ] {
        let mut finder = Finder::with_device(Config::DEFAULT, device.clone());
        assert_eq!(finder.find(&boxes[..n]).expect("a pair"), pair);
        let mut world = BroadPhase::with_device(Config::DEFAULT, device).expect("a margin");
        for (id, aabb) in (0..).zip(&boxes[..n]) {
            world.set(id, *aabb, ProxyFilter::ALL).expect("a small id");
        }
        assert_eq!(world.update().expect("a pair").added, pair);
        let of_update = Some(reason.filter(|why| *why == NoDevice::Software).unwrap_or(NoDevice::Update));
        for (report, reason) in [(finder.report(), reason), (world.report(), of_update)] {
            assert_eq!((report.plan.no_device, &report.fallback), (reason, &None));
            assert_eq!(report.device.is_some(), reason.is_none());
        }
    }
}

/// More pairs than a thread takes at a time, in an order that is not theirs: a row of boxes whose every second one moves.
#[test]
fn updates_of_many_boxes_equal_those_of_the_cpu() {
    let (mut ours, mut cpu) = (on_device(Fault::Twice), on_cpu());
    let ids: Vec<u32> = (0..40_000).collect();
    for (step, moved) in [(0.0, &ids[..]), (0.6, &ids[..]), (0.0, &ids[3..35_000])] {
        let x = |id: u32| id as f32 + if id.is_multiple_of(2) { 0.0 } else { step };
        let at = |id| Some((Aabb::from_center([x(id), 0.0, 0.0], [0.35; 3]), ProxyFilter::ALL));
        for world in [&mut ours, &mut cpu] {
            world.set_many(moved, at).expect("room for them");
            world.update().expect("few pairs");
        }
        assert_eq!((ours.events(), ours.report().fallback.as_ref()), (cpu.events(), None), "by {step}");
    }
    assert!(cpu.events().removed.len() > 17_000, "{}", cpu.events().removed.len());
}

#[test]
fn a_device_that_comes_amid_changes_does_the_next_update() {
    let (mut ours, mut cpu) = (BroadPhase::new(ON_DEVICE).expect("a margin"), on_cpu());
    let mut rng = StdRng::seed_from_u64(8);
    for update in 0..8 {
        disturb(&mut [&mut ours, &mut cpu], &mut rng);
        if update == 4 {
            assert!(ours.changes().len() > 10);
            ours.set_device(Double::new(Fault::Nothing));
        }
        disturb(&mut [&mut ours, &mut cpu], &mut rng);
        assert_eq!(ours.update(), cpu.update(), "update {update}");
        let report = ours.report();
        assert_eq!((report.device.is_some(), report.plan.no_device), (update >= 4, None), "update {update}");
    }
}

/// The device gets a list of the boxes that are left, and its pairs the ids of the world. Its order does not matter.
#[test]
fn updates_after_a_peak_equal_those_of_the_cpu() {
    for fault in [Fault::Nothing, Fault::Disorder, Fault::Twice, Fault::Fails] {
        let (mut ours, mut cpu, mut rng) = (on_device(fault), on_cpu(), StdRng::seed_from_u64(9));
        for update in 0..30 {
            for world in [&mut ours, &mut cpu] {
                (0..IDS * update / 30).for_each(|id| _ = world.remove(id));
            }
            disturb(&mut [&mut ours, &mut cpu], &mut rng);
            assert_eq!(ours.update(), cpu.update(), "{fault:?}, update {update}");
            assert!(ours.pairs().eq(cpu.pairs()), "{fault:?}, update {update}");
        }
        assert!(ours.len() < IDS as usize / 2 && ours.pair_count() > 0, "{} boxes", ours.len());
    }
}

#[test]
fn too_many_pairs_are_an_error_and_the_update_can_be_repeated() {
    let (mut ours, mut cpu, mut rng) = (on_device(Fault::Nothing), on_cpu(), StdRng::seed_from_u64(5));
    (0..9).for_each(|_| disturb(&mut [&mut ours, &mut cpu], &mut rng));
    let limits = Limits { max_pairs: 1, ..Limits::DEFAULT };
    ours.set_backend(Backend::Device, limits);
    assert_eq!(ours.update(), Err(Error::TooManyPairs { limit: 1 }));
    ours.set_backend(Backend::Device, Limits::DEFAULT);
    assert_eq!(ours.update(), cpu.update());
    for fault in [Fault::Nothing, Fault::IgnoresLimits] {
        let mut finder = Finder::with_device(Config { limits, ..ON_DEVICE }, Double::new(fault));
        let identical = [Aabb::new([0.0; 3], [1.0; 3]); 3];
        assert_eq!(finder.find(&identical), Err(Error::TooManyPairs { limit: 1 }));
        assert_eq!(finder.pairs(), &[] as &[Pair]);
    }
}

#[test]
fn a_clone_goes_on_as_the_original_with_a_device_of_its_own() {
    for (mut ours, is_on_device) in [(on_device(Fault::Nothing), true), (on_cpu(), false)] {
        let mut rng = StdRng::seed_from_u64(6);
        for _ in 0..5 {
            disturb(&mut [&mut ours], &mut rng);
            ours.update().expect("few pairs");
        }
        let mut copy = ours.clone();
        for _ in 0..20 {
            disturb(&mut [&mut ours, &mut copy], &mut rng);
            assert_eq!(ours.update(), copy.update());
            assert_eq!(copy.report().device.is_some(), is_on_device && copy.report().changed > 0);
            assert!(ours.pairs().eq(copy.pairs()));
        }
    }
}
