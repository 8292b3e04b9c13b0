//! The device's work, in counts: what a call sends, repeats and waits for, and which shapes it leaves to the CPU.

use super::{PATIENCE, cubes, find, on_cpu, set, with};
use pbig_core::{
    Aabb, Backend, BroadPhase, Config, DeviceFound, Finder, Order, PairDevice, ProxyFilter, SearchRequest,
};
use pbig_gpu::{DECLINED, GpuFinder, GpuOptions};
use pbig_harness::hard::{Part, Recipe, crossing, shapes};
use pbig_shaders::{KERNELS, Stage};
use pbig_tests::{difference, needs_gpu};
use std::time::Duration;

/// Maximum tests of a shape, as a multiple of those of cubes, without those that its pairs need.
const MOST_TESTS: u64 = 5;

/// Tests that a pair may need, as on the CPU.
const TESTS_PER_PAIR: u64 = 32;

/// Number of boxes of a shape.
const BOXES: usize = 25_000;

/// Finds the pairs of boxes. Returns the tests that the device made, or why it made none.
fn tests_of(boxes: &[Aabb]) -> Result<u64, String> {
    let mut finder = with(GpuOptions::DEFAULT).finder();
    let found = finder.find(boxes).expect("few pairs").to_vec();
    assert_eq!(difference(&found, &on_cpu(boxes)), None);
    let report = finder.report();
    report.fallback.clone().map_or(Ok(report.checks.made), Err)
}

#[test]
fn a_device_bounds_its_work_or_leaves_the_shape_to_the_cpu() {
    needs_gpu!();
    let cubes = Recipe(vec![Part::CUBES]).boxes(BOXES, 1);
    let uniform = tests_of(&cubes).expect("cubes are done on the device");
    for (name, recipe) in shapes() {
        let boxes = recipe.boxes(BOXES, 1);
        match tests_of(&boxes) {
            Ok(tests) => {
                let most = MOST_TESTS * uniform + TESTS_PER_PAIR * on_cpu(&boxes).len() as u64;
                println!("{name}: {tests} of at most {most}");
                assert!(tests <= most, "{name}: {tests} tests, cubes {uniform}");
            }
            Err(why) => {
                println!("{name}: {why}");
                assert!(why.starts_with(DECLINED) && why.contains("tests of"), "{name}: {why}");
            }
        }
    }
}

/// A needle that lies over few boxes, and boxes at the end of the numbers, must not enlarge the cells of the others.
#[test]
fn a_pile_with_a_needle_and_boxes_far_away_is_the_devices() {
    needs_gpu!();
    let mut boxes = set("pile", 6000);
    for (i, far) in [f32::NEG_INFINITY, f32::INFINITY, f32::MAX].into_iter().enumerate() {
        boxes[50 * i].min[i] = far.min(boxes[50 * i].min[i]);
        boxes[50 * i + 1].max[i] = far.max(boxes[50 * i + 1].max[i]);
        boxes[50 * i + 2] = Aabb::new([far; 3], [far; 3]);
    }
    // This box is the last of its row. It reaches the first one.
    boxes[3000].min[0] = boxes[3000 - 3000 % 19].min[0];
    boxes.push(Aabb::new([f32::NEG_INFINITY; 3], [f32::INFINITY, 1.0, f32::INFINITY]));
    let tests = tests_of(&boxes).expect("done by the device");
    assert!(tests < 100 * boxes.len() as u64, "{tests}");
}

/// Contract: a declined call is no fault. The device goes on with other sets, and with the next update of a world.
#[test]
fn a_declined_call_is_the_cpus_and_the_next_may_be_the_devices() {
    needs_gpu!();
    let config = Config { backend: Backend::Device, ..Config::DEFAULT };
    let gpu = GpuFinder::new().expect("an adapter");
    let mut ours = BroadPhase::with_device(config, Box::new(gpu)).expect("a margin");
    let mut cpu =
        BroadPhase::new(Config { backend: Backend::Cpu, ..Config::DEFAULT }).expect("the same margin");
    let mut ways = Vec::new();
    let tight = crossing(20_000);
    let spread = Recipe(vec![Part::CUBES]).boxes(tight.len(), 1);
    for boxes in [&spread, &tight, &spread, &spread, &tight, &spread, &spread, &spread, &spread] {
        for (id, aabb) in (0..).zip(boxes) {
            ours.set(id, *aabb, ProxyFilter::ALL).expect("an id");
            cpu.set(id, *aabb, ProxyFilter::ALL).expect("an id");
        }
        // Otherwise the repeated set changes nothing.
        ours.set(0, boxes[1], ProxyFilter::ALL).expect("an id");
        cpu.set(0, boxes[1], ProxyFilter::ALL).expect("an id");
        assert!(ours.update() == cpu.update(), "after {ways:?}");
        let why = ours.report().fallback.clone();
        assert!(why.as_ref().is_none_or(|why| why.starts_with(DECLINED)), "{why:?}");
        ways.push(why.is_none());
    }
    assert!(ways[0] && !ways[1] && ways[8], "done by the device: {ways:?}");
}

/// Returns a finder on a device that always makes a grid, and times nothing.
fn untimed(options: GpuOptions) -> Finder {
    let options = GpuOptions { all_pairs_up_to: 0, patience: PATIENCE, ..options };
    let device = GpuFinder::new().expect("an adapter").with_options(options);
    let config = Config { backend: Backend::Device, ..Config::DEFAULT };
    Finder::with_device(config, Box::new(device))
}

#[test]
fn query_sets_are_made_only_if_times_are_wanted() {
    needs_gpu!();
    let boxes = set("unit", 3000);
    let request = SearchRequest { boxes: &boxes, filters: None, is_sorted: true, max_pairs: u64::MAX };
    for time_kernels in [false, true] {
        let options = GpuOptions { time_kernels, ..GpuOptions::DEFAULT };
        let mut gpu = GpuFinder::new().expect("an adapter").with_options(options);
        let mut found = DeviceFound::default();
        gpu.find_all(&request, &mut found).expect("a device that works");
        let has_times = !found.report.kernels.is_empty();
        assert_eq!(gpu.query_sets(), usize::from(has_times), "wanted: {time_kernels}");
        assert!(time_kernels || !has_times);
    }
}

#[test]
fn a_call_repeats_nothing_and_waits_for_the_count_and_for_the_pairs() {
    needs_gpu!();
    for (name, n) in [("unit", 1000), ("unit", 10_000), ("uniform", 10_000), ("unit", 100_000)] {
        let boxes = set(name, n);
        // Times would take a wait of their own.
        let mut finder = untimed(GpuOptions::DEFAULT);
        let (_, first) = find(&mut finder, &boxes);
        let (pairs, next) = find(&mut finder, &boxes);
        assert_eq!((first.repeats, next.repeats), (0, 0), "{n} in {name}");
        // Few pairs come with their number.
        let waits = if 8 * pairs.len() > 3072 { 2 } else { 1 };
        assert_eq!((first.waits, next.waits), (waits, waits), "{n} in {name}, {} pairs", pairs.len());
    }
}

/// Contract: as many bytes come down as there are pairs, and at most 4 kB, however many pairs the last call had.
#[test]
fn exactly_the_pairs_come_down_when_their_number_grows_and_shrinks() {
    needs_gpu!();
    let boxes = set("unit", 20_000);
    let grown = |by: f32| -> Vec<Aabb> {
        boxes.iter().map(|one| Aabb::new(one.min, one.max.map(|x| x + by))).collect()
    };
    let apart: Vec<Aabb> = boxes.iter().map(|one| Aabb::new(one.min, one.min)).collect();
    let frames =
        [boxes.clone(), grown(0.2), grown(0.6), grown(0.6), boxes.clone(), apart.clone(), apart, grown(0.3)];
    let few = [set("pile", 300), set("pile", 1100), set("pile", 300)];
    for order in [Order::Sorted, Order::Unspecified] {
        let config = Config { backend: Backend::Device, order, ..Config::DEFAULT };
        for chunk in [GpuOptions::DEFAULT.chunk, [512, 64]] {
            let options = GpuOptions { chunk, all_pairs_up_to: 0, ..GpuOptions::DEFAULT };
            let device = GpuFinder::new().expect("an adapter").with_options(options);
            let mut finder = Finder::with_device(config, Box::new(device));
            for (call, boxes) in frames.iter().chain(&few).enumerate() {
                let (mut pairs, report) = find(&mut finder, boxes);
                pairs.sort_unstable();
                assert_eq!(difference(&pairs, &on_cpu(boxes)), None, "call {call}");
                let (bytes, down) = (8 * pairs.len() as u64, report.downloaded);
                assert!(
                    down <= bytes + 3200,
                    "call {call}, {order:?}: {down} bytes for {} pairs",
                    pairs.len()
                );
                assert!(down >= bytes + 64, "call {call}: {down}");
            }
        }
    }
}

/// Contract: cells are chosen so that a box has few entries and few tests. The bytes that the map and the checks move follow from these.
#[test]
fn a_box_has_few_entries_and_few_tests() {
    needs_gpu!();
    for (name, most_entries, most_tests) in [("unit", 2.5, 18.0), ("mixed", 2.1, 15.0)] {
        let boxes = set(name, 100_000);
        let mut finder = untimed(GpuOptions::DEFAULT);
        let (_, report) = find(&mut finder, &boxes);
        let of_a_box = |count: u64| count as f64 / boxes.len() as f64;
        let (entries, tests) = (of_a_box(report.entries), of_a_box(finder.report().checks.made));
        let fits = entries <= most_entries && tests <= most_tests;
        assert!(fits, "{name}: {entries} entries and {tests} tests a box");
    }
}

/// A list that is longer than a piece comes in pieces, in order.
#[test]
fn a_list_of_several_pieces_is_complete_and_takes_a_wait_for_each() {
    needs_gpu!();
    let boxes = cubes(2500);
    let pairs = 2500 * 2499 / 2;
    for pipelining in [true, false] {
        let mut finder = untimed(GpuOptions { pipelining, ..GpuOptions::DEFAULT });
        find(&mut finder, &boxes);
        let (found, report) = find(&mut finder, &boxes);
        assert_eq!(difference(&found, &on_cpu(&boxes)), None);
        assert_eq!(report.downloaded, 64 + 8 * pairs);
        assert_eq!(report.waits, if pipelining { 3 } else { 2 });
    }
}

#[test]
fn a_call_sends_each_box_once_and_gets_each_pair_once_in_order() {
    needs_gpu!();
    let mut boxes = set("unit", 20_000);
    let mut finder = with(GpuOptions::DEFAULT).finder();
    let all = size_of_val(boxes.as_slice()) as u64;
    for _ in 0..3 {
        let (pairs, report) = find(&mut finder, &boxes);
        assert_eq!(report.uploaded, all);
        assert_eq!(difference(&pairs, &on_cpu(&boxes)), None);
        assert!(report.kernels.iter().any(|(name, _)| *name == "rank_pairs"), "{:?}", report.kernels);
        let is_map = |name: &str| KERNELS.iter().any(|it| it.name == name && it.stage == Stage::Map);
        let map: Duration =
            report.kernels.iter().filter(|(name, _)| is_map(name)).map(|(_, time)| time).sum();
        assert!(map > Duration::ZERO && report.map == map, "{:?}, not {map:?}", report.map);
        boxes[777] = boxes[778];
    }
    let (_, report) = find(&mut finder, &boxes);
    let pairs = finder.pairs().len() as u64;
    assert!(report.downloaded <= 1000 + 8 * pairs, "{} bytes for {pairs} pairs", report.downloaded);
}

#[test]
fn many_chunks_take_two_waits_and_send_no_pair_twice() {
    needs_gpu!();
    let boxes = set("unit", 20_000);
    let options = GpuOptions { chunk: [64, 4], ..GpuOptions::DEFAULT };
    let mut finder = untimed(options);
    // Some boxes grow and shrink again, so each second map has a few work items more than the last one.
    let grown =
        |i: usize, b: &Aabb| if i.is_multiple_of(50) { Aabb::new(b.min, b.max.map(|x| x + 0.4)) } else { *b };
    let frames = [boxes.clone(), boxes.iter().enumerate().map(|(i, b)| grown(i, b)).collect()];
    let wanted = frames.each_ref().map(|boxes| on_cpu(boxes));
    let most_pairs = wanted[0].len().max(wanted[1].len());
    let mut tests = [0; 2];
    for call in 0..6 {
        let (pairs, report) = find(&mut finder, &frames[call % 2]);
        tests[call % 2] = finder.report().checks.made;
        assert_eq!(difference(&pairs, &wanted[call % 2]), None);
        assert!(report.chunks > 4, "{} chunks", report.chunks);
        let most = 128 + 8 * most_pairs as u64;
        assert!(call == 0 || report.downloaded <= most, "{} bytes, at most {most}", report.downloaded);
        // For the counts and for the pairs. The first call learns the number of chunks with the counts of one.
        assert_eq!(report.waits, if call == 0 { 3 } else { 2 }, "call {call}");
    }
    assert!(tests[1] > tests[0], "{tests:?}: the second frame has more work items");
    // Many more items than the last call had: what is missing is checked in a second round.
    let more: Vec<_> = boxes.iter().map(|b| Aabb::new(b.min, b.max.map(|x| x + 0.4))).collect();
    let (pairs, _) = find(&mut finder, &more);
    assert_eq!(difference(&pairs, &on_cpu(&more)), None);
    // Far fewer: most of the chunks that are submitted are empty.
    let (pairs, report) = find(&mut finder, &boxes[..11_000]);
    assert_eq!(difference(&pairs, &on_cpu(&boxes[..11_000])), None);
    assert_eq!(report.waits, 2);
}

/// The timestamps come down in a copy of their own, 16 bytes for each kernel.
#[test]
fn every_kernel_of_many_chunks_is_timed() {
    needs_gpu!();
    let boxes = set("unit", 20_000);
    let run = |time_kernels: bool| {
        let options = GpuOptions { chunk: [64, 4], time_kernels, ..GpuOptions::DEFAULT };
        find(&mut untimed(options), &boxes).1
    };
    let (timed, untimed) = (run(true), run(false));
    if timed.kernels.is_empty() {
        return;
    }
    let kernels = (timed.downloaded - untimed.downloaded) / 16;
    assert!(timed.chunks > 22, "{} chunks", timed.chunks);
    // A chunk has three kernels; the map and the sort have more than eight.
    assert!(kernels > 3 * u64::from(timed.chunks) + 8, "{kernels} kernels of {} chunks", timed.chunks);
}

/// The list is sorted by the host where the device has no room for that, however little room is missing.
#[test]
fn pairs_that_a_device_has_no_room_to_sort_come_in_order() {
    needs_gpu!();
    let boxes = cubes(2500);
    let request = |is_sorted| SearchRequest { boxes: &boxes, filters: None, is_sorted, max_pairs: u64::MAX };
    let search = |max_total_bytes: u64, is_sorted: bool| {
        let options = GpuOptions { max_total_bytes, all_pairs_up_to: 0, ..GpuOptions::DEFAULT };
        let mut gpu = GpuFinder::new().expect("an adapter").with_options(options);
        let mut found = DeviceFound::default();
        for _ in 0..2 {
            gpu.find_all(&request(is_sorted), &mut found).map_err(|why| format!("{why:?}"))?;
        }
        let is_in_order = found.pairs.is_in_order();
        found.pairs.sort_unstable();
        assert_eq!(difference(&found.pairs, &on_cpu(&boxes)), None);
        Ok::<_, String>((found.report.device_bytes, is_in_order))
    };
    let (needed, _) = search(u64::MAX, false).expect("room for all");
    let (to_sort, _) = search(u64::MAX, true).expect("room for all");
    assert!(to_sort > needed);
    for room in [needed, needed + 12_800, needed + 20_000, to_sort - 1, to_sort] {
        let is_sorted = search(room, true).map(|(_, is_in_order)| is_in_order);
        assert_eq!(is_sorted, Ok(room == to_sort), "{room} bytes of {needed} to {to_sort}");
    }
}

/// A dispatch that orders pairs reads the others of their rows, so it gets a part of them: see `MOST_RANKED`.
#[test]
fn more_pairs_than_one_dispatch_orders_come_in_order() {
    needs_gpu!();
    let crowd = |i: usize| Aabb::from_center([3.0 * (i % 30) as f32, 3.0 * (i / 30) as f32, 0.0], [1.0; 3]);
    let boxes: Vec<Aabb> = (0..900 * 100).map(|i| crowd(i % 900)).collect();
    let wanted = on_cpu(&boxes);
    assert!(wanted.len() > 1 << 22);
    for time_kernels in [false, true] {
        let options = GpuOptions { time_kernels, patience: PATIENCE, ..GpuOptions::DEFAULT };
        let mut gpu = GpuFinder::new().expect("an adapter").with_options(options);
        for call in 0..2 {
            let request =
                SearchRequest { boxes: &boxes, filters: None, is_sorted: true, max_pairs: u64::MAX };
            let mut found = DeviceFound::default();
            gpu.find_all(&request, &mut found).expect("a device that works");
            assert!(
                found.pairs.is_in_order() && *found.pairs == wanted,
                "call {call}, timed: {time_kernels}"
            );
        }
    }
}

#[test]
fn a_call_beyond_the_limit_of_memory_is_the_cpus() {
    needs_gpu!();
    let boxes = set("unit", 20_000);
    let options = GpuOptions { max_total_bytes: 1 << 20, pause: Duration::ZERO, ..GpuOptions::DEFAULT };
    let mut finder = with(options).finder();
    for _ in 0..2 {
        assert_eq!(difference(finder.find(&boxes).expect("few pairs"), &on_cpu(&boxes)), None);
        let why = finder.report().fallback.clone().expect("the device has too little room");
        let limit = "GpuOptions::max_total_bytes allows 1048576";
        assert!(why.starts_with(DECLINED) && why.contains(limit), "{why}");
    }
    find(&mut finder, &boxes[..2000]);
    assert!(finder.report().device.as_ref().is_some_and(|device| device.device_bytes <= 1 << 20));
}

/// Contract: a call that is declined costs the next one no plan.
#[test]
fn a_plan_outlives_a_call_that_is_too_large() {
    needs_gpu!();
    let boxes = set("unit", 5000);
    let (few, usual) = (&boxes[..2600], GpuOptions { pause: Duration::ZERO, ..GpuOptions::DEFAULT });
    let needed = (0..2).map(|_| find(&mut untimed(usual), few).1.device_bytes).max().expect("two calls");
    let mut finder = untimed(GpuOptions { max_total_bytes: needed + (needed >> 3), ..usual });
    let planned = find(&mut finder, few).1.plan;
    assert_eq!(difference(finder.find(&boxes).expect("few pairs"), &on_cpu(&boxes)), None);
    let why = finder.report().fallback.clone().expect("too many boxes");
    assert!(why.contains("max_total_bytes"), "{why}");
    // A set of about this size is declined unseen.
    finder.find(few).expect("few pairs");
    let (pairs, report) = find(&mut finder, few);
    assert_eq!(difference(&pairs, &on_cpu(few)), None);
    assert!(planned > Duration::ZERO && report.plan == Duration::ZERO, "{planned:?}, then {:?}", report.plan);
}

/// The kernel for all pairs counts them in 32 bits, which 65,537 boxes exceed.
#[test]
fn many_boxes_have_a_grid_whatever_the_option() {
    needs_gpu!();
    let options = GpuOptions { all_pairs_up_to: u32::MAX, patience: PATIENCE, ..GpuOptions::DEFAULT };
    let gpu = GpuFinder::new().expect("an adapter").with_options(options);
    let config = Config { backend: Backend::Device, ..Config::DEFAULT };
    let mut finder = Finder::with_device(config, Box::new(gpu));
    for (n, has_grid) in [(5000, false), (70_000, true)] {
        let boxes = set("uniform", n);
        let (pairs, report) = find(&mut finder, &boxes);
        assert_eq!((difference(&pairs, &on_cpu(&boxes)), report.cells > 0), (None, has_grid), "{n}");
    }
}

/// An app that prepares its device while it loads waits for no driver later.
#[test]
fn a_prepared_device_compiles_nothing_in_searches_and_updates() {
    needs_gpu!();
    let mut gpu = GpuFinder::new().expect("an adapter");
    assert_eq!(gpu.pipelines(), 0);
    gpu.prepare().expect("kernels compile");
    let prepared = gpu.pipelines();
    let config = Config { backend: Backend::Device, ..Config::DEFAULT };
    for order in [Order::Sorted, Order::Unspecified] {
        let mut finder = Finder::with_device(Config { order, ..config }, Box::new(gpu.clone()));
        for boxes in [set("pile", 3000), set("unit", 500)] {
            find(&mut finder, &boxes);
        }
    }
    for n in [3000, 500] {
        let mut world = BroadPhase::with_device(config, Box::new(gpu.clone())).expect("a margin");
        for update in 0..2 {
            for (id, aabb) in (0..).zip(pbig_tests::set("pile", n, update)) {
                world.set(id, aabb, ProxyFilter::ALL).expect("a box");
            }
            world.update().expect("an update");
            assert!(world.report().device.is_some(), "{:?}", world.report().fallback);
        }
    }
    assert_eq!(gpu.pipelines(), prepared);
}
