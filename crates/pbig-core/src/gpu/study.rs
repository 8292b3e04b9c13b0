//! For tests and studies: single kernels on given buffers, and searches for changes without a broad phase.

pub use super::changes::{Change, ChangeRequest};
use super::device::{GpuDevice, Variant};
use super::{Failure, GpuError, GpuFinder, GpuFound, GpuPlan, SearchRequest, readback};
use crate::config::GpuOptions;
use crate::layout::Params;
use crate::pbig::Summary;
use crate::report::{Checks, GpuReport};
use crate::{Aabb, Config, Pair};
use pbig_shaders::Kernel;
use std::error::Error;
use std::time::{Duration, Instant};

/// Copies in a timed submission: so many that the submission itself counts for little.
const COPIES: u64 = 16;

/// A device to run single kernels on.
#[derive(Debug)]
pub struct Bench {
    device: GpuDevice,
}

impl Bench {
    /// Opens the best adapter, or the one that `WGPU_ADAPTER_NAME` names.
    ///
    /// # Errors
    /// If there is no adapter, or it gives no device that the kernels can run on.
    pub fn new() -> Result<Self, GpuError> {
        Self::on_adapter(None, true)
    }

    /// Opens the adapter of a name, or the best. Its subgroups are used or not.
    ///
    /// # Errors
    /// As [`Bench::new`].
    pub fn on_adapter(name: Option<&str>, subgroups: bool) -> Result<Self, GpuError> {
        let mut device = GpuDevice::on(&super::adapter::choose(name)?)?;
        device.has_subgroups &= subgroups;
        Ok(Self { device })
    }

    /// Returns true if the kernels for subgroups run.
    pub fn subgroups(&self) -> bool {
        self.device.has_subgroups
    }

    /// Returns the bytes per second that the device reads and writes while it copies; a copied byte counts twice.
    ///
    /// This is the best of five submissions of sixteen copies of `bytes` bytes, or of a buffer's limit.
    ///
    /// # Errors
    /// If the device refuses, is lost or does not answer in time.
    pub fn copy_rate(&self, bytes: u64) -> Result<f64, GpuError> {
        use wgpu::BufferUsages as Usage;
        let device = &self.device;
        device.watch(|| {
            let bytes = bytes.min(device.max_buffer_bytes(&GpuOptions::DEFAULT));
            let usage = Usage::COPY_SRC | Usage::COPY_DST;
            let (from, to) = (device.buffer("from", bytes, usage)?, device.buffer("to", bytes, usage)?);
            let copy = || {
                let mut encoder =
                    device.handle.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
                for _ in 0..COPIES {
                    encoder.copy_buffer_to_buffer(&from, 0, &to, 0, bytes);
                }
                let clock = Instant::now();
                device.wait(device.submit(encoder), GpuOptions::DEFAULT.patience)?;
                Ok::<_, GpuError>(clock.elapsed().as_secs_f64())
            };
            // The first copy also clears the buffers.
            let times = (0..6).map(|_| copy()).collect::<Result<Vec<_>, _>>()?;
            let best = times[1..].iter().copied().fold(f64::MAX, f64::min);
            Ok((2 * COPIES * bytes) as f64 / best)
        })
    }

    /// Runs a kernel on the bytes of its bindings, in their order, and returns the bytes afterwards.
    ///
    /// Uniforms come back unchanged. If a kernel has two texts, `changes` picks the one for a search for changes.
    ///
    /// # Errors
    /// If the device refuses, is lost or does not answer within [`GpuOptions::patience`].
    pub fn run(
        &self,
        kernel: &'static Kernel,
        options: &GpuOptions,
        changes: bool,
        bindings: &[Vec<u8>],
        workgroups: u32,
    ) -> Result<Vec<Vec<u8>>, GpuError> {
        if bindings.len() != kernel.bindings.len() {
            let (wanted, found) = (kernel.bindings.len(), bindings.len());
            return Err(GpuError::Refused(format!("{}: {found} buffers for {wanted} bindings", kernel.name)));
        }
        self.device.watch(|| {
            self.run_watched(kernel, Variant::new(options, changes), options.patience, bindings, workgroups)
        })
    }

    fn run_watched(
        &self,
        kernel: &'static Kernel,
        variant: Variant,
        patience: Duration,
        bindings: &[Vec<u8>],
        workgroups: u32,
    ) -> Result<Vec<Vec<u8>>, GpuError> {
        use wgpu::BufferUsages as Usage;
        let (device, handle) = (&self.device, &self.device.handle);
        let pipeline = device.pipeline(kernel, variant)?;
        let mut buffers = Vec::new();
        for (&binding, bytes) in kernel.bindings.iter().zip(bindings) {
            let usage = if binding.is_uniform() { Usage::UNIFORM } else { Usage::STORAGE };
            let size = bytes.len().max(16) as u64;
            let buffer = device.buffer(binding.name(), size, usage | Usage::COPY_DST | Usage::COPY_SRC)?;
            device.queue.write_buffer(&buffer, 0, bytes);
            buffers.push(buffer);
        }
        let bound: Vec<_> = (0..)
            .zip(&buffers)
            .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
            .collect();
        let group = handle.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(kernel.name),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &bound,
        });
        let mut encoder = handle.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(0, &group, &[]);
            pass.dispatch_workgroups(workgroups.min(32_768), workgroups.div_ceil(32_768), 1);
        }
        let all: u64 = buffers.iter().map(wgpu::Buffer::size).sum();
        let staging = device.buffer("staging", all, Usage::MAP_READ | Usage::COPY_DST)?;
        let mut at = 0;
        for buffer in &buffers {
            encoder.copy_buffer_to_buffer(buffer, 0, &staging, at, buffer.size());
            at += buffer.size();
        }
        let submission = device.submit(encoder);
        readback::read(device, &staging, all, submission, patience, |mut rest| {
            let take = |(bytes, buffer): (&Vec<u8>, &wgpu::Buffer)| {
                let (own, more) = rest.split_at(buffer.size() as usize);
                rest = more;
                own[..bytes.len()].to_vec()
            };
            bindings.iter().zip(&buffers).map(take).collect()
        })
    }
}

/// Returns the kernels' parameters for a grid of the boxes with at most `max_cells` cells, as far as the plan sets them.
pub fn plan_params(boxes: &[Aabb], options: &GpuOptions, max_cells: u32) -> Params {
    GpuPlan::new(&Summary::of(boxes), options, 1.0, max_cells).params()
}

/// The changes that an update of a [`Tracker`] found.
#[derive(Clone, Debug, PartialEq)]
pub struct Tracked {
    /// Allowed pairs that overlap now and did not before, or the other way round, in no particular order.
    pub pairs: Vec<Pair>,
    /// Ids of boxes that the device treated as new.
    pub restarted: Vec<u32>,
    /// Tests made.
    pub checks: Checks,
    /// Work of the device.
    pub report: GpuReport,
}

/// A device that searches for changes, update by update, without a broad phase.
#[derive(Debug)]
pub struct Tracker {
    gpu: GpuFinder,
}

impl Tracker {
    /// Returns a tracker on the device.
    pub fn new(gpu: GpuFinder) -> Self {
        Self { gpu }
    }

    /// Returns the device, so that a test can make it fail.
    pub fn gpu(&self) -> &GpuFinder {
        &self.gpu
    }

    /// Finds the pairs that an update changes.
    ///
    /// # Errors
    /// If the device fails, or if the CPU would end in an error, too.
    pub fn update(&mut self, request: &ChangeRequest<'_>) -> Result<Tracked, Box<dyn Error>> {
        let GpuFound { pairs, restarted, checks, report, .. } = self.gpu.changes(request).map_err(boxed)?;
        Ok(Tracked { pairs: pairs.concat(), restarted, checks, report })
    }

    /// Finds all pairs of boxes, on the same device and its buffers, in no particular order.
    ///
    /// # Errors
    /// As [`Tracker::update`].
    pub fn find(&mut self, boxes: &[Aabb], config: &Config) -> Result<Vec<Pair>, Box<dyn Error>> {
        let request = SearchRequest { boxes, filters: None, config };
        Ok(self.gpu.find(&request).map_err(boxed)?.pairs.concat())
    }
}

fn boxed(failure: Failure) -> Box<dyn Error> {
    match failure {
        Failure::Call(error) => error.into(),
        Failure::Device(error) => error.into(),
    }
}
