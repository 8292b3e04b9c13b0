//! For tests and studies: faults, single pipelines, and searches without a finder or a broad phase.

pub use super::changes::{Change, ChangeRequest};
pub use super::device::Fault;
use super::device::Variant;
pub use super::sink::GpuFound;
use super::{Failure, GpuError, GpuFinder, GpuPlan, SearchRequest};
use crate::config::GpuOptions;
use crate::layout::Params;
use crate::pbig::Summary;
use crate::{Aabb, Config};
use pbig_shaders::Kernel;

/// Returns the kernels' parameters for a grid of the boxes with at most `max_cells` cells, as far as the plan sets them.
pub fn plan_params(boxes: &[Aabb], options: &GpuOptions, max_cells: u32) -> Params {
    GpuPlan::new(&Summary::of(boxes), options, 1.0, max_cells).add_to(Params::default())
}

impl GpuFinder {
    /// Makes [`crate::Backend::Auto`] take a software adapter for hardware.
    pub fn pretend_hardware(&mut self) {
        self.pretends_hardware = true;
    }

    /// Makes the device fail after so many more submissions.
    pub fn inject(&self, fault: Fault, submissions: u32) {
        if let Some(device) = &self.device {
            device.inject(fault, submissions);
        }
    }

    /// Returns a kernel's pipeline. If the kernel has two texts, `changes` picks the one for a search for changes.
    pub fn pipeline(
        &self,
        kernel: &'static Kernel,
        options: &GpuOptions,
        changes: bool,
    ) -> Result<wgpu::ComputePipeline, GpuError> {
        let device = self.device.as_ref().ok_or(GpuError::Lost)?;
        device.pipeline(kernel, Variant::new(options, changes))
    }

    /// Runs `work` on the device, and returns errors that wgpu reports meanwhile.
    pub fn on_device<T>(
        &self,
        work: impl FnOnce(&wgpu::Device, &wgpu::Queue) -> Result<T, GpuError>,
    ) -> Result<T, GpuError> {
        let device = self.device.as_ref().ok_or(GpuError::Lost)?;
        device.watch(|| work(&device.handle, &device.queue))
    }

    /// Finds all pairs of boxes, in no particular order. An error is in words.
    pub fn search_all(&mut self, boxes: &[Aabb], config: &Config) -> Result<GpuFound, String> {
        self.find(&SearchRequest { boxes, filters: None, changes: None, config }, Vec::new())
            .map_err(in_words)
    }

    /// Finds the pairs that an update changes. An error is in words.
    pub fn search_changes(&mut self, request: &ChangeRequest<'_>) -> Result<GpuFound, String> {
        self.changes(request).map_err(in_words)
    }
}

fn in_words(failure: Failure) -> String {
    match failure {
        Failure::Call(error) => error.to_string(),
        Failure::Device(error) => error.to_string(),
    }
}
