//! The contracts hold on the GPU backend with small buffers, with devices that fail, and with every option. Each test needs
//! an adapter, which may be software, and fails without one.

mod failures;
mod resident;
mod turns;
mod work;

use pbig_core::{
    Aabb, Backend, Config, DeviceFailure, DeviceFound, DeviceReport, Finder, NoDevice, Order, Pair,
    PairDevice, ProxyFilter, SearchRequest,
};
use pbig_gpu::{Coding, GpuFinder, GpuFinders, GpuOptions, adapters};
use pbig_tests::{Way, difference, gpu, needs_gpu};
use std::pin::pin;
use std::task::{Context, Poll, Waker};

fn set(name: &str, n: usize) -> Vec<Aabb> {
    pbig_tests::set(name, n, 5)
}

/// Returns settings for a device that always makes a grid.
fn with(options: GpuOptions) -> Way {
    let gpu = GpuOptions { all_pairs_up_to: 0, count_tests: true, time_kernels: true, ..options };
    Way { gpu, ..pbig_tests::gpu(options.coding) }
}

/// As [`with`], on a given device.
fn with_device(options: GpuOptions, device: GpuFinder) -> Finder {
    let Way { config, gpu } = with(options);
    Finder::with_device(config, Box::new(device.with_options(gpu)))
}

/// Returns the pairs, which a device must have found, and its report.
fn find(finder: &mut Finder, boxes: &[Aabb]) -> (Vec<Pair>, DeviceReport) {
    let pairs = finder.find(boxes).expect("within the limits").to_vec();
    let report = finder.report();
    assert_eq!(report.fallback, None);
    (pairs, report.device.clone().expect("a device did the work"))
}

fn on_cpu(boxes: &[Aabb]) -> Vec<Pair> {
    let config = Config { backend: Backend::Cpu, ..Config::DEFAULT };
    Finder::new(config).find(boxes).expect("within the limits").to_vec()
}

fn cubes(n: usize) -> Vec<Aabb> {
    vec![Aabb::new([0.0; 3], [1.0; 3]); n]
}

#[test]
fn lists_that_begin_far_too_small_lose_nothing() {
    needs_gpu!();
    for (name, boxes) in
        [("uniform", set("uniform", 20_000)), ("pile", set("pile", 3000)), ("identical", cubes(1200))]
    {
        let wanted = on_cpu(&boxes);
        for coding in [Coding::Plain, Coding::Packed] {
            let tiny = GpuOptions { first_bytes: 0, coding, ..GpuOptions::DEFAULT };
            let mut finder = with(tiny).finder();
            let (pairs, report) = find(&mut finder, &boxes);
            assert_eq!(difference(&pairs, &wanted), None, "{name}, {coding:?}");
            assert!(report.repeats > 0, "{name}: nothing was too small");
            let (_, report) = find(&mut finder, &boxes);
            assert_eq!(report.repeats, 0, "{name}: the second call has the room the first one needed");
        }
    }
}

#[test]
fn sets_beyond_the_limits_of_a_device_are_split_and_complete() {
    needs_gpu!();
    // 1 MiB holds 37,449 boxes, and no more than 131,072 plain pairs.
    let options = GpuOptions { max_bytes: 1 << 20, ..GpuOptions::DEFAULT };
    let mut with_ground = set("pile", 50_000);
    with_ground.push(Aabb::new([f32::NEG_INFINITY; 3], [f32::INFINITY, 0.0, f32::INFINITY]));
    for (name, boxes, parts) in [
        ("uniform", set("uniform", 120_000), 7),
        ("gaussian", set("gaussian", 100_000), 6),
        ("pile with ground", with_ground, 3),
        ("identical", cubes(1500), 1),
    ] {
        let wanted = on_cpu(&boxes);
        for coding in [Coding::Plain, Coding::Packed] {
            let (pairs, report) = find(&mut with(GpuOptions { coding, ..options }).finder(), &boxes);
            assert_eq!(difference(&pairs, &wanted), None, "{name}, {coding:?}");
            assert!(report.parts >= parts, "{name}: {} parts", report.parts);
        }
        let filter = |i: u32| ProxyFilter { body: i / 3, mask: 1 << (i % 5), ..ProxyFilter::ALL };
        let filters: Vec<_> = (0..boxes.len() as u32).map(filter).collect();
        let [found, wanted] = [with(options).finder(), Finder::default()]
            .map(|mut finder| finder.find_filtered(&boxes, &filters).expect("within the limits").to_vec());
        assert!(!wanted.is_empty() && found == wanted, "{name}, filtered");
    }
}

/// Contract: the limit of pairs is that of the call, not of its parts.
#[test]
fn parts_of_a_call_share_its_limit_of_pairs() {
    needs_gpu!();
    let boxes = set("uniform", 70_000);
    let all = on_cpu(&boxes).len() as u64;
    let adapter = adapters().into_iter().next().expect("an adapter");
    let small = GpuOptions { max_bytes: 1 << 20, ..GpuOptions::DEFAULT };
    let one = GpuFinder::on(&adapter).expect("a device").with_options(small);
    let two = GpuFinders::on_all(&[adapter.clone(), adapter]).expect("devices");
    for mut device in [Box::new(one) as Box<dyn PairDevice>, Box::new(two)] {
        for (max_pairs, wanted) in [(all, Ok(())), (all - 1, Err(DeviceFailure::TooManyPairs))] {
            let request = SearchRequest { boxes: &boxes, filters: None, is_sorted: false, max_pairs };
            let mut found = DeviceFound::default();
            assert_eq!(device.find_all(&request, &mut found), wanted);
            assert!(wanted.is_err() || found.report.parts > 1, "{} parts", found.report.parts);
        }
    }
}

#[test]
fn lists_that_exceed_a_buffer_split_the_set_and_are_remembered() {
    needs_gpu!();
    // The boxes fit, but their entries, some twenty each, do not.
    let boxes = set("pile", 30_000);
    let options = GpuOptions { max_bytes: 1 << 20, boxes_per_cell: 1.0, ..GpuOptions::DEFAULT };
    let mut finder = with(options).finder();
    let wanted = on_cpu(&boxes);
    for call in 0..2 {
        let (pairs, report) = find(&mut finder, &boxes);
        assert_eq!(difference(&pairs, &wanted), None);
        assert!(report.parts > 1, "call {call}: {} parts", report.parts);
    }
    let few = set("unit", 9000);
    let (pairs, report) = find(&mut finder, &few);
    assert_eq!(difference(&pairs, &on_cpu(&few)), None);
    assert_eq!(report.parts, 1, "a small set is not cut because a large one was");
}

#[test]
fn a_device_that_really_allows_little_is_enough() {
    needs_gpu!();
    let adapter = adapters().into_iter().next().expect("an adapter");
    let required_limits = wgpu::Limits {
        max_storage_buffer_binding_size: 1 << 20,
        max_buffer_size: 2 << 20,
        ..wgpu::Limits::default()
    };
    let descriptor = wgpu::DeviceDescriptor { required_limits, ..Default::default() };
    let device = pollster::block_on(adapter.request_device(&descriptor));
    let (device, queue) = device.expect("a device with small limits");
    let device = GpuFinder::from_device(device, queue).expect("small limits are enough");
    let mut finder = with_device(GpuOptions::DEFAULT, device);
    for boxes in [set("gaussian", 60_000), cubes(1500)] {
        for call in 0..2 {
            let (pairs, report) = find(&mut finder, &boxes);
            assert_eq!(difference(&pairs, &on_cpu(&boxes)), None);
            assert!(boxes.len() < 2000 || report.parts > 1, "call {call}: {} parts", report.parts);
        }
    }
}

#[test]
fn every_switch_gives_the_same_bytes() {
    needs_gpu!();
    for (name, boxes) in
        [("pile", set("pile", 2000)), ("mixed", set("mixed", 2000)), ("identical", cubes(700))]
    {
        let wanted = on_cpu(&boxes);
        let usual = GpuOptions::DEFAULT;
        let chunks = GpuOptions { chunk: [3, 2], first_bytes: 0, ..usual };
        for options in [
            GpuOptions { load_balancing: false, ..usual },
            GpuOptions { coding: Coding::Plain, ..usual },
            GpuOptions { coding: Coding::Packed, ..usual },
            chunks,
            GpuOptions { pipelining: false, ..chunks },
        ] {
            for small_cell in [1, 32, 256] {
                let mut finder = with(GpuOptions { small_cell, ..options }).finder();
                let (pairs, report) = find(&mut finder, &boxes);
                assert_eq!(difference(&pairs, &wanted), None, "{name}, {small_cell}, {options:?}");
                assert!(report.chunks > 1 || options.chunk != chunks.chunk, "{} chunks", report.chunks);
            }
        }
    }
}

#[test]
fn a_small_scene_needs_no_grid_and_may_answer_in_bits() {
    needs_gpu!();
    let boxes = cubes(300);
    let wanted = on_cpu(&boxes);
    for (coding, downloaded) in [(Coding::Packed, 300 * 299 / 2 / 8), (Coding::Plain, wanted.len() * 8)] {
        let options = GpuOptions { coding, ..GpuOptions::DEFAULT };
        let mut finder = Way { gpu: options, ..gpu(coding) }.finder();
        let (pairs, _) = find(&mut finder, &boxes);
        assert_eq!(difference(&pairs, &wanted), None, "{coding:?}");
        let (_, report) = find(&mut finder, &boxes);
        assert!(report.downloaded as usize >= downloaded, "{coding:?}: {}", report.downloaded);
        assert!(
            (report.downloaded as usize) < downloaded * 5 / 4 + 2048,
            "{coding:?}: {}",
            report.downloaded
        );
    }
}

#[test]
fn packed_output_is_an_eighth_in_crowds_and_not_the_default() {
    needs_gpu!();
    let boxes = cubes(1500);
    let compression = |coding| {
        let options = GpuOptions { coding, ..GpuOptions::DEFAULT };
        let mut finder = with(options).with(|it| it.order = Order::Unspecified).finder();
        [0; 2].map(|_| find(&mut finder, &boxes).1.compression)
    };
    assert_eq!(compression(Coding::Auto), [1.0; 2]);
    let packed = compression(Coding::Packed);
    assert!(packed.into_iter().all(|ratio| ratio < 0.14), "{packed:?}");
}

/// A world of one part whose first update has more events than a buffer holds.
#[test]
fn more_events_than_a_buffer_holds_are_complete() {
    needs_gpu!();
    let boxes = cubes(1500);
    let options = GpuOptions { max_bytes: 1 << 20, ..GpuOptions::DEFAULT };
    for all_pairs_up_to in [0, 2000] {
        let gpu = GpuOptions { all_pairs_up_to, ..options };
        let mut broad_phase = Way { gpu, ..with(options) }.broad_phase();
        let ids: Vec<u32> = (0..boxes.len() as u32).collect();
        broad_phase.set_many(&ids, |id| Some((boxes[id as usize], ProxyFilter::ALL))).expect("ids");
        let added = broad_phase.update().expect("within the limits").added.clone();
        assert_eq!(broad_phase.report().fallback, None);
        assert_eq!(difference(&added, &on_cpu(&boxes)), None);
        broad_phase
            .set_many(&ids, |id| Some((Aabb::from_center([9.0 * id as f32; 3], [0.5; 3]), ProxyFilter::ALL)))
            .expect("ids");
        let removed = broad_phase.update().expect("within the limits").removed.clone();
        assert_eq!((removed == added, broad_phase.pair_count()), (true, 0));
        assert_eq!(broad_phase.report().fallback, None);
    }
}

/// A plan that was made for other boxes must not keep the device busy: it is noticed before anything is tested.
#[test]
fn boxes_that_jump_together_or_apart_get_another_plan_at_once() {
    needs_gpu!();
    let spread = set("unit", 20_000);
    let factor = |boxes: &[Aabb], by: f32| -> Vec<Aabb> {
        boxes.iter().map(|b| Aabb::from_center(b.min.map(|x| x * by), [0.001; 3])).collect()
    };
    let mut finder = with(GpuOptions::DEFAULT).with(|it| it.order = Order::Unspecified).finder();
    let mut plans = Vec::new();
    let sets = [&spread, &factor(&spread, 1e-3), &factor(&spread, 1e4), &spread, &spread];
    for (i, boxes) in sets.into_iter().enumerate() {
        let (mut pairs, gpu) = find(&mut finder, boxes);
        assert!(i != 1 || gpu.repeats > 0, "the plan of the first set is refused");
        pairs.sort_unstable();
        assert_eq!(difference(&pairs, &on_cpu(boxes)), None);
        let report = finder.report();
        let useful = boxes.len() as u64 + pairs.len() as u64;
        assert!(report.checks.made < 100 * useful, "{} tests, {}", report.checks.made, report.plan);
        plans.push(report.plan.to_string());
    }
    assert_ne!(plans[0], plans[1]);
    assert_eq!(plans[3], plans[4], "a plan that suits is kept");
}

#[test]
fn memory_follows_what_is_needed_down_as_well_as_up() {
    needs_gpu!();
    let mut finder = with(GpuOptions::DEFAULT).finder();
    let (many, few) = (set("pile", 60_000), set("pile", 500));
    let burst = find(&mut finder, &many).1.device_bytes;
    for _ in 0..130 {
        find(&mut finder, &few);
    }
    let after = find(&mut finder, &few).1.device_bytes;
    assert!(after * 4 < burst, "{after} of {burst} bytes are still held");
    assert_eq!(difference(&find(&mut finder, &many).0, &on_cpu(&many)), None);
}

/// A device that is hardware, whatever its adapter says.
#[derive(Clone, Debug)]
struct Hardware(GpuFinder);

impl PairDevice for Hardware {
    fn find_all(&mut self, request: &SearchRequest<'_>, to: &mut DeviceFound) -> Result<(), DeviceFailure> {
        self.0.find_all(request, to)
    }
    fn name(&self) -> Option<&str> {
        self.0.name()
    }
    fn is_software(&self) -> bool {
        false
    }
    fn clone_box(&self) -> Box<dyn PairDevice> {
        Box::new(self.clone())
    }
}

#[test]
fn auto_uses_hardware_for_many_boxes_and_no_software() {
    needs_gpu!();
    // Few are valid: a software device has little to do.
    let mut boxes = vec![Aabb::NOWHERE; 100_000];
    boxes[..5000].copy_from_slice(&set("unit", 5000));
    let device = GpuFinder::new().expect("an adapter");
    let software = device.is_software().then_some(NoDevice::Software);
    let mut soft = Finder::with_device(Config::DEFAULT, device.clone_box());
    soft.find(&boxes).expect("within the limits");
    assert_eq!(
        (soft.report().plan.no_device, soft.report().device.is_none()),
        (software, software.is_some())
    );
    let mut finder = Finder::with_device(Config::DEFAULT, Box::new(Hardware(device)));
    for (many, why) in [(true, None), (false, Some(NoDevice::FewBoxes)), (true, None)] {
        let found = finder.find(&boxes[usize::from(!many)..]).expect("within the limits").to_vec();
        assert_eq!((finder.report().plan.no_device, finder.report().device.is_some()), (why, many));
        assert_eq!((finder.report().fallback.as_ref(), found == soft.pairs()), (None, many));
    }
}

#[test]
fn nothing_grows_in_fifty_calls_with_other_boxes() {
    needs_gpu!();
    let (mut finder, mut most) = (with(GpuOptions::DEFAULT).finder(), 0);
    for call in 0..50 {
        let held =
            find(&mut finder, &pbig_tests::set("pile", 400 + call as usize * 37 % 100, call)).1.device_bytes;
        most = if call < 15 { held.max(most) } else { most };
        assert!(held <= most * 5 / 4, "call {call}: {held} bytes after at most {most}");
    }
}

#[test]
fn finders_in_several_threads_share_a_device() {
    needs_gpu!();
    let boxes = set("pile", 2000);
    let wanted = on_cpu(&boxes);
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                let mut finder = with(GpuOptions::DEFAULT).finder();
                (0..10).for_each(|_| assert_eq!(difference(&find(&mut finder, &boxes).0, &wanted), None));
            });
        }
    });
}

/// Contract: the way of a page is the same call. In a program it never waits for another poll.
#[test]
fn a_call_without_blocking_gives_the_same_bytes() {
    needs_gpu!();
    let mut finder = ready(GpuFinder::open_async())
        .expect("an adapter")
        .with_options(GpuOptions { chunk: [64, 8], ..GpuOptions::DEFAULT });
    for boxes in [set("pile", 3000), set("unit", 20_000), cubes(900), set("mixed", 5000)] {
        let request = SearchRequest { boxes: &boxes, filters: None, is_sorted: true, max_pairs: u64::MAX };
        let mut found = DeviceFound::default();
        ready(finder.find_all_async(&request, &mut found)).expect("a device that works");
        found.pairs.sort_unstable();
        assert_eq!(difference(&found.pairs, &on_cpu(&boxes)), None);
    }
    let boxes = cubes(2000);
    let request = SearchRequest { boxes: &boxes, filters: None, is_sorted: true, max_pairs: 5 };
    let too_many = ready(finder.find_all_async(&request, &mut DeviceFound::default()));
    assert_eq!(too_many, Err(DeviceFailure::TooManyPairs));
}

/// Returns the result of a future that must be ready at the first poll.
fn ready<T>(future: impl Future<Output = T>) -> T {
    let mut context = Context::from_waker(Waker::noop());
    match pin!(future).poll(&mut context) {
        Poll::Ready(result) => result,
        Poll::Pending => panic!("the future waits for another poll"),
    }
}

#[test]
fn ci_is_never_without_a_gpu() {
    use pbig_tests::leaves_out;
    assert_eq!(leaves_out(None, Some("true")), Ok(false));
    assert_eq!([None, Some("")].map(|ci| leaves_out(Some("none"), ci)), [Ok(true), Ok(true)]);
    assert!(leaves_out(Some("none"), Some("true")).is_err_and(|why| why.contains("CI=true")));
    assert!(leaves_out(Some("some"), None).is_err_and(|why| why.contains("PBIG_GPU=some")));
}
