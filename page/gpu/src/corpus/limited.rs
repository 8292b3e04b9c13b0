//! Tiny limits: what does not fit is done in parts and chunks, and what a device must not do is the CPU's, with the reason.

use super::parts::{Counts, open, set};
use super::relay::{Found, ON_CPU, ON_DEVICE, Relay, check, compare, expect, expect_device};
use pbig_core::{Aabb, BroadPhase, DeviceFailure, DeviceReport, Order, ProxyFilter};
use pbig_gpu::{Coding, GpuFinder, GpuOptions};
use pbig_harness::hard::crossing;

/// The smallest limit of a buffer that pbig takes: no more than 131,072 plain pairs.
const SMALLEST: GpuOptions = GpuOptions { max_bytes: 1 << 20, all_pairs_up_to: 0, ..GpuOptions::DEFAULT };

fn cubes(n: usize) -> Vec<Aabb> {
    vec![Aabb::new([0.0; 3], [1.0; 3]); n]
}

/// Returns the report on the device, which must have done the work.
fn by_device(found: Found) -> Result<DeviceReport, String> {
    expect_device(&found.report)?;
    found.report.device.ok_or_else(|| "no device did the work".to_owned())
}

/// Uses settings with tiny limits.
pub(super) async fn by_options() -> Result<Counts, String> {
    let gpu = open().await?;
    let (parts, repeats) = (in_parts(&gpu).await?, repeated(&gpu).await?);
    let (chunks, events) = (in_chunks(&gpu).await?, many_events(&gpu).await?);
    let declined = declined(gpu).await?;
    Ok(vec![
        ("parts", parts),
        ("repeats", repeats),
        ("chunks", chunks),
        ("events", events),
        ("declined", declined),
    ])
}

/// Finds sets of which a buffer holds a part. Returns the number of parts.
async fn in_parts(gpu: &GpuFinder) -> Result<u32, String> {
    let mut parts = 0;
    for (boxes, fewest) in [(set("uniform", 50_000), 3), (set("unit", 50_000), 3), (cubes(1500), 1)] {
        for coding in [Coding::Plain, Coding::Packed] {
            let gpu = &mut gpu.clone().with_options(GpuOptions { coding, ..SMALLEST });
            let report = by_device(check(gpu, &boxes, None).await?)?;
            if report.parts < fewest {
                return Err(format!("{} boxes, {coding:?}: {} parts", boxes.len(), report.parts));
            }
            parts += report.parts;
        }
    }
    Ok(parts)
}

/// Finds sets whose lists begin far too small, twice. Returns the number of repeats.
async fn repeated(gpu: &GpuFinder) -> Result<u32, String> {
    let mut repeats = 0;
    for boxes in [set("uniform", 9000), set("pile", 3000), cubes(600)] {
        for coding in [Coding::Plain, Coding::Packed] {
            let tiny = GpuOptions { first_bytes: 0, all_pairs_up_to: 0, coding, ..GpuOptions::DEFAULT };
            let gpu = &mut gpu.clone().with_options(tiny);
            let first = by_device(check(gpu, &boxes, None).await?)?.repeats;
            let next = by_device(check(gpu, &boxes, None).await?)?.repeats;
            if first == 0 || next > 0 {
                return Err(format!("{} boxes, {coding:?}: {first} repeats, then {next}", boxes.len()));
            }
            repeats += first;
        }
    }
    Ok(repeats)
}

/// Finds sets in chunks of a few work items. Returns the number of chunks.
async fn in_chunks(gpu: &GpuFinder) -> Result<u32, String> {
    let mut chunks = 0;
    for boxes in [set("pile", 2000), set("mixed", 2000), cubes(700)] {
        for (small_cell, pipelining) in [(1, true), (32, false), (256, true)] {
            let tiny =
                GpuOptions { chunk: [12, 8], first_bytes: 0, all_pairs_up_to: 0, ..GpuOptions::DEFAULT };
            let gpu = &mut gpu.clone().with_options(GpuOptions { small_cell, pipelining, ..tiny });
            let report = by_device(check(gpu, &boxes, None).await?)?;
            if report.chunks < 2 {
                return Err(format!("{} boxes, cells of {small_cell}: one chunk", boxes.len()));
            }
            chunks += report.chunks;
        }
    }
    Ok(chunks)
}

/// Updates a world whose events exceed a buffer: all begin, then all end. Returns the number of events.
async fn many_events(gpu: &GpuFinder) -> Result<u32, String> {
    let mut events = 0;
    for all_pairs_up_to in [0, 2000] {
        let gpu = &mut gpu.clone().with_options(GpuOptions { all_pairs_up_to, ..SMALLEST });
        let cpu = BroadPhase::new(ON_CPU).map_err(|error| error.to_string())?;
        let relay = Relay::default();
        let mut worlds = [relay.world(ON_DEVICE)?, cpu];
        let apart = (0..1500).map(|id| Aabb::from_center([9.0 * id as f32; 3], [0.5; 3])).collect();
        for boxes in [cubes(1500), apart] {
            events += both(&mut worlds, &boxes, (&relay, gpu)).await?;
        }
    }
    Ok(events)
}

/// Updates two worlds to the same boxes. Returns the number of events, which must be the same.
async fn both(
    worlds: &mut [BroadPhase; 2],
    boxes: &[Aabb],
    (relay, gpu): (&Relay, &mut GpuFinder),
) -> Result<u32, String> {
    let ids: Vec<u32> = (0..boxes.len() as u32).collect();
    for world in worlds.iter_mut() {
        let put = world.set_many(&ids, |id| Some((boxes[id as usize], ProxyFilter::ALL)));
        put.map_err(|error| error.to_string())?;
    }
    relay.ask(&worlds[0], gpu).await;
    let [ours, cpu] = worlds.each_mut().map(|world| world.update().cloned());
    expect_device(worlds[0].report())?;
    if ours != cpu {
        return Err("the CPU has other events".to_owned());
    }
    ours.map(|events| (events.added.len() + events.removed.len()) as u32).map_err(|error| error.to_string())
}

/// Finds a set that takes too many tests, and the next one. Returns the number of declined sets.
async fn declined(mut gpu: GpuFinder) -> Result<u32, String> {
    let mut number = 0;
    for _ in 0..2 {
        expect(&check(&mut gpu, &crossing(20_000), None).await?.report, "declined")?;
        by_device(check(&mut gpu, &set("unit", 2000), None).await?)?;
        number += 1;
    }
    Ok(number)
}

/// Uses a device that allows buffers of 2 MiB and bindings of 1 MiB.
pub(super) async fn by_device_limits() -> Result<Counts, String> {
    let (mut gpu, mut parts) = (open().await?, 0);
    for boxes in [set("unit", 50_000), cubes(1500)] {
        for call in 0..2 {
            let report = by_device(check(&mut gpu, &boxes, None).await?)?;
            if boxes.len() > 2000 && report.parts < 2 {
                return Err(format!("call {call}: {} parts", report.parts));
            }
            parts += report.parts;
        }
    }
    Ok(vec![("parts", parts)])
}

/// Asks for a device that allows less than the kernels need: the CPU does the work.
pub(super) async fn refused() -> Result<Counts, String> {
    let why = match open().await {
        Ok(gpu) => return Err(format!("{} is not refused", gpu.adapter())),
        Err(why) => why,
    };
    let found = compare(Order::Sorted, Err(DeviceFailure::Failed(why)), &set("pile", 2000), None)?;
    expect(&found.report, "the device allows")?;
    Ok(vec![("pairs", found.pairs.len() as u32)])
}
