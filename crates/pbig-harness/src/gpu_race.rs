//! Two broad phases that see the same boxes, one on the CPU and one on a device.

use crate::bench::timed;
use crate::boxes::Wander;
use crate::output::{Failure, check};
use crate::runner::Spread;
use pbig_core::{Aabb, Backend, BroadPhase, Config, DeviceReport, Limits, ProxyFilter, Report};
use pbig_gpu::GpuFinder;

#[derive(Debug)]
pub struct Raced {
    /// Median times of an update on the CPU and on the device, in ms.
    pub ms: [f64; 2],
    pub pairs: usize,
    /// Pairs that were added or removed in the last round.
    pub events: usize,
}

/// Lets a share of these boxes move by up to a distance, for some rounds.
///
/// # Errors
/// A failed check, if CPU and device have different events or if the device leaves an update to the CPU.
pub fn race(gpu: &GpuFinder, start: Vec<Aabb>, share: f64, distance: f32) -> Result<Raced, Failure> {
    let config = |backend| Config { backend, limits: Limits::UNLIMITED, ..Config::DEFAULT };
    let on_gpu = BroadPhase::with_device(config(Backend::Device), Box::new(gpu.clone()))?;
    let mut sides = [BroadPhase::new(config(Backend::Cpu))?, on_gpu];
    let all: Vec<u32> = (0..start.len() as u32).collect();
    let mut wander = Wander::new(start, share, distance);
    for side in &mut sides {
        update(side, &all, &wander.boxes)?;
    }
    let mut times: [Vec<f64>; 2] = Default::default();
    for round in 0..if all.len() > 100_000 { 5 } else { 9 } {
        let moved = wander.step(round);
        for (side, times) in sides.iter_mut().zip(&mut times) {
            let ms = update(side, &moved, &wander.boxes)?;
            // The first rounds allocate and learn.
            times.extend((round > 1).then_some(ms));
        }
        let what = || format!("events of {} boxes, {share} moved: CPU and GPU differ", all.len());
        check(sides[0].events() == sides[1].events(), what)?;
        on_device(sides[1].report())?;
    }
    let events = sides[1].events().added.len() + sides[1].events().removed.len();
    let ms = times.map(|times| Spread::of(times).median);
    Ok(Raced { ms, pairs: sides[1].pair_count(), events })
}

/// Sets what has moved and updates; returns the milliseconds.
fn update(broad_phase: &mut BroadPhase, moved: &[u32], boxes: &[Aabb]) -> Result<f64, Failure> {
    let (done, ms) = timed(|| {
        broad_phase.set_many(moved, |id| Some((boxes[id as usize], ProxyFilter::ALL)))?;
        broad_phase.update().map(|_| ())
    });
    Ok(done.map(|()| ms)?)
}

/// Returns the report of the device. If the device left the call to the CPU, this is an error.
pub fn on_device(report: &Report) -> Result<&DeviceReport, Failure> {
    let why = || Failure::Check(report.fallback.clone().unwrap_or_else(|| "the CPU did the work".into()));
    report.device.as_ref().ok_or_else(why)
}
