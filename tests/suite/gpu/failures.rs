//! Contract: a device that fails or is lost at any moment costs no pair and no event.

use super::{find, on_cpu, set, with_device};
use pbig_core::{Backend, BroadPhase, Config, Finder, oracle};
use pbig_gpu::testing::{FAULTS, Fault};
use pbig_gpu::{Coding, GpuFinder, GpuFinders, GpuOptions, adapters};
use pbig_harness::follower::Follower;
use pbig_tests::{corpus, difference, needs_gpu};
use std::time::Duration;

/// Runs frames in which boxes move, appear and disappear, compared with the oracle. Returns why the CPU did a device's work in each.
fn frames(broad_phase: BroadPhase) -> Vec<Option<String>> {
    let (start, mut world) = (set("pile", 600), Follower::new(broad_phase, 600));
    let frame = |frame: usize| {
        world.set_frame(&start, frame).expect("as both know, within the limits");
        world.update().expect("the oracle's pairs");
        world.broad_phase.report().fallback.clone()
    };
    (0..12).map(frame).collect()
}

#[test]
fn a_device_that_fails_in_the_middle_of_a_run_loses_no_event() {
    needs_gpu!();
    let config = Config { margin: 0.05, backend: Backend::Device, ..Config::DEFAULT };
    for (fault, words, moments) in FAULTS {
        let pauses = [Duration::ZERO, Duration::from_secs(3600)];
        for (&at, pause) in moments.iter().flat_map(|at| pauses.map(|pause| (at, pause))) {
            let options = GpuOptions { pause, first_bytes: 0, chunk: [12, 8], ..GpuOptions::DEFAULT };
            let device = GpuFinder::new().expect("an adapter");
            device.inject(fault, at);
            let device = Box::new(device.with_options(options));
            let got = frames(BroadPhase::with_device(config, device).expect("a margin"));
            let failed = got.iter().position(|why| why.as_ref().is_some_and(|why| why.contains(words)));
            let failed = failed.unwrap_or_else(|| panic!("{fault:?} was not reported"));
            let after = &got[failed + 1];
            let tried_again = pause == Duration::ZERO;
            assert_eq!(after.is_none(), tried_again, "{fault:?}: {after:?}");
        }
    }
}

#[test]
fn a_device_that_is_lost_at_any_moment_of_a_call_loses_no_pair() {
    needs_gpu!();
    let options =
        GpuOptions { chunk: [12, 8], first_bytes: 0, coding: Coding::Packed, ..GpuOptions::DEFAULT };
    let in_parts = GpuOptions { max_bytes: 1 << 20, ..GpuOptions::DEFAULT };
    for (boxes, options) in [(set("mixed", 3000), options), (set("uniform", 70_000), in_parts)] {
        let wanted = on_cpu(&boxes);
        let mut lost = 0;
        for after in 0..10 {
            let device = GpuFinder::new().expect("an adapter");
            device.inject(Fault::LoseDevice, after);
            let mut finder = with_device(options, device);
            let found = finder.find(&boxes).expect("within the limits");
            assert_eq!(difference(found, &wanted), None, "lost after {after} submissions");
            lost += u32::from(finder.report().fallback.is_some());
        }
        assert!(lost >= 6, "the device was lost in {lost} of 10 calls only");
    }
}

#[test]
fn several_devices_of_which_one_is_lost_lose_no_pair() {
    needs_gpu!();
    let adapter = adapters().into_iter().next().expect("an adapter");
    let options = GpuOptions { pause: Duration::ZERO, ..GpuOptions::DEFAULT };
    let gpus = GpuFinders::on_all(&[adapter.clone(), adapter]).expect("devices").with_options(options);
    gpus.inject(Fault::LoseDevice, 1);
    let config = Config { backend: Backend::Device, ..Config::DEFAULT };
    let mut finder = Finder::with_device(config, Box::new(gpus));
    let boxes = set("mixed", 5000);
    let parts = [(); 4].map(|()| {
        assert_eq!(difference(finder.find(&boxes).expect("few pairs"), &on_cpu(&boxes)), None);
        let report = finder.report();
        report.fallback.is_none().then(|| report.device.as_ref().map_or(0, |gpu| gpu.parts))
    });
    assert_eq!(parts.iter().flatten().collect::<Vec<_>>(), [&3; 3], "one call is the CPU's");
}

/// Contract: a device of the app that was busy for too long is lost for that call only.
#[test]
fn an_apps_device_that_was_busy_is_used_again_when_it_is_idle() {
    needs_gpu!();
    let adapter = adapters().into_iter().next().expect("an adapter");
    let device = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor::default()));
    let (device, queue) = device.expect("a device with WebGPU's default limits");
    let finder = GpuFinder::from_device(device, queue).expect("default limits are enough");
    finder.inject(Fault::Timeout, 1);
    let options = GpuOptions { pause: Duration::ZERO, ..GpuOptions::DEFAULT };
    let mut finder = with_device(options, finder);
    let boxes = set("pile", 2000);
    let mut whys = Vec::new();
    while whys.len() < 100 && whys.last() != Some(&None) {
        assert_eq!(finder.find(&boxes).expect("few pairs"), on_cpu(&boxes));
        whys.push(finder.report().fallback.clone());
    }
    assert!(whys[0].as_ref().is_some_and(|why| why.contains("did not answer")), "{:?}", whys[0]);
    assert_eq!(whys.last(), Some(&None), "after {} calls", whys.len());
}

#[test]
fn an_app_shares_its_device_and_a_lost_one_is_not_replaced() {
    needs_gpu!();
    let adapter = adapters().into_iter().next().expect("an adapter");
    let device = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor::default()));
    let (device, queue) = device.expect("a device with WebGPU's default limits");
    let finder = GpuFinder::from_device(device.clone(), queue).expect("default limits are enough");
    assert!(finder.adapter().contains(&adapter.get_info().name), "{}", finder.adapter());
    let options = GpuOptions { pause: Duration::ZERO, ..GpuOptions::DEFAULT };
    let mut finder = with_device(options, finder);
    for case in corpus() {
        let (pairs, _) = find(&mut finder, &case.boxes);
        assert_eq!(difference(&pairs, &oracle::pairs(&case.boxes)), None, "{}", case.name);
    }
    device.destroy();
    let boxes = set("pile", 2000);
    for _ in 0..2 {
        assert_eq!(finder.find(&boxes).expect("within the limits"), on_cpu(&boxes));
        let why = finder.report().fallback.clone().expect("the device is gone");
        assert!(why.contains("lost"), "{why}");
    }
}
