//! Commands of one submission: kernels with their buffers, each a pass with its name and its times.

use super::GpuError;
use super::engine::{Engine, Variant};
use super::storage::Storage;
use pbig_shaders::Kernel;
use std::collections::HashMap;

/// Workgroups in a row of a dispatch; the portable limit is 65,535.
const ROW: u32 = 32_768;

/// Most kernels in one submission, two timestamps each.
pub(super) const MOST_PASSES: u32 = 16;

/// How many workgroups.
#[derive(Clone, Copy, Debug)]
pub(super) enum Groups {
    /// So many.
    Direct(u32),
    /// As the buffer `dispatches` says, from this byte on.
    Indirect(u64),
}

/// Bind groups, which stay valid as long as no buffer is replaced.
#[derive(Debug, Default)]
pub(super) struct BindGroups {
    groups: HashMap<(&'static str, Variant, usize), wgpu::BindGroup>,
    generation: u64,
}

/// A submission that is being recorded.
pub(super) struct Commands<'a> {
    pub(super) engine: &'a Engine,
    pub(super) storage: &'a Storage,
    pub(super) encoder: wgpu::CommandEncoder,
    binds: &'a mut BindGroups,
    variant: Variant,
    queries: Option<&'a wgpu::QuerySet>,
    /// Names of the passes.
    pub(super) passes: Vec<&'static str>,
    /// Which of the two sets of buffers for chunks.
    pub(super) side: usize,
}

/// The buffer for a binding: some exist twice, so that two chunks can be under way (PBIG 5.3).
pub(super) fn sided(binding: &'static str, side: usize) -> &'static str {
    match (binding, side) {
        ("chunk", 0) => "chunk0",
        ("chunk", _) => "chunk1",
        ("totals", 0) => "totals0",
        ("totals", _) => "totals1",
        ("out", 0) => "out0",
        ("out", _) => "out1",
        ("staging", 0) => "staging0",
        ("staging", _) => "staging1",
        (other, _) => other,
    }
}

impl<'a> Commands<'a> {
    pub(super) fn new(
        engine: &'a Engine,
        storage: &'a Storage,
        binds: &'a mut BindGroups,
        variant: Variant,
        queries: Option<&'a wgpu::QuerySet>,
        side: usize,
    ) -> Self {
        if binds.generation != storage.generation {
            binds.groups.clear();
            binds.generation = storage.generation;
        }
        let descriptor = wgpu::CommandEncoderDescriptor { label: Some("pbig") };
        let encoder = engine.device.create_command_encoder(&descriptor);
        Self { engine, storage, encoder, binds, variant, queries, passes: Vec::new(), side }
    }

    /// A buffer of this side, by the name of its binding.
    pub(super) fn buffer(&self, binding: &'static str) -> &'a wgpu::Buffer {
        self.storage.get(sided(binding, self.side))
    }

    /// One pass: one kernel.
    pub(super) fn run(&mut self, kernel: &'static Kernel, groups: Groups) -> Result<(), GpuError> {
        let pipeline = self.engine.pipeline(kernel, self.variant)?;
        let bind = self.bind_group(kernel, &pipeline);
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
        pass.set_bind_group(0, &bind, &[]);
        match groups {
            Groups::Direct(n) => pass.dispatch_workgroups(n.min(ROW), n.div_ceil(ROW), 1),
            Groups::Indirect(at) => pass.dispatch_workgroups_indirect(self.storage.get("dispatches"), at),
        }
        Ok(())
    }

    fn bind_group(&mut self, kernel: &'static Kernel, pipeline: &wgpu::ComputePipeline) -> wgpu::BindGroup {
        let make = || {
            let entry = |(binding, &name): (u32, &&'static str)| wgpu::BindGroupEntry {
                binding,
                resource: self.storage.get(sided(name, self.side)).as_entire_binding(),
            };
            let entries: Vec<_> = (0..).zip(kernel.bindings).map(entry).collect();
            self.engine.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some(kernel.name),
                layout: &pipeline.get_bind_group_layout(0),
                entries: &entries,
            })
        };
        self.binds.groups.entry((kernel.name, self.variant, self.side)).or_insert_with(make).clone()
    }
}
