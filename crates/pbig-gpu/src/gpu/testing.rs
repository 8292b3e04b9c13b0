//! For tests: a hook, single pipelines, plans.

use super::gpu_device::lock;
use super::passes::{Groups, Step};
use super::session::Session;
use super::{GpuError, GpuFinder, GpuPlan, wait};
use crate::GpuOptions;
use crate::layout::{Chunk, LANES, Params};
use crate::pbig::Summary;
use pbig_core::Aabb;
use pbig_shaders::{Buffer, INDEX_PAIRS};
use std::sync::atomic::Ordering;

/// Returns the kernels' parameters for a grid of the boxes with at most `max_cells` cells. Only what the plan sets is filled in.
pub fn plan_params(boxes: &[Aabb], options: &GpuOptions, max_cells: u32) -> Params {
    GpuPlan::new(&Summary::of(boxes), options.boxes_per_cell, 1.0, max_cells).params
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
        let mut session = Session::new(device, &self.options);
        session.params = Params { boxes: n, levels: first, cells: count, ..Params::default() };
        let (bytes, groups) = (12 * u64::from(count), Groups::Direct(count.div_ceil(LANES)));
        wait::block_on(device.watch(async || {
            session.storage.ensure(Buffer::Out, bytes)?;
            session.submit(Chunk::default(), &[Step::Run(&INDEX_PAIRS, groups)])?;
            let fetch = session.fetch_pairs(0..bytes, 0)?;
            session.receive(fetch, |_, bytes| Ok(bytemuck::pod_collect_to_vec(bytes))).await
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
