//! The contracts hold on the GPU backend with small buffers, with devices that fail, and with every option. Each test needs
//! an adapter, which may be software, and fails without one.

mod failures;
mod resident;
mod turns;
mod work;

use pbig_core::{
    Aabb, Backend, Config, DeviceFailure, DeviceFound, DeviceReport, Finder, NoDevice, Order, Pair,
    PairDevice, SearchRequest,
};
use pbig_gpu::{GpuFinder, GpuOptions, adapters};
use pbig_tests::{Way, difference, needs_gpu};
use std::pin::pin;
use std::task::{Context, Poll, Waker};
use std::time::Duration;

fn set(name: &str, n: usize) -> Vec<Aabb> {
    pbig_tests::set(name, n, 5)
}

/// Patience of tests in which no device hangs: a software one on a busy machine takes minutes for some calls.
const PATIENCE: Duration = Duration::from_secs(600);

/// Returns settings for a device that always makes a grid.
fn with(options: GpuOptions) -> Way {
    let patience = PATIENCE;
    let gpu = GpuOptions { all_pairs_up_to: 0, count_tests: true, time_kernels: true, patience, ..options };
    Way { gpu, ..pbig_tests::gpu() }
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
        let mut finder = with(GpuOptions { first_bytes: 0, ..GpuOptions::DEFAULT }).finder();
        let (pairs, report) = find(&mut finder, &boxes);
        assert_eq!(difference(&pairs, &on_cpu(&boxes)), None, "{name}");
        assert!(report.repeats > 0, "{name}: nothing was too small");
        let (_, report) = find(&mut finder, &boxes);
        assert_eq!(report.repeats, 0, "{name}: the second call has the room the first one needed");
    }
}

/// Boxes, entries of cells, and pairs: each list alone.
#[test]
fn a_set_beyond_the_limits_of_a_device_is_the_cpus() {
    needs_gpu!();
    let options = GpuOptions { max_bytes: 1 << 20, pause: Duration::from_secs(3600), ..GpuOptions::DEFAULT };
    let fine = GpuOptions { boxes_per_cell: 1.0, ..options };
    let limit = "but the device or GpuOptions::max_bytes allows";
    for (what, most, boxes, options) in [
        ("50000 boxes", "43690", set("unit", 50_000), options),
        ("entries", "1048576", set("pile", 30_000), fine),
        ("out", "1048576", cubes(1500), options),
    ] {
        let mut finder = with(options).finder();
        assert_eq!(difference(finder.find(&boxes).expect("few pairs"), &on_cpu(&boxes)), None, "{what}");
        let why = finder.report().fallback.clone().expect("a list is too long");
        assert!(why.contains(what) && why.contains(&format!("{limit} {most}")), "{what}: {why}");
        // That is no failure: there is no pause.
        let few = set("unit", 700);
        assert_eq!(difference(&find(&mut finder, &few).0, &on_cpu(&few)), None, "{what}");
    }
}

#[test]
fn a_call_may_have_as_many_pairs_as_its_limit_and_not_one_more() {
    needs_gpu!();
    let mut gpu = GpuFinder::new().expect("an adapter");
    for boxes in [set("uniform", 70_000), set("pile", 500)] {
        let all = on_cpu(&boxes).len() as u64;
        for (max_pairs, wanted) in [(all, Ok(())), (all - 1, Err(DeviceFailure::TooManyPairs))] {
            let request = SearchRequest { boxes: &boxes, filters: None, is_sorted: false, max_pairs };
            let mut found = DeviceFound::default();
            assert_eq!(gpu.find_all(&request, &mut found), wanted);
            assert!(wanted.is_err() || found.pairs.len() as u64 == all);
        }
    }
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
    for boxes in [set("unit", 20_000), cubes(500)] {
        for _ in 0..2 {
            assert_eq!(difference(&find(&mut finder, &boxes).0, &on_cpu(&boxes)), None);
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
fn a_small_scene_needs_no_grid() {
    needs_gpu!();
    for n in [300, 1024] {
        let boxes = cubes(n);
        let mut finder = Way { gpu: GpuOptions::DEFAULT, ..pbig_tests::gpu() }.finder();
        for call in 0..2 {
            let (pairs, report) = find(&mut finder, &boxes);
            assert_eq!(difference(&pairs, &on_cpu(&boxes)), None, "{n}");
            assert_eq!((report.cells, report.chunks), (0, 1), "{n}");
            let (down, bytes) = (report.downloaded, 8 * pairs.len() as u64);
            assert!((bytes..=bytes + 3200).contains(&down), "{n}, call {call}: {down}");
        }
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

/// A device that is hardware, whatever its adapter says, and the settings of its next calls, the last one first.
#[derive(Clone, Debug)]
struct Hardware(GpuFinder, Vec<GpuOptions>);

impl PairDevice for Hardware {
    fn find_all(&mut self, request: &SearchRequest<'_>, to: &mut DeviceFound) -> Result<(), DeviceFailure> {
        if let Some(options) = self.1.pop() {
            self.0 = std::mem::take(&mut self.0).with_options(options);
        }
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
    let mut finder = Finder::with_device(Config::DEFAULT, Box::new(Hardware(device, vec![])));
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
