//! For tests: faults, single pipelines, plans.

pub use super::gpu_device::Fault;
use super::gpu_device::Variant;
use super::{GpuError, GpuFinder, GpuPlan, wait};
use crate::GpuOptions;
use crate::layout::Params;
use crate::pbig::Summary;
use pbig_core::Aabb;
use pbig_shaders::Kernel;
use std::sync::atomic::Ordering;

/// The faults, a word of each one's report, and the numbers of submissions after which it is injected: shaders are compiled and
/// buffers are made in the first call only, and each call submits, some of them several times.
pub const FAULTS: [(Fault, &str, &[u32]); 5] = [
    (Fault::LoseDevice, "lost", &[2, 3, 5, 7]),
    (Fault::Timeout, "did not answer", &[2, 3, 5, 7]),
    (Fault::Panic, "lost", &[2, 3, 5, 7]),
    (Fault::OutOfMemory, "out of device memory", &[0]),
    (Fault::RefuseShader, "refused", &[0]),
];

/// Returns the kernels' parameters for a grid of the boxes with at most `max_cells` cells. Only what the plan sets is filled in.
pub fn plan_params(boxes: &[Aabb], options: &GpuOptions, max_cells: u32) -> Params {
    GpuPlan::new(&Summary::of(boxes), options, 1.0, max_cells).add_to(Params::default())
}

#[cfg(not(target_arch = "wasm32"))]
impl super::GpuFinders {
    /// Makes the last of the devices fail after this number of submissions.
    pub fn inject(&self, fault: Fault, submissions: u32) {
        self.finders.last().into_iter().for_each(|finder| finder.inject(fault, submissions));
    }
}

impl GpuFinder {
    /// Makes the device fail after this number of submissions.
    pub fn inject(&self, fault: Fault, submissions: u32) {
        if let Some(device) = &self.device {
            device.inject(fault, submissions);
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
        self.session.iter().filter_map(|session| session.timestamps.as_ref()).count()
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
