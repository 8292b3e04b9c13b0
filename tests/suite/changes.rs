//! The contract of a search for changes on a device: it returns every pair that an update adds or removes, once. Transfers
//! are proportional to the changes, not to the world. Brute force before and after each update gives the truth.

use pbig_core::{
    Aabb, DeviceFailure, DeviceFound, DeviceReport, Limits, PairDevice, ProxyFilter, SearchRequest, oracle,
};
use pbig_gpu::{Coding, GpuFinder, GpuOptions};
use pbig_harness::device_world::DeviceWorld;
use pbig_tests::needs_gpu;
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

fn set(name: &str, n: usize) -> Vec<Aabb> {
    pbig_tests::set(name, n, 5)
}

fn device(options: GpuOptions) -> GpuFinder {
    GpuFinder::new().expect("an adapter").with_options(options)
}

/// Returns a device that always makes a grid.
fn with(options: GpuOptions) -> GpuFinder {
    device(GpuOptions { all_pairs_up_to: 0, count_tests: true, ..options })
}

/// Finds all pairs of a set: no matter of the world that the device follows.
fn find_all(gpu: &mut GpuFinder, boxes: &[Aabb]) {
    let request =
        SearchRequest { boxes, filters: None, is_sorted: false, max_pairs: Limits::DEFAULT.max_pairs };
    let mut found = DeviceFound::default();
    gpu.find_all(&request, &mut found).expect("a device");
    found.pairs.sort_unstable();
    assert_eq!(pbig_tests::difference(&found.pairs, &oracle::pairs(boxes)), None);
}

/// Runs random updates on one device. Now and then another backend does one, or all pairs are found. Returns the numbers of chunks and of repeats.
fn follow_at_random(seed: u64, boxes: usize, updates: usize, mut gpu: GpuFinder) -> [u32; 2] {
    let rng = &mut StdRng::seed_from_u64(seed);
    let mut world = DeviceWorld::random(boxes, rng);
    let [mut chunks, mut repeats] = [0; 2];
    for update in 0..updates {
        let tracked = world.follow(&mut gpu).expect("no device fails here");
        assert_eq!(tracked.report.uploaded > 0, world.len() > 0, "update {update}");
        (chunks, repeats) = (chunks + tracked.report.chunks, repeats + tracked.report.repeats);
        for _ in 0..rng.random_range(0..2 * boxes / 3) {
            world.disturb(rng);
        }
        match rng.random_range(0..8) {
            0 => {
                world.advance();
                gpu.forget();
            }
            1 => find_all(&mut gpu, &world.boxes[..boxes / 2]),
            _ => {}
        }
        world.put(0, Aabb::from_center([update as f32; 3], [0.5; 3]));
    }
    [chunks, repeats]
}

#[test]
fn random_updates_equal_brute_force_with_and_without_a_grid() {
    needs_gpu!();
    for seed in 0..6 {
        for coding in [Coding::Auto, Coding::Plain, Coding::Packed] {
            for all_pairs_up_to in [0, 1024] {
                let options = GpuOptions { coding, all_pairs_up_to, ..GpuOptions::DEFAULT };
                follow_at_random(seed, 90, 14, device(options));
            }
        }
    }
}

#[test]
fn random_updates_lose_nothing_in_small_chunks_and_buffers() {
    needs_gpu!();
    for (seed, coding) in [(1, Coding::Plain), (2, Coding::Packed)] {
        for pipelining in [true, false] {
            let tiny =
                GpuOptions { coding, chunk: [2, 1], first_bytes: 0, pipelining, ..GpuOptions::DEFAULT };
            for small_cell in [1, 32] {
                let gpu = with(GpuOptions { small_cell, ..tiny });
                let [chunks, repeats] = follow_at_random(seed, 700, 7, gpu);
                assert!(chunks > 20 && repeats > 0, "{chunks} chunks, {repeats} repeats");
            }
        }
    }
}

/// Moves a share of the boxes a little, in different directions.
fn jostle(world: &mut DeviceWorld, every: usize, by: f32) {
    for (i, id) in (0..world.len()).step_by(every).enumerate() {
        let by = by * [1.0, -0.5, 2.0][i % 3];
        world.shift(id, [by, 0.5 * by, -by]);
    }
}

#[test]
fn a_world_beyond_the_limits_of_a_device_is_split() {
    needs_gpu!();
    // 1 MiB holds 21,845 boxes now and before.
    let options = GpuOptions { max_bytes: 1 << 20, ..GpuOptions::DEFAULT };
    let mut boxes = set("pile", 24_000);
    boxes.push(Aabb::new([f32::NEG_INFINITY; 3], [f32::INFINITY, 0.0, f32::INFINITY]));
    let (mut world, mut gpu) = (DeviceWorld::new(&boxes), with(options));
    for (every, by) in [(1, 0.0), (5, 0.3), (9000, 0.2)] {
        jostle(&mut world, every, by);
        let tracked = world.follow(&mut gpu).expect("a device");
        assert!(tracked.report.parts > 1, "{} parts", tracked.report.parts);
    }
    // Fewer boxes fit at once, and the device gets all of them again.
    (3000..world.len()).for_each(|id| world.remove(id));
    world.boxes.truncate(3000);
    world.filters.truncate(3000);
    world.changed.retain(|&id, _| id < 3000);
    for every in [1, 100] {
        jostle(&mut world, every, 0.1);
        let report = world.follow(&mut gpu).expect("a device").report;
        assert_eq!((report.parts, report.uploaded > 3000 * 48), (1, every == 1));
    }
}

/// Bytes of a box now and before with its filter, of a changed box, and of a changed filter.
const WHOLE: u64 = 48 + 16;
const BOX_CHANGE: u64 = 28;
const FILTER_CHANGE: u64 = 20;

#[test]
fn transfers_follow_what_has_changed() {
    needs_gpu!();
    let boxes = set("pile", 20_000);
    let (mut world, mut gpu) = (DeviceWorld::new(&boxes), with(GpuOptions::DEFAULT));
    let mut update = |world: &mut DeviceWorld| {
        let kept = world.kept.len();
        let tracked = world.follow(&mut gpu).expect("a device");
        let DeviceReport { uploaded, downloaded, .. } = tracked.report;
        let events = (tracked.pairs.len() + tracked.ended.len()) as u64;
        // There are 464 bytes of counts and times, and 64 prefetched words.
        assert!(downloaded >= 464 + 8 * events, "{downloaded} bytes for {events} events");
        assert!(tracked.restarted.is_empty(), "nothing has left its place");
        (uploaded, downloaded, events, kept)
    };
    let (uploaded, _, events, _) = update(&mut world);
    assert_eq!((uploaded, events), (20_000 * WHOLE, world.kept.len() as u64));
    assert!(events > 20_000, "{events} pairs: too few to be worth leaving out");
    for every in [20_000, 1000, 10, 1, 20_000] {
        jostle(&mut world, every, 0.02);
        let moved = 20_000u64.div_ceil(every as u64);
        let (uploaded, downloaded, events, _) = update(&mut world);
        assert_eq!(uploaded, moved * BOX_CHANGE, "{moved} boxes moved");
        assert!(events > 0 || moved < 100, "{moved} boxes moved and nothing happened");
        let most = 464 + 4 * 64 + 40 * moved + 8 * events;
        assert!(downloaded <= most, "{downloaded} bytes for {moved} boxes and {events} events");
    }
    let filter = ProxyFilter { body: 3, ..ProxyFilter::ALL };
    world.set(20_000, boxes[70], filter);
    let (uploaded, ..) = update(&mut world);
    assert!((WHOLE..=20_001 * WHOLE).contains(&uploaded), "a new box: {uploaded} bytes");
    world.remove(20_000);
    assert_eq!(update(&mut world).0, BOX_CHANGE, "a removed box");
    world.set(20_000, boxes[71], ProxyFilter::ALL);
    assert_eq!(update(&mut world).0, BOX_CHANGE + FILTER_CHANGE, "a box at an id that was free");
}

/// The contract of `PairDevice::forget`: the device has missed an update, and gets all boxes once.
#[test]
fn after_a_missed_update_all_boxes_go_up_again() {
    needs_gpu!();
    let (mut world, mut gpu) = (DeviceWorld::new(&set("pile", 2000)), with(GpuOptions::DEFAULT));
    let uploaded = [false, false, true, false].map(|has_missed_one| {
        jostle(&mut world, 100, 0.02);
        if has_missed_one {
            world.advance();
            gpu.forget();
            jostle(&mut world, 50, 0.02);
        }
        world.follow(&mut gpu).expect("a device").report.uploaded
    });
    assert_eq!(uploaded, [2000 * WHOLE, 20 * BOX_CHANGE, 2000 * WHOLE, 20 * BOX_CHANGE]);
}

#[test]
fn only_boxes_that_jump_or_change_their_filter_restart() {
    needs_gpu!();
    let (mut world, mut gpu) = (DeviceWorld::new(&set("unit", 2000)), with(GpuOptions::DEFAULT));
    world.follow(&mut gpu).expect("a device");
    world.shift(5, [0.3; 3]);
    world.shift(6, [50.0, 0.0, 0.0]);
    world.set(7, world.boxes[7], ProxyFilter { mask: 2, ..ProxyFilter::ALL });
    world.put(8, Aabb::NOWHERE);
    world.remove(9);
    world.set(2000, world.boxes[3], ProxyFilter::ALL);
    let tracked = world.follow(&mut gpu).expect("a device");
    assert_eq!(tracked.restarted, [6, 7]);
    // A ground that moves far still overlaps its old place, so it is not new.
    world.put(10, Aabb::new([f32::MIN; 3], [f32::MAX, -50.0, f32::MAX]));
    world.follow(&mut gpu).expect("a device");
    world.put(10, Aabb::new([f32::MIN; 3], [f32::MAX, 7.0, f32::MAX]));
    let tracked = world.follow(&mut gpu).expect("a device");
    assert_eq!((tracked.restarted.len(), tracked.pairs.is_empty()), (0, false));
}

/// Pairs at rest are rejected before their boxes are read, so tests are proportional to the changes.
#[test]
fn boxes_at_rest_are_not_tested() {
    needs_gpu!();
    let (mut world, mut gpu) = (DeviceWorld::new(&set("pile", 6000)), with(GpuOptions::DEFAULT));
    let tested = |tracked: &DeviceFound| tracked.checks.made - tracked.checks.redundant;
    let all = tested(&world.follow(&mut gpu).expect("a device"));
    jostle(&mut world, 600, 0.01);
    let few = tested(&world.follow(&mut gpu).expect("a device"));
    assert!(few > 0 && few * 100 < all, "{few} tests for 10 boxes, {all} for 6000");
}

#[test]
fn memory_shrinks_with_the_need_and_no_state_is_lost() {
    needs_gpu!();
    let (mut world, mut gpu) = (DeviceWorld::new(&set("pile", 20_000)), with(GpuOptions::DEFAULT));
    let burst = world.follow(&mut gpu).expect("a device").report.device_bytes;
    (300..20_000).for_each(|id| world.remove(id));
    world.boxes.truncate(300);
    world.filters.truncate(300);
    world.changed.retain(|&id, _| id < 300);
    let mut held = 0;
    for _ in 0..140 {
        jostle(&mut world, 5, 0.05);
        held = world.follow(&mut gpu).expect("a device").report.device_bytes;
    }
    assert!(held * 4 < burst, "{held} of {burst} bytes are still held");
}

#[test]
fn too_many_pairs_are_an_error_and_the_update_can_be_repeated() {
    needs_gpu!();
    let cubes = vec![Aabb::new([0.0; 3], [1.0; 3]); 1200];
    let (mut world, mut gpu) = (DeviceWorld::new(&cubes), with(GpuOptions::DEFAULT));
    let error = world.follow_within(&mut gpu, 600_000).expect_err("719,400 pairs");
    assert_eq!(error, DeviceFailure::TooManyPairs);
    world.follow(&mut gpu).expect("the device works");
    // As many pairs end, which does not count against the limit.
    (0..1200).for_each(|id| world.put(id, Aabb::from_center([id as f32 * 9.0, 0.0, 0.0], [0.5; 3])));
    world.put(0, Aabb::NOWHERE);
    let tracked = world.follow_within(&mut gpu, 600_000).expect("few pairs are new");
    assert!(world.kept.is_empty() && !tracked.restarted.is_empty());
}
