//! Single kernels on given buffers, on a finder's device.

use super::poison::pipeline_of;
use pbig_gpu::layout::GROUPS_PER_ROW;
use pbig_gpu::{GpuError, GpuFinder, GpuOptions};
use pbig_shaders::Kernel;
use std::sync::mpsc::channel;
use std::time::Duration;
use wgpu::BufferUsages as Usage;
use wgpu::util::{BufferInitDescriptor, DeviceExt, DownloadBuffer};

/// Runs a kernel on the bytes of its bindings, in their order, and returns the bytes afterwards.
///
/// `text` is the kernel's, perhaps changed. Uniforms come back unchanged.
///
/// # Errors
/// If the device refuses the kernel or the buffers, is lost or does not answer in time.
pub(super) fn run(
    gpu: &GpuFinder,
    kernel: &'static Kernel,
    text: &str,
    options: &GpuOptions,
    bindings: &[Vec<u8>],
    workgroups: u32,
) -> Result<Vec<Vec<u8>>, GpuError> {
    gpu.on_device(|device, queue| {
        let pipeline = pipeline_of(device, kernel, text, options);
        let buffers = upload(device, kernel, bindings);
        let group = bind(device, &pipeline, &buffers);
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.dispatch_workgroups(workgroups.min(GROUPS_PER_ROW), workgroups.div_ceil(GROUPS_PER_ROW), 1);
        drop(pass);
        queue.submit([encoder.finish()]);
        let after = |(buffer, given): (&wgpu::Buffer, &Vec<u8>)| {
            Ok(download(device, queue, buffer)?[..given.len()].to_vec())
        };
        buffers.iter().zip(bindings).map(after).collect()
    })
}

/// Makes a kernel's buffers with this content.
fn upload(device: &wgpu::Device, kernel: &Kernel, bindings: &[Vec<u8>]) -> Vec<wgpu::Buffer> {
    assert_eq!(kernel.bindings.len(), bindings.len(), "{}: a buffer for each binding", kernel.name);
    let make = |(binding, bytes): (&pbig_shaders::Buffer, &Vec<u8>)| {
        let usage = if binding.is_uniform() { Usage::UNIFORM } else { Usage::STORAGE };
        let mut contents = bytes.clone();
        contents.resize(bytes.len().max(16), 0);
        let usage = usage | Usage::COPY_SRC;
        device.create_buffer_init(&BufferInitDescriptor {
            label: Some(binding.name()),
            contents: &contents,
            usage,
        })
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

fn download(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    buffer: &wgpu::Buffer,
) -> Result<DownloadBuffer, GpuError> {
    let (sender, receiver) = channel();
    DownloadBuffer::read_buffer(device, queue, &buffer.slice(..), move |read| _ = sender.send(read));
    // A software driver compiles a kernel when it first runs.
    let patience = Duration::from_secs(600);
    let poll = wgpu::PollType::Wait { submission_index: None, timeout: Some(patience) };
    device.poll(poll).map_err(|_| GpuError::Timeout(patience))?;
    // If another thread polls the device, that thread calls back, perhaps a moment later.
    let read = receiver.recv_timeout(patience).map_err(|_| GpuError::Timeout(patience))?;
    read.map_err(|error| GpuError::Refused(error.to_string()))
}
