//! Random sets in all modes, and random changes, beside the CPU and brute force.

use super::modes::{MODES, Mode, filters};
use super::parts::{Counts, open};
use super::relay::{Found, ON_CPU, ON_DEVICE, Relay, check, check_in, expect, expect_device};
use super::update;
use pbig_core::{Aabb, BroadPhase, Order, PairDevice, Report, oracle};
use pbig_gpu::{Coding, GpuFinder, GpuOptions};
use pbig_harness::corpus::{difference, random_case};
use pbig_harness::device_world::DeviceWorld;
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

/// Number of random sets.
const SETS: u64 = 160;

/// Number of updates of a random world.
const UPDATES: u32 = 14;

/// Finds the pairs of random sets, with and without filters, in random modes.
pub(super) async fn sets() -> Result<Counts, String> {
    let mut gpu = open().await?;
    let (mut pairs, mut by_device) = (0, 0);
    for seed in 0..SETS {
        let (case, rng) = (random_case(seed), &mut StdRng::seed_from_u64(!seed));
        let mode = mode_for(case.boxes.len(), rng);
        gpu = gpu.with_options(mode.options());
        let report = random_set(&mut gpu, mode, &case.boxes, rng.random()).await;
        let report = report.map_err(|why| format!("{}, {}: {why}", case.name, mode.name))?;
        pairs += report.pairs as u32;
        by_device += u32::from(report.device.is_some());
        if report.fallback.is_some() {
            // It would decline sets of this size unseen.
            gpu = gpu.clone();
        }
    }
    if by_device < SETS as u32 * 3 / 4 {
        return Err(format!("the device found {by_device} of {SETS} sets"));
    }
    Ok(vec![("sets", SETS as u32), ("by the device", by_device), ("pairs", pairs)])
}

/// Returns a mode that takes this number of boxes.
fn mode_for(boxes: usize, rng: &mut StdRng) -> &'static Mode {
    let takes = |mode: &&Mode| !mode.finds_changes && boxes <= mode.most_boxes;
    let modes: Vec<_> = MODES.iter().filter(takes).collect();
    modes[rng.random_range(0..modes.len())]
}

async fn random_set(
    gpu: &mut GpuFinder,
    mode: &Mode,
    boxes: &[Aabb],
    has_filters: bool,
) -> Result<Report, String> {
    let filters = filters(boxes.len());
    let (filters, wanted) = if has_filters {
        (Some(&filters[..]), oracle::pairs_filtered(boxes, &filters))
    } else {
        (None, oracle::pairs(boxes))
    };
    let order = if mode.is_sorted { Order::Sorted } else { Order::Unspecified };
    let Found { pairs, report } = check_in(order, gpu, boxes, filters).await?;
    difference(&pairs, &wanted).map_or(Ok(()), Err)?;
    if report.fallback.is_some() {
        expect(&report, "declined")?;
    }
    Ok(report)
}

/// Numbers of updates and of events.
#[derive(Debug, Default)]
struct Played {
    updates: u32,
    events: u32,
}

/// Follows random worlds with and without a grid, and in small chunks, as the suite does; then updates worlds beside the CPU's.
pub(super) async fn changes() -> Result<Counts, String> {
    let gpu = open().await?;
    let (mut alone, mut beside) = (Played::default(), Played::default());
    for seed in 0..2 {
        for (options, boxes) in ways() {
            let gpu = &mut gpu.clone().with_options(options);
            let told = |why| format!("seed {seed}, {boxes} boxes, {options:?}: {why}");
            follow(gpu, seed, boxes, &mut alone).await.map_err(told)?;
            play_beside(gpu, seed, boxes, &mut beside).await.map_err(told)?;
        }
    }
    let [alone, beside] = [alone, beside].map(|Played { updates, events }| [updates, events]);
    Ok(vec![
        ("updates", alone[0]),
        ("events", alone[1]),
        ("updates beside the CPU", beside[0]),
        ("events beside the CPU", beside[1]),
    ])
}

/// Returns settings, and the numbers of boxes to use them with.
fn ways() -> Vec<(GpuOptions, usize)> {
    let codings = [Coding::Auto, Coding::Plain, Coding::Packed];
    let with = |coding, all_pairs_up_to| GpuOptions { coding, all_pairs_up_to, ..GpuOptions::DEFAULT };
    let mut ways: Vec<_> =
        codings.iter().flat_map(|&coding| [(with(coding, 0), 90), (with(coding, 1024), 90)]).collect();
    for (coding, small_cell) in [(Coding::Plain, 1), (Coding::Packed, 32)] {
        ways.push((GpuOptions { chunk: [2, 1], first_bytes: 0, small_cell, ..with(coding, 0) }, 200));
    }
    ways
}

/// Follows the changes of a random world. Now and then the device misses an update, or finds all pairs.
async fn follow(gpu: &mut GpuFinder, seed: u64, boxes: usize, played: &mut Played) -> Result<(), String> {
    let rng = &mut StdRng::seed_from_u64(seed);
    let mut world = DeviceWorld::random(boxes, rng);
    for number in 0..UPDATES {
        played.events += update(gpu, &mut world).await? as u32;
        played.updates += 1;
        (0..rng.random_range(0..2 * boxes / 3)).for_each(|_| world.disturb(rng));
        match rng.random_range(0..8) {
            0 => {
                world.advance();
                gpu.forget();
            }
            1 => {
                check(gpu, &world.boxes[..boxes / 2], None).await.and_then(|it| expect_device(&it.report))?
            }
            _ => {}
        }
        world.put(0, Aabb::from_center([number as f32; 3], [0.5; 3]));
    }
    Ok(())
}

/// Plays the changes of a random world in a broad phase with the device, and in one of the CPU.
async fn play_beside(
    gpu: &mut GpuFinder,
    seed: u64,
    boxes: usize,
    played: &mut Played,
) -> Result<(), String> {
    let (relay, rng) = (Relay::default(), &mut StdRng::seed_from_u64(seed));
    let cpu = BroadPhase::new(ON_CPU).map_err(|error| error.to_string())?;
    let (mut worlds, mut random) = ([relay.world(ON_DEVICE)?, cpu], DeviceWorld::random(boxes, rng));
    gpu.forget();
    for number in 0..UPDATES {
        for world in &mut worlds {
            put_changes(world, &random)?;
        }
        relay.ask(&worlds[0], gpu).await;
        random.advance();
        played.events +=
            update_both(&mut worlds, &random).map_err(|why| format!("update {number}: {why}"))?;
        played.updates += 1;
        (0..rng.random_range(1..boxes)).for_each(|_| random.disturb(rng));
    }
    Ok(())
}

/// Puts the changes of a world into a broad phase.
fn put_changes(world: &mut BroadPhase, random: &DeviceWorld) -> Result<(), String> {
    for &id in random.changed.keys() {
        let (aabb, filter) = (random.boxes[id as usize], random.filters[id as usize]);
        if aabb.is_valid() || id.is_multiple_of(2) {
            world.set(id, aabb, filter).map_err(|error| error.to_string())?;
        } else {
            world.remove(id);
        }
    }
    Ok(())
}

/// Updates, and compares events and pairs. Returns the number of events.
fn update_both([ours, cpu]: &mut [BroadPhase; 2], random: &DeviceWorld) -> Result<u32, String> {
    let (events, wanted) = (ours.update(), cpu.update());
    if events != wanted {
        return Err("the CPU has other events".to_owned());
    }
    let count = events.map(|events| events.added.len() + events.removed.len());
    expect_device(ours.report())?;
    let mut pairs: Vec<_> = ours.pairs().collect();
    pairs.sort_unstable();
    let wanted: Vec<_> = random.kept.iter().copied().collect();
    difference(&pairs, &wanted).map_or(Ok(()), Err)?;
    count.map(|count| count as u32).map_err(|error| error.to_string())
}
