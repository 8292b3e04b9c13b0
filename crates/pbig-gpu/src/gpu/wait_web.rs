//! Waiting for the device in a page, where nothing may block: the browser calls back.

use super::error::{GpuError, Result};
use super::gpu_device::{GpuDevice, lock};
use std::future::poll_fn;
use std::sync::{Arc, Mutex};
use std::task::{Poll, Waker};
use std::time::Duration;

/// Returns an error: a page may not block.
pub(super) fn block_on<T>(_: impl Future<Output = Result<T>>) -> Result<T> {
    Err(GpuError::WouldBlock)
}

/// The result of a mapping, and the task that waits for it.
type Mapping = (Option<Result<(), wgpu::BufferAsyncError>>, Option<Waker>);

/// Waits until the first `bytes` of a staging buffer are mapped, after the submission that fills it.
pub(super) async fn map(
    device: &GpuDevice,
    staging: &wgpu::Buffer,
    bytes: u64,
    _: wgpu::SubmissionIndex,
    _: Duration,
) -> Result<()> {
    let mapping = Arc::new(Mutex::new(Mapping::default()));
    let told = mapping.clone();
    staging.map_async(wgpu::MapMode::Read, 0..bytes, move |result| {
        let mut mapping = lock(&told);
        mapping.0 = Some(result);
        mapping.1.take().into_iter().for_each(Waker::wake);
    });
    let mapped = poll_fn(|context| {
        let mut mapping = lock(&mapping);
        mapping.1 = Some(context.waker().clone());
        mapping.0.take().map_or(Poll::Pending, Poll::Ready)
    });
    mapped.await.map_err(|_| device.give_up())
}

impl GpuDevice {
    /// Does nothing: the browser calls back.
    pub(super) fn poll_now(&self) {}

    /// Returns true: a lost device does not refuse commands, but it maps no buffer.
    pub(super) fn is_alive(&self) -> bool {
        true
    }

    /// Returns false: the page would have to wait to find out.
    pub(super) fn is_idle_within(&self, _: Duration) -> bool {
        false
    }
}
