//! Errors that wgpu reports while a call is in progress.

use super::error::{GpuError, Result};
use super::gpu_device::{GpuDevice, lock};
use super::wait;

impl GpuDevice {
    /// Runs `work`, and returns errors that wgpu reports meanwhile.
    pub(super) async fn watch<T>(&self, work: impl AsyncFnOnce() -> Result<T>) -> Result<T> {
        use wgpu::ErrorFilter::{Internal, OutOfMemory, Validation};
        // The calls of a page share one stack of error scopes. Each thread of a program has its own.
        #[cfg(target_arch = "wasm32")]
        let _in_call = self.in_call.try_lock().map_err(|_| GpuError::Busy)?;
        // Three variables, because a future that is dropped must end the innermost scope first.
        let outer = self.handle.push_error_scope(Validation);
        let middle = self.handle.push_error_scope(OutOfMemory);
        let inner = self.handle.push_error_scope(Internal);
        let result = work().await;
        // All at once: in a page each is a message to another process and its answer.
        let popped = [inner.pop(), middle.pop(), outer.pop()];
        let mut first = None;
        for error in popped {
            first = first.or(error.await);
        }
        let Some(error) = first else { return result };
        // One may be what was refused.
        lock(&self.pipelines).clear();
        match error {
            wgpu::Error::OutOfMemory { .. } => Err(GpuError::OutOfMemory),
            // A lost device refuses everything, and its messages do not name the loss.
            _ if !self.is_alive() => Err(self.give_up()),
            other => Err(GpuError::Refused(first_lines(&other.to_string()))),
        }
    }

    /// Runs `work`, and returns errors that wgpu reports meanwhile. A page is told of them by its browser: it cannot wait for them.
    pub(super) fn watch_now<T>(&self, work: impl FnOnce() -> Result<T>) -> Result<T> {
        if cfg!(target_arch = "wasm32") { work() } else { wait::block_on(self.watch(async || work())) }
    }
}

fn first_lines(text: &str) -> String {
    text.lines().map(str::trim).filter(|line| !line.is_empty()).take(3).collect::<Vec<_>>().join(": ")
}
