//! Readback: what a submission found comes to the host. With `engine`, the only place that maps.

use super::GpuError;
use super::commands::{Commands, MOST_PASSES};
use super::engine::Engine;
use crate::layout::{Counters, Totals};
use bytemuck::{Pod, Zeroable};
use std::sync::mpsc;
use std::time::Duration;

/// What comes before the words of output in a staging buffer.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct Head {
    pub(super) counters: Counters,
    pub(super) totals: Totals,
    /// 16 + 40 bytes before: timestamps must begin at a multiple of 8.
    ticks: [u64; 2 * MOST_PASSES as usize],
}

pub(super) const HEAD: u64 = size_of::<Head>() as u64;
const TOTALS_AT: u64 = size_of::<Counters>() as u64;
const TICKS_AT: u64 = TOTALS_AT + size_of::<Totals>() as u64;

impl Head {
    /// Device time of each pass. Ticks that run backwards, as some drivers' do across a reset, are 0.
    pub(super) fn times(&self, passes: &[&'static str], period: f32) -> Vec<(&'static str, Duration)> {
        let time = |i: usize| {
            let ticks = self.ticks[2 * i + 1].saturating_sub(self.ticks[2 * i]);
            Duration::from_nanos((ticks as f64 * f64::from(period)) as u64)
        };
        passes.iter().enumerate().map(|(i, &name)| (name, time(i))).collect()
    }
}

/// A query set for the passes of a submission, with the buffer that it is resolved to.
#[derive(Debug)]
pub(super) struct Clock {
    pub(super) queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
}

impl Clock {
    /// None where the device has no timestamps.
    pub(super) fn new(engine: &Engine) -> Result<Option<Self>, GpuError> {
        if !engine.timestamps {
            return Ok(None);
        }
        let count = 2 * MOST_PASSES;
        let usage = wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC;
        Ok(Some(Self {
            queries: engine.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("times"),
                ty: wgpu::QueryType::Timestamp,
                count,
            }),
            resolved: engine.buffer("times", u64::from(count) * 8, usage)?,
        }))
    }
}

/// Records the copies that end a submission: the head, and the first `prefetch` bytes of output, which
/// are as many as the last call needed (PBIG 5.3).
pub(super) fn record(commands: &mut Commands<'_>, clock: Option<&Clock>, prefetch: u64) {
    let staging = commands.buffer("staging");
    let (totals, out) = (commands.buffer("totals"), commands.buffer("out"));
    let counters = commands.storage.get("counters");
    let encoder = &mut commands.encoder;
    encoder.copy_buffer_to_buffer(counters, 0, staging, 0, TOTALS_AT);
    encoder.copy_buffer_to_buffer(totals, 0, staging, TOTALS_AT, size_of::<Totals>() as u64);
    if let Some(clock) = clock {
        let used = 2 * commands.passes.len() as u32;
        encoder.resolve_query_set(&clock.queries, 0..used, &clock.resolved, 0);
        encoder.copy_buffer_to_buffer(&clock.resolved, 0, staging, TICKS_AT, u64::from(used) * 8);
    }
    if prefetch > 0 {
        encoder.copy_buffer_to_buffer(out, 0, staging, HEAD, prefetch);
    }
}

/// Waits for a submission and shows the first `bytes` of a staging buffer that it has filled.
pub(super) fn read<T>(
    engine: &Engine,
    staging: &wgpu::Buffer,
    bytes: u64,
    submission: wgpu::SubmissionIndex,
    patience: Duration,
    show: impl FnOnce(&[u8]) -> T,
) -> Result<T, GpuError> {
    let (sender, mapped) = mpsc::channel();
    staging.map_async(wgpu::MapMode::Read, 0..bytes, move |result| {
        // Nobody listens any more if the wait was given up.
        let _ = sender.send(result);
    });
    engine.wait(submission, patience)?;
    // Another thread that polls the device may be the one that calls back, a moment later.
    if !matches!(mapped.recv_timeout(patience), Ok(Ok(()))) {
        return Err(engine.give_up());
    }
    let view = staging.get_mapped_range(0..bytes).map_err(|_| engine.give_up())?;
    let shown = show(&view);
    drop(view);
    staging.unmap();
    Ok(shown)
}
