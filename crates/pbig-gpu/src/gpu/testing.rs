//! For tests: a hook, single pipelines, plans.

use super::gpu_device::{Variant, lock};
use super::{GpuError, GpuFinder, GpuPlan, wait};
use crate::GpuOptions;
use crate::layout::Params;
use crate::pbig::Summary;
use pbig_core::Aabb;
use pbig_shaders::Kernel;
use std::sync::atomic::Ordering;

/// Returns the kernels' parameters for a grid of the boxes with at most `max_cells` cells. Only what the plan sets is filled in.
pub fn plan_params(boxes: &[Aabb], options: &GpuOptions, max_cells: u32) -> Params {
    GpuPlan::new(&Summary::of(boxes), options, 1.0, max_cells).add_to(Params::default())
}

impl GpuFinder {
    /// Runs `hook` before each wait for the device.
    pub fn set_hook(&self, hook: impl FnMut(&wgpu::Device) + Send + 'static) {
        if let Some(device) = &self.device {
            *lock(&device.hook) = Box::new(hook);
        }
    }

    /// Returns a kernel's pipeline.
    pub fn pipeline(
        &self,
        kernel: &'static Kernel,
        options: &GpuOptions,
    ) -> Result<wgpu::ComputePipeline, GpuError> {
        let device = self.device.as_ref().ok_or(GpuError::Lost)?;
        wait::block_on(device.watch(async || Ok(device.pipeline(kernel, Variant::new(options)))))
    }

    /// Returns the number of kernels that were compiled for the device.
    pub fn pipelines(&self) -> usize {
        self.device.as_ref().map_or(0, |device| device.pipelines())
    }

    /// Returns the number of buffers that were made on the device so far.
    pub fn buffers_made(&self) -> u32 {
        self.device.as_ref().map_or(0, |device| device.buffers_made.load(Ordering::Relaxed))
    }

    /// Returns the number of query sets that the finder holds.
    pub fn query_sets(&self) -> usize {
        self.session.iter().filter_map(|session| session.timer.as_ref()).count()
    }

    /// Runs `work` on the device, and returns errors that wgpu reports meanwhile.
    pub fn on_device<T>(
        &self,
        work: impl FnOnce(&wgpu::Device, &wgpu::Queue) -> Result<T, GpuError>,
    ) -> Result<T, GpuError> {
        let device = self.device.as_ref().ok_or(GpuError::Lost)?;
        wait::block_on(device.watch(async || work(&device.handle, &device.queue)))
    }
}
