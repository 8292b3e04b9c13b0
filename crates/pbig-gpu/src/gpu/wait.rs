//! Waiting for the device in a program: the thread blocks, so futures here are ready at once.

use super::error::{GpuError, Result};
use super::gpu_device::{GpuDevice, lock};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc;
use std::time::Duration;

/// Blocks until a future is done.
pub(super) fn block_on<T>(future: impl Future<Output = Result<T>>) -> Result<T> {
    pollster::block_on(future)
}

/// Waits for a submission, and maps the first `bytes` of the staging buffer that it has filled.
pub(super) async fn map(
    device: &GpuDevice,
    staging: &wgpu::Buffer,
    bytes: u64,
    submission: wgpu::SubmissionIndex,
    patience: Duration,
) -> Result<()> {
    let (sender, mapped) = mpsc::channel();
    staging.map_async(wgpu::MapMode::Read, 0..bytes, move |result| {
        // The receiver is gone if the wait was given up.
        let _ = sender.send(result);
    });
    device.wait(submission, patience)?;
    // If another thread polls the device, that thread calls back, perhaps a moment later.
    match mapped.recv_timeout(patience) {
        Ok(Ok(())) => Ok(()),
        _ => Err(device.give_up()),
    }
}

impl GpuDevice {
    /// Lets wgpu call back for what the device has done.
    pub(super) fn poll_now(&self) {
        if self.poll(wgpu::PollType::Poll).is_err() {
            self.give_up();
        }
    }

    pub(super) fn is_alive(&self) -> bool {
        self.is_idle_within(Duration::from_secs(1))
    }

    /// Returns true if the device finishes all its work, and an empty submission, in time.
    pub(super) fn is_idle_within(&self, limit: Duration) -> bool {
        let scope = self.handle.push_error_scope(wgpu::ErrorFilter::Validation);
        let submission = self.queue.submit([self.encoder().finish()]);
        let finished = self.poll(wait_for(submission, limit)).is_ok();
        let refused = pollster::block_on(scope.pop()).is_some();
        finished && !refused
    }

    /// Waits for a submission, at most for `patience`.
    fn wait(&self, submission: wgpu::SubmissionIndex, patience: Duration) -> Result<()> {
        match self.poll(wait_for(submission, patience)) {
            Ok(()) => Ok(()),
            Err(Some(wgpu::PollError::Timeout)) => {
                self.give_up();
                // Dropping the last handle of a queue waits for it without a limit, so a handle is leaked.
                std::mem::forget((self.handle.clone(), self.queue.clone()));
                Err(GpuError::Timeout(patience))
            }
            // wgpu did not accept the submission. The error scopes know why.
            Err(Some(_)) if self.is_alive() => Err(GpuError::Refused("the submission".into())),
            Err(_) => Err(self.give_up()),
        }
    }

    /// Returns `Err(None)` if wgpu panicked, as it does when the driver reports a lost device.
    fn poll(&self, how: wgpu::PollType) -> Result<(), Option<wgpu::PollError>> {
        let poll = || {
            lock(&self.hook)(&self.handle);
            self.handle.poll(how)
        };
        match catch_unwind(AssertUnwindSafe(poll)) {
            Ok(polled) => polled.map(|_| ()).map_err(Some),
            Err(_) => Err(None),
        }
    }
}

fn wait_for(submission: wgpu::SubmissionIndex, limit: Duration) -> wgpu::PollType {
    wgpu::PollType::Wait { submission_index: Some(submission), timeout: Some(limit) }
}
