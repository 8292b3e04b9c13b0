//! Single kernels on given buffers, with the pipelines of a finder's device.

use pbig_core::gpu::GpuError;
use pbig_core::{GpuFinder, GpuOptions};
use pbig_shaders::Kernel;
use std::sync::mpsc::channel;
use wgpu::BufferUsages as Usage;
use wgpu::util::{BufferInitDescriptor, DeviceExt, DownloadBuffer};

/// Workgroups in a row of a dispatch.
const GROUPS_PER_ROW: u32 = 32_768;

/// A device to run single kernels on.
#[derive(Debug)]
pub(super) struct Bench {
    gpu: GpuFinder,
}

impl Bench {
    /// Opens the best adapter, or the one that `WGPU_ADAPTER_NAME` names.
    ///
    /// # Errors
    /// If there is no adapter, or it gives no device that the kernels can run on.
    pub(super) fn new() -> Result<Self, GpuError> {
        Ok(Self { gpu: GpuFinder::new()? })
    }

    /// Runs a kernel on the bytes of its bindings, in their order, and returns the bytes afterwards.
    ///
    /// Uniforms come back unchanged. If a kernel has two texts, `changes` picks the one for a search for changes.
    ///
    /// # Errors
    /// If the device refuses the kernel or the buffers, is lost or does not answer in time.
    pub(super) fn run(
        &self,
        kernel: &'static Kernel,
        options: &GpuOptions,
        changes: bool,
        bindings: &[Vec<u8>],
        workgroups: u32,
    ) -> Result<Vec<Vec<u8>>, GpuError> {
        let pipeline = self.gpu.pipeline(kernel, options, changes)?;
        self.gpu.on_device(|device, queue| {
            let buffers = upload(device, kernel, bindings);
            let group = bind(device, &pipeline, &buffers);
            let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(0, &group, &[]);
            pass.dispatch_workgroups(workgroups.min(GROUPS_PER_ROW), workgroups.div_ceil(GROUPS_PER_ROW), 1);
            drop(pass);
            queue.submit([encoder.finish()]);
            let found = download(device, queue, &buffers)?;
            Ok(found.iter().zip(bindings).map(|(found, given)| found[..given.len()].to_vec()).collect())
        })
    }
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

/// Returns the content of buffers.
fn download(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    buffers: &[wgpu::Buffer],
) -> Result<Vec<Vec<u8>>, GpuError> {
    let (sender, receiver) = channel();
    for (place, buffer) in buffers.iter().enumerate() {
        let sender = sender.clone();
        DownloadBuffer::read_buffer(device, queue, &buffer.slice(..), move |read| {
            _ = sender.send((place, read.map(|bytes| bytes.to_vec())));
        });
    }
    let patience = GpuOptions::DEFAULT.patience;
    let poll = wgpu::PollType::Wait { submission_index: None, timeout: Some(patience) };
    device.poll(poll).map_err(|_| GpuError::Timeout(patience))?;
    let mut found = vec![Vec::new(); buffers.len()];
    for _ in buffers {
        // If another thread polls the device, that thread calls back, perhaps a moment later.
        let received = receiver.recv_timeout(patience).map_err(|_| GpuError::Timeout(patience))?;
        let (place, read): (usize, Result<_, wgpu::BufferAsyncError>) = received;
        found[place] = read.map_err(|error| GpuError::Refused(error.to_string()))?;
    }
    Ok(found)
}
