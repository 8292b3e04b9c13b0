//! Recording of a submission: each kernel is a compute pass with its buffers, its name and its times.

use super::GpuError;
use super::device::{GpuDevice, Variant};
use super::storage::{BufferId, Side, Storage};
use pbig_shaders::{Buffer, Kernel};
use std::collections::HashMap;

/// Workgroups in a row of a dispatch. The portable limit is 65,535.
const GROUPS_PER_ROW: u32 = 32_768;

/// Most kernels in one submission. Each takes two timestamps.
pub(super) const MAX_PASSES: u32 = 16;

/// The number of workgroups of a dispatch.
#[derive(Clone, Copy, Debug)]
pub(super) enum Groups {
    /// A number that the host knows.
    Direct(u32),
    /// A number that the device has written into [`Buffer::Dispatches`], at this byte.
    Indirect(u64),
}

/// Bind groups by kernel, variant and side. They are valid as long as no buffer is replaced.
#[derive(Debug, Default)]
pub(super) struct BindGroups {
    groups: HashMap<(&'static str, Variant, Side), wgpu::BindGroup>,
    generation: u64,
}

/// A submission that is being recorded.
pub(super) struct Commands<'a> {
    pub(super) device: &'a GpuDevice,
    pub(super) storage: &'a Storage,
    pub(super) encoder: wgpu::CommandEncoder,
    bind_groups: &'a mut BindGroups,
    variant: Variant,
    queries: Option<&'a wgpu::QuerySet>,
    /// Names of the passes so far.
    pub(super) passes: Vec<&'static str>,
    pub(super) side: Side,
}

impl<'a> Commands<'a> {
    pub(super) fn new(
        device: &'a GpuDevice,
        storage: &'a Storage,
        bind_groups: &'a mut BindGroups,
        variant: Variant,
        queries: Option<&'a wgpu::QuerySet>,
        side: Side,
    ) -> Self {
        if bind_groups.generation != storage.generation {
            bind_groups.groups.clear();
            bind_groups.generation = storage.generation;
        }
        let descriptor = wgpu::CommandEncoderDescriptor { label: Some("pbig") };
        let encoder = device.handle.create_command_encoder(&descriptor);
        Self { device, storage, encoder, bind_groups, variant, queries, passes: Vec::new(), side }
    }

    /// Returns the buffer for a binding.
    pub(super) fn buffer(&self, binding: Buffer) -> &'a wgpu::Buffer {
        self.storage.get(BufferId::of(binding, self.side))
    }

    /// Records one pass with one kernel.
    pub(super) fn run(&mut self, kernel: &'static Kernel, groups: Groups) -> Result<(), GpuError> {
        let pipeline = self.device.pipeline(kernel, self.variant)?;
        let bind_group = self.bind_group(kernel, &pipeline);
        let pass_index = 2 * self.passes.len() as u32;
        let timestamp_writes = self.queries.map(|query_set| wgpu::ComputePassTimestampWrites {
            query_set,
            beginning_of_pass_write_index: Some(pass_index),
            end_of_pass_write_index: Some(pass_index + 1),
        });
        self.passes.push(kernel.name);
        let descriptor = wgpu::ComputePassDescriptor { label: Some(kernel.name), timestamp_writes };
        let mut pass = self.encoder.begin_compute_pass(&descriptor);
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &bind_group, &[]);
        match groups {
            Groups::Direct(n) => {
                pass.dispatch_workgroups(n.min(GROUPS_PER_ROW), n.div_ceil(GROUPS_PER_ROW), 1)
            }
            Groups::Indirect(at) => {
                pass.dispatch_workgroups_indirect(self.storage.bound(Buffer::Dispatches), at)
            }
        }
        Ok(())
    }

    fn bind_group(&mut self, kernel: &'static Kernel, pipeline: &wgpu::ComputePipeline) -> wgpu::BindGroup {
        let make = || {
            let entry = |(binding, &buffer): (u32, &Buffer)| wgpu::BindGroupEntry {
                binding,
                resource: self.storage.get(BufferId::of(buffer, self.side)).as_entire_binding(),
            };
            let entries: Vec<_> = (0..).zip(kernel.bindings).map(entry).collect();
            self.device.handle.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some(kernel.name),
                layout: &pipeline.get_bind_group_layout(0),
                entries: &entries,
            })
        };
        let key = (kernel.name, self.variant, self.side);
        self.bind_groups.groups.entry(key).or_insert_with(make).clone()
    }
}
