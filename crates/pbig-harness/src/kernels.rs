//! Single kernels on given buffers, with the pipelines of a finder's device.

use pbig_core::gpu::GpuError;
use pbig_core::{GpuFinder, GpuOptions};
use pbig_shaders::Kernel;
use wgpu::BufferUsages as Usage;

/// Workgroups in a row of a dispatch.
const GROUPS_PER_ROW: u32 = 32_768;

/// A device to run single kernels on.
#[derive(Debug)]
pub struct Bench {
    gpu: GpuFinder,
}

impl Bench {
    /// Opens the best adapter, or the one that `WGPU_ADAPTER_NAME` names.
    ///
    /// # Errors
    /// If there is no adapter, or it gives no device that the kernels can run on.
    pub fn new() -> Result<Self, GpuError> {
        Ok(Self { gpu: GpuFinder::new()? })
    }

    /// Runs a kernel on the bytes of its bindings, in their order, and returns the bytes afterwards.
    ///
    /// Uniforms come back unchanged. If a kernel has two texts, `changes` picks the one for a search for changes.
    ///
    /// # Errors
    /// If the device refuses the kernel or the buffers, is lost or does not answer in time.
    pub fn run(
        &self,
        kernel: &'static Kernel,
        options: &GpuOptions,
        changes: bool,
        bindings: &[Vec<u8>],
        workgroups: u32,
    ) -> Result<Vec<Vec<u8>>, GpuError> {
        let pipeline = self.gpu.pipeline(kernel, options, changes)?;
        self.gpu.on_device(|device, queue| {
            let buffers = upload(device, queue, kernel, bindings);
            let group = bind(device, &pipeline, &buffers);
            let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(0, &group, &[]);
            pass.dispatch_workgroups(workgroups.min(GROUPS_PER_ROW), workgroups.div_ceil(GROUPS_PER_ROW), 1);
            drop(pass);
            let found = download(device, queue, encoder, &buffers)?;
            Ok(found.iter().zip(bindings).map(|(found, given)| found[..given.len()].to_vec()).collect())
        })
    }
}

fn buffer(device: &wgpu::Device, name: &str, size: u64, usage: Usage) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(name),
        size,
        usage,
        mapped_at_creation: false,
    })
}

/// Makes a kernel's buffers with this content.
fn upload(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    kernel: &Kernel,
    bindings: &[Vec<u8>],
) -> Vec<wgpu::Buffer> {
    assert_eq!(kernel.bindings.len(), bindings.len(), "{}: a buffer for each binding", kernel.name);
    let make = |(binding, bytes): (&pbig_shaders::Buffer, &Vec<u8>)| {
        let usage = if binding.is_uniform() { Usage::UNIFORM } else { Usage::STORAGE };
        let size = bytes.len().max(16) as u64;
        let made = buffer(device, binding.name(), size, usage | Usage::COPY_DST | Usage::COPY_SRC);
        queue.write_buffer(&made, 0, bytes);
        made
    };
    kernel.bindings.iter().zip(bindings).map(make).collect()
}

fn bind(
    device: &wgpu::Device,
    pipeline: &wgpu::ComputePipeline,
    buffers: &[wgpu::Buffer],
) -> wgpu::BindGroup {
    let entries: Vec<_> = (0..)
        .zip(buffers)
        .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
        .collect();
    let layout = &pipeline.get_bind_group_layout(0);
    device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
}

/// Submits commands, and returns the content of buffers after them.
fn download(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    mut encoder: wgpu::CommandEncoder,
    buffers: &[wgpu::Buffer],
) -> Result<Vec<Vec<u8>>, GpuError> {
    let all: u64 = buffers.iter().map(wgpu::Buffer::size).sum();
    let staging = buffer(device, "staging", all, Usage::MAP_READ | Usage::COPY_DST);
    let mut at = 0;
    for buffer in buffers {
        encoder.copy_buffer_to_buffer(buffer, 0, &staging, at, buffer.size());
        at += buffer.size();
    }
    let submission = queue.submit([encoder.finish()]);
    staging.map_async(wgpu::MapMode::Read, .., |_| ());
    wait(device, submission)?;
    let view = staging.get_mapped_range(..).map_err(|error| GpuError::Refused(error.to_string()))?;
    let mut rest = &view[..];
    let take = |buffer: &wgpu::Buffer| {
        let (own, more) = rest.split_at(buffer.size() as usize);
        rest = more;
        own.to_vec()
    };
    Ok(buffers.iter().map(take).collect())
}

fn wait(device: &wgpu::Device, submission: wgpu::SubmissionIndex) -> Result<(), GpuError> {
    let patience = GpuOptions::DEFAULT.patience;
    let poll = wgpu::PollType::Wait { submission_index: Some(submission), timeout: Some(patience) };
    device.poll(poll).map(|_| ()).map_err(|_| GpuError::Timeout(patience))
}
