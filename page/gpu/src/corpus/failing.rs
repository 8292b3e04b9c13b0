//! Faults that are injected into the device, as in the suite: the CPU finishes the call, and the report says why.

use super::parts::{Counts, open, set};
use super::relay::{ON_DEVICE, Relay};
use pbig_core::{Aabb, Config};
use pbig_gpu::testing::{FAULTS, Fault};
use pbig_gpu::{GpuFinder, GpuOptions};
use pbig_harness::follower::Follower;
use std::time::Duration;

/// Number of frames of a run.
const FRAMES: usize = 12;

/// Returns the faults that can happen in a page: it never waits with a limit, and a panic would end it.
fn faults_of_a_page() -> impl Iterator<Item = (Fault, &'static str, u32)> {
    let can_happen = |fault: &Fault| !matches!(fault, Fault::Timeout | Fault::Panic);
    let all = FAULTS.iter().filter(move |(fault, ..)| can_happen(fault));
    all.flat_map(|(fault, word, moments)| moments.iter().map(|&at| (*fault, *word, at)))
}

/// Plays frames in which the device fails once. With a pause it is not tried again, without one it is.
pub(super) async fn faults() -> Result<Counts, String> {
    let (mut failed, mut paused, mut recovered) = (0, 0, 0);
    for (fault, word, at) in faults_of_a_page() {
        for pause in [Duration::ZERO, Duration::from_secs(3600)] {
            let options = GpuOptions { pause, first_bytes: 0, chunk: [12, 8], ..GpuOptions::DEFAULT };
            let gpu = open().await?.with_options(options);
            gpu.inject(fault, at);
            let told = |why| format!("{fault:?} after {at} submissions, pause {pause:?}: {why}");
            let is_used_again = frames(gpu, word).await.map_err(told)?;
            if is_used_again != pause.is_zero() {
                return Err(told(format!("the device is used again: {is_used_again}")));
            }
            failed += 1;
            *(if is_used_again { &mut recovered } else { &mut paused }) += 1;
        }
    }
    Ok(vec![("faults", failed), ("devices used again", recovered), ("devices paused", paused)])
}

/// Plays frames, compared with brute force. Returns true if the device is used in the frames after its fault.
async fn frames(mut gpu: GpuFinder, word: &str) -> Result<bool, String> {
    let start = set("pile", 600);
    let relay = Relay::default();
    let broad_phase = relay.world(Config { margin: 0.05, ..ON_DEVICE })?;
    let mut world = Follower::new(broad_phase, start.len());
    let mut reasons = Vec::new();
    for number in 0..FRAMES {
        reasons.push(frame(&mut world, &start, number, (&relay, &mut gpu)).await?);
    }
    let is_fault = |why: &Option<String>| why.as_ref().is_some_and(|why| why.contains(word));
    let failed = reasons.iter().position(is_fault).ok_or("the fault was not reported")?;
    let has_worked = reasons[..failed].iter().all(Option::is_none);
    let (after, is_used_again) =
        (&reasons[failed + 1..], reasons.get(failed + 1).is_some_and(Option::is_none));
    // It stays in use, or paused, to the end.
    let is_steady = after.iter().all(|why| why.is_none() == is_used_again);
    if has_worked && is_steady && !after.is_empty() { Ok(is_used_again) } else { Err(format!("{reasons:?}")) }
}

/// Plays a frame. Returns why the CPU did the device's work, if it did.
async fn frame(
    world: &mut Follower,
    start: &[Aabb],
    number: usize,
    (relay, gpu): (&Relay, &mut GpuFinder),
) -> Result<Option<String>, String> {
    world.set_frame(start, number)?;
    relay.ask(&world.broad_phase, gpu).await;
    world.update()?;
    Ok(world.broad_phase.report().fallback.clone())
}
