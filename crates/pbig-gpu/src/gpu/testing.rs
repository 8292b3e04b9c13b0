//! For tests: a hook, single pipelines, plans.

use super::gpu_device::lock;
use super::passes::{Groups, Recording, Step};
use super::readback::Mapped;
use super::storage::{BufferId, Storage};
use super::{GpuError, GpuFinder, GpuPlan, wait};
use crate::GpuOptions;
use crate::layout::{LANES, Params};
use crate::pbig::Summary;
use pbig_core::Aabb;
use pbig_shaders::{Buffer, INDEX_PAIRS};
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

    /// Returns the number of kernels that were compiled for the device.
    pub fn pipelines(&self) -> usize {
        self.device.as_ref().map_or(0, |device| lock(&device.pipelines).len())
    }

    /// Returns the number of buffers that were made on the device so far.
    pub fn buffers_made(&self) -> u32 {
        self.device.as_ref().map_or(0, |device| device.buffers_made.load(Ordering::Relaxed))
    }

    /// Returns the number of query sets that the finder holds.
    pub fn query_sets(&self) -> usize {
        self.session.iter().filter_map(|session| session.timer.as_ref()).count()
    }

    /// Returns the row that a device estimates for each of `count` indices of pairs of `n` boxes, and the pair that it computes.
    pub fn index_pairs(&self, n: u32, first: u32, count: u32) -> Result<Vec<[u32; 3]>, GpuError> {
        let device = self.device.as_ref().ok_or(GpuError::Lost)?;
        let (mut storage, staging) = (Storage::new(device.clone(), &self.options), BufferId::Staging(0));
        let bytes = 12 * u64::from(count);
        wait::block_on(device.watch(async || {
            let params = Params { boxes: n, levels: first, cells: count, ..Params::default() };
            storage.write(Buffer::Params, &[params])?;
            storage.ensure(Buffer::Out, bytes)?;
            storage.ensure(staging, bytes)?;
            let mut encoder = device.encoder();
            let recording =
                Recording { storage: &mut storage, encoder: &mut encoder, is_balanced: true, timer: None };
            recording.record(&[Step::Run(&INDEX_PAIRS, Groups::Direct(count.div_ceil(LANES)))]);
            let staging = storage.get(staging);
            encoder.copy_buffer_to_buffer(storage.get(Buffer::Out), 0, staging, 0, bytes);
            wait::map(device, staging, bytes, device.submit(encoder), self.options.patience).await?;
            Ok(bytemuck::pod_collect_to_vec(&Mapped::new(device, staging, bytes)?))
        }))
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
