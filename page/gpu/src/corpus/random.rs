//! Random sets in all modes, and random changes, beside the CPU and brute force.

use super::modes::{MODES, Mode, filters};
use super::parts::{Counts, open};
use super::relay::{Found, ON_CPU, ON_DEVICE, Relay, check_in, expect, expect_device};
use pbig_core::{Aabb, BroadPhase, Order, ProxyFilter, Report, oracle};
use pbig_gpu::{Coding, GpuFinder, GpuOptions};
use pbig_harness::corpus::{difference, random_case};
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
    let modes: Vec<_> = MODES.iter().filter(|mode| boxes <= mode.most_boxes).collect();
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

/// Updates random worlds with and without a grid, and in small chunks, beside the CPU's.
pub(super) async fn changes() -> Result<Counts, String> {
    let gpu = open().await?;
    let mut played = Played::default();
    for seed in 0..2 {
        for (options, boxes) in ways() {
            let gpu = &mut gpu.clone().with_options(options);
            let told = |why| format!("seed {seed}, {boxes} boxes, {options:?}: {why}");
            play_beside(gpu, seed, boxes, &mut played).await.map_err(told)?;
        }
    }
    Ok(vec![("updates", played.updates), ("events", played.events)])
}

/// Returns settings, and the numbers of boxes to use them with.
fn ways() -> Vec<(GpuOptions, u32)> {
    let codings = [Coding::Auto, Coding::Plain, Coding::Packed];
    let with = |coding, all_pairs_up_to| GpuOptions { coding, all_pairs_up_to, ..GpuOptions::DEFAULT };
    let mut ways: Vec<_> =
        codings.iter().flat_map(|&coding| [(with(coding, 0), 90), (with(coding, 1024), 90)]).collect();
    for (coding, small_cell) in [(Coding::Plain, 1), (Coding::Packed, 32)] {
        ways.push((GpuOptions { chunk: [2, 1], first_bytes: 0, small_cell, ..with(coding, 0) }, 200));
    }
    ways
}

/// Plays the changes of a random world in a broad phase with the device, and in one of the CPU.
async fn play_beside(gpu: &mut GpuFinder, seed: u64, boxes: u32, played: &mut Played) -> Result<(), String> {
    let (relay, rng) = (Relay::default(), &mut StdRng::seed_from_u64(seed));
    let cpu = BroadPhase::new(ON_CPU).map_err(|error| error.to_string())?;
    let mut worlds = [relay.world(ON_DEVICE)?, cpu];
    for number in 0..UPDATES {
        for _ in 0..rng.random_range(1..2 * boxes) {
            change(&mut worlds, rng.random_range(0..boxes), rng)?;
        }
        relay.ask(&worlds[0], gpu).await;
        played.events += update_both(&mut worlds).map_err(|why| format!("update {number}: {why}"))?;
        played.updates += 1;
    }
    Ok(())
}

/// Sets or removes a box, the same one in each world. Many touch.
fn change(worlds: &mut [BroadPhase; 2], id: u32, rng: &mut StdRng) -> Result<(), String> {
    let at: [f32; 3] = std::array::from_fn(|_| rng.random_range(0..22) as f32 / 2.0);
    let half = [0.5, 0.5, 0.5, 1.5, 30.0, f32::INFINITY, f32::NAN][rng.random_range(0..7)];
    let filter = ProxyFilter { body: id / 2, mask: 1 << rng.random_range(0..3), ..ProxyFilter::ALL };
    let stays = rng.random_ratio(9, 10);
    for world in worlds {
        if stays {
            let set = world.set(id, Aabb::from_center(at, [half, 0.5, 0.5]), filter);
            set.map_err(|error| error.to_string())?;
        } else {
            world.remove(id);
        }
    }
    Ok(())
}

/// Updates, and compares events and pairs. Returns the number of events.
fn update_both([ours, cpu]: &mut [BroadPhase; 2]) -> Result<u32, String> {
    let (events, wanted) = (ours.update(), cpu.update());
    if events != wanted {
        return Err("the CPU has other events".to_owned());
    }
    let count = events.map(|events| events.added.len() + events.removed.len());
    expect_device(ours.report())?;
    if !ours.pairs().eq(cpu.pairs()) {
        return Err("the CPU has other pairs".to_owned());
    }
    count.map(|count| count as u32).map_err(|error| error.to_string())
}
