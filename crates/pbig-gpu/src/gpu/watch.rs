//! Errors that wgpu reports while a call is in progress.

use super::gpu_device::GpuDevice;
use super::{GpuError, wait};

impl GpuDevice {
    /// Runs `work`, and returns errors that wgpu reports meanwhile.
    pub(super) async fn watch<T, F: From<GpuError>>(
        &self,
        work: impl AsyncFnOnce() -> Result<T, F>,
    ) -> Result<T, F> {
        use wgpu::ErrorFilter::{Internal, OutOfMemory, Validation};
        let _entered = wait::enter(self)?;
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
        self.forget_pipelines();
        match error {
            wgpu::Error::OutOfMemory { .. } => Err(GpuError::OutOfMemory.into()),
            // A lost device refuses everything, and its messages do not name the loss.
            _ if !self.is_alive() => Err(self.give_up().into()),
            other => Err(GpuError::Refused(first_lines(&other.to_string())).into()),
        }
    }

    /// Runs `work`, and returns errors that wgpu reports meanwhile.
    #[cfg(not(target_arch = "wasm32"))]
    pub(super) fn watch_now<T>(&self, work: impl FnOnce() -> Result<T, GpuError>) -> Result<T, GpuError> {
        wait::block_on(self.watch(async || work()))
    }

    /// Runs `work`. The page is told of errors, and cannot wait for them.
    #[cfg(target_arch = "wasm32")]
    pub(super) fn watch_now<T>(&self, work: impl FnOnce() -> Result<T, GpuError>) -> Result<T, GpuError> {
        work()
    }
}

fn first_lines(text: &str) -> String {
    text.lines().map(str::trim).filter(|line| !line.is_empty()).take(3).collect::<Vec<_>>().join(": ")
}
