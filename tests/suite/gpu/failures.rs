//! Contract: a device that fails or is lost at any moment costs no pair and no event.

use super::resident::App;
use super::{Hardware, find, on_cpu, set, with_device};
use pbig_core::{
    Backend, BroadPhase, Config, DeviceFailure, DeviceFound, Finder, PairDevice, SearchRequest, oracle,
};
use pbig_gpu::{GpuFinder, GpuOptions, adapters};
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

/// A fault, which the test brings about at a wait for the device.
type Fault = fn(&wgpu::Device);

fn lose(device: &wgpu::Device) {
    device.destroy();
}

/// As wgpu does when a device is lost during a wait.
fn panic(_: &wgpu::Device) {
    panic!("a fault of the test");
}

fn refuse(device: &wgpu::Device) {
    let source = wgpu::ShaderSource::Wgsl("this is no WGSL".into());
    _ = device.create_shader_module(wgpu::ShaderModuleDescriptor { label: None, source });
}

/// A texture of 275 GB, which wgpu allows and no device has.
fn exhaust(device: &wgpu::Device) {
    _ = device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d { width: 8192, height: 8192, depth_or_array_layers: 256 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba32Float,
        usage: wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
}

/// Returns a device that fails at the wait after this number of waits.
fn failing(fault: Fault, waits: u32) -> GpuFinder {
    let device = GpuFinder::new().expect("an adapter");
    let mut left = waits;
    device.set_hook(move |device| match left.checked_sub(1) {
        Some(less) => left = less,
        None => {
            left = u32::MAX;
            fault(device);
        }
    });
    device
}

#[test]
fn a_device_that_fails_in_the_middle_of_a_run_loses_no_event() {
    needs_gpu!();
    let config = Config { margin: 0.05, backend: Backend::Device, ..Config::DEFAULT };
    let faults: [(Fault, &str); 4] =
        [(lose, "lost"), (panic, "lost"), (refuse, "refused"), (exhaust, "out of device memory")];
    for ((fault, words), waits) in faults.into_iter().flat_map(|fault| [0, 1, 2, 5].map(|at| (fault, at))) {
        for pause in [Duration::ZERO, Duration::from_secs(3600)] {
            let options = GpuOptions { pause, first_bytes: 0, chunk: [12, 8], ..GpuOptions::DEFAULT };
            let device = Box::new(failing(fault, waits).with_options(options));
            let got = frames(BroadPhase::with_device(config, device).expect("a margin"));
            let failed = got.iter().position(|why| why.as_ref().is_some_and(|why| why.contains(words)));
            let failed =
                failed.unwrap_or_else(|| panic!("{words} after {waits} waits was not reported: {got:?}"));
            let after = &got[failed + 1];
            let tried_again = pause == Duration::ZERO;
            assert_eq!(after.is_none(), tried_again, "{words} after {waits} waits: {after:?}");
        }
    }
}

#[test]
fn a_device_that_is_lost_at_any_moment_of_a_call_loses_no_pair() {
    needs_gpu!();
    // A map that is repeated, many chunks, and many pieces.
    let options = GpuOptions { chunk: [12, 8], first_bytes: 0, ..GpuOptions::DEFAULT };
    let boxes = set("mixed", 3000);
    let wanted = on_cpu(&boxes);
    let mut lost = 0;
    for after in 0..8 {
        let mut finder = with_device(options, failing(lose, after));
        let found = finder.find(&boxes).expect("within the limits");
        assert_eq!(difference(found, &wanted), None, "lost after {after} waits");
        lost += u32::from(finder.report().fallback.is_some());
    }
    assert!((4..8).contains(&lost), "the device was lost in {lost} of 8 calls");
}

/// An upload and a copy take no patience of their own.
#[test]
fn a_hung_device_costs_the_patience_once() {
    needs_gpu!();
    let options = GpuOptions { patience: Duration::from_nanos(1), ..GpuOptions::DEFAULT };
    let mut gpu = GpuFinder::new().expect("an adapter").with_options(options);
    let boxes = set("pile", 20_000);
    let request = SearchRequest { boxes: &boxes, filters: None, is_sorted: true, max_pairs: u64::MAX };
    let why = "the device did not answer within 1ns (GpuOptions::patience)";
    // A software device may be done when the wait begins.
    let mut results = (0..100).map(|_| gpu.find_all(&request, &mut DeviceFound::default()));
    assert_eq!(results.find(Result::is_err), Some(Err(DeviceFailure::Failed(why.into()))));
}

/// Contract: a device of the app that was busy for too long is lost for that call only.
#[test]
fn an_apps_device_that_was_busy_is_used_again_when_it_is_idle() {
    needs_gpu!();
    let App { device, finder, .. } = App::new(GpuOptions::DEFAULT);
    let config = Config { backend: Backend::Device, ..Config::DEFAULT };
    let usual = GpuOptions { pause: Duration::ZERO, ..GpuOptions::DEFAULT };
    let no_time = GpuOptions { patience: Duration::ZERO, ..usual };
    // A software device may be done when the wait begins, so there are several calls without time.
    let options = [vec![usual], vec![no_time; 50]].concat();
    let mut finder = Finder::with_device(config, Box::new(Hardware(finder, options)));
    let boxes = set("pile", 20_000);
    let wanted = on_cpu(&boxes);
    let mut call = || {
        assert_eq!(difference(finder.find(&boxes).expect("few pairs"), &wanted), None);
        finder.report().fallback.clone()
    };
    let why = (0..50).find_map(|_| call()).expect("it had no time");
    assert!(why.contains("did not answer"), "{why}");
    // The device may be busy yet: a software one compiles kernels for seconds.
    call();
    device.poll(wgpu::PollType::wait_indefinitely()).expect("a device that works");
    // Other processes may delay the answer of an idle device.
    assert!((0..100).any(|_| call().is_none()), "an idle device is used again");
}

#[test]
fn an_app_shares_its_device_and_a_lost_one_is_not_replaced() {
    needs_gpu!();
    let adapter = adapters().into_iter().next().expect("an adapter");
    let App { device, finder, .. } = App::on(&adapter, GpuOptions::DEFAULT);
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
