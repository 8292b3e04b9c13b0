//! Devices that are lost between calls and within one: each call ends, and its pairs are those of the CPU.

use super::parts::{Counts, open, set};
use super::relay::{check, compare, expect, expect_device};
use crate::device::request;
use pbig_core::{Aabb, DeviceFound, Order, Report, SearchRequest};
use pbig_gpu::testing::Fault;
use pbig_gpu::{Coding, GpuFinder, GpuOptions};
use std::future::poll_fn;
use std::pin::pin;
use std::task::Context;
use std::time::Duration;

/// A lost device is replaced in the next call.
const AT_ONCE: GpuOptions = GpuOptions { pause: Duration::ZERO, ..GpuOptions::DEFAULT };

/// Loses devices in every way.
pub(super) async fn devices() -> Result<Counts, String> {
    let within = at_any_moment().await?;
    let (waiting, given) = (while_it_works().await?, between_calls().await?);
    Ok(vec![("within a call", within), ("while the page waits", waiting), ("between calls", given)])
}

/// Loses pbig's own device after a number of submissions. The next call opens another one.
async fn at_any_moment() -> Result<u32, String> {
    let chunks = GpuOptions { chunk: [48, 32], first_bytes: 0, coding: Coding::Packed, ..AT_ONCE };
    let in_parts = GpuOptions { max_bytes: 1 << 20, ..AT_ONCE };
    let mut all = 0;
    for (boxes, options, most) in [(set("mixed", 3000), chunks, 8), (set("unit", 45_000), in_parts, 2)] {
        let mut lost = 0;
        for after in 0..most {
            let mut gpu = open().await?.with_options(options);
            gpu.inject(Fault::LoseDevice, after);
            let told = |why| format!("{} boxes, lost after {after} submissions: {why}", boxes.len());
            lost += u32::from(lose(&mut gpu, &boxes).await.map_err(told)?);
        }
        if 5 * lost < 4 * most {
            return Err(format!("{} boxes: {lost} of {most} devices were lost", boxes.len()));
        }
        all += lost;
    }
    Ok(all)
}

/// Finds pairs while the device is lost, and again. Returns true if it was lost in the first call.
async fn lose(gpu: &mut GpuFinder, boxes: &[Aabb]) -> Result<bool, String> {
    let first = check(gpu, boxes, None).await?.report;
    let is_lost = first.fallback.is_some();
    if is_lost {
        expect(&first, "the device was lost")?;
        expect_device(&check(gpu, boxes, None).await?.report)?;
    }
    Ok(is_lost)
}

/// Returns a device of the app, and a finder that uses it.
async fn given() -> Result<(wgpu::Device, GpuFinder), String> {
    let (handle, queue) = request().await?;
    let gpu = GpuFinder::from_device(handle.clone(), queue).map_err(|error| error.to_string())?;
    Ok((handle, gpu.with_options(AT_ONCE)))
}

/// Destroys the app's device between two calls. It is not replaced; another one works.
async fn between_calls() -> Result<u32, String> {
    let (boxes, mut lost) = (set("pile", 2000), 0);
    for _ in 0..2 {
        let (handle, mut gpu) = given().await?;
        expect_device(&check(&mut gpu, &boxes, None).await?.report)?;
        handle.destroy();
        for _ in 0..2 {
            expect(&check(&mut gpu, &boxes, None).await?.report, "the device was lost")?;
        }
        lost += 1;
    }
    Ok(lost)
}

/// Destroys the app's device in each of the first waits of a call in chunks: in the first call, which compiles, and in a later one.
async fn while_it_works() -> Result<u32, String> {
    let (boxes, mut lost) = (set("mixed", 1000), 0);
    for (polls, calls_before) in (1..=3).flat_map(|polls| [(polls, 0), (polls, 1)]) {
        let (handle, gpu) = given().await?;
        let mut gpu = gpu.with_options(GpuOptions { chunk: [12, 8], all_pairs_up_to: 0, ..AT_ONCE });
        for _ in 0..calls_before {
            expect_device(&check(&mut gpu, &boxes, None).await?.report)?;
        }
        let told = |why| format!("destroyed after {polls} polls of call {calls_before}: {why}");
        let report = destroyed(&mut gpu, &boxes, polls, &handle).await.map_err(told)?;
        if report.fallback.is_some() {
            expect(&report, "the device was lost").map_err(told)?;
            lost += 1;
        }
        expect(&check(&mut gpu, &boxes, None).await?.report, "the device was lost").map_err(told)?;
    }
    Ok(lost)
}

/// Destroys the device when a call waits for this time.
async fn destroyed(
    gpu: &mut GpuFinder,
    boxes: &[Aabb],
    polls: u32,
    handle: &wgpu::Device,
) -> Result<Report, String> {
    let request = SearchRequest { boxes, filters: None, is_sorted: true, max_pairs: u64::MAX };
    let (mut found, mut done) = (DeviceFound::default(), 0);
    let result = {
        let mut call = pin!(gpu.find_all_async(&request, &mut found));
        let poll = |context: &mut Context<'_>| {
            let result = call.as_mut().poll(context);
            done += 1;
            if done == polls {
                handle.destroy();
            }
            result
        };
        poll_fn(poll).await
    };
    if done < polls {
        return Err(format!("the call ended after {done} polls"));
    }
    Ok(compare(Order::Sorted, result.map(|()| found), boxes, None)?.report)
}
