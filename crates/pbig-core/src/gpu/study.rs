//! One kernel alone, on given buffers, and updates alone, without a broad phase around them: for tests,
//! and for studies.

pub use super::changes::{Change, ChangeRequest};
use super::engine::{Engine, Variant};
use super::{Failure, GpuError, GpuFinder, Request, readback};
use crate::config::GpuOptions;
use crate::cpu::found::Found;
use crate::plan::Summary;
use crate::report::Report;
use crate::{Aabb, Config, Pair};
use pbig_shaders::Kernel;
use std::error::Error;
use std::time::{Duration, Instant};

/// Copies in a submission that is timed, so that handing it over counts for little.
const COPIES: u64 = 16;

/// A device to run single kernels on.
#[derive(Debug)]
pub struct Bench {
    engine: Engine,
}

impl Bench {
    /// On the best adapter, or on that of `WGPU_ADAPTER_NAME`.
    ///
    /// # Errors
    /// When there is no adapter, or it gives no device that the kernels can run on.
    pub fn new() -> Result<Self, GpuError> {
        Self::on_adapter(None, true)
    }

    /// On the adapter of a name, or the best; with or without its subgroups.
    ///
    /// # Errors
    /// As [`Bench::new`].
    pub fn on_adapter(name: Option<&str>, subgroups: bool) -> Result<Self, GpuError> {
        let mut engine = Engine::on(&super::adapter::choose(name)?)?;
        engine.subgroups &= subgroups;
        Ok(Self { engine })
    }

    /// Whether the kernels for subgroups run.
    pub fn subgroups(&self) -> bool {
        self.engine.subgroups
    }

    /// Bytes per second that the device reads and writes while it copies (a copied byte counts twice): the
    /// best of five submissions of sixteen copies of `bytes` bytes, or of as many as a buffer may have.
    ///
    /// # Errors
    /// When the device refuses, is lost or does not answer in time.
    pub fn copy_rate(&self, bytes: u64) -> Result<f64, GpuError> {
        use wgpu::BufferUsages as Usage;
        let engine = &self.engine;
        engine.watch(|| {
            let bytes = bytes.min(engine.most_bytes(&GpuOptions::DEFAULT));
            let usage = Usage::COPY_SRC | Usage::COPY_DST;
            let (from, to) = (engine.buffer("from", bytes, usage)?, engine.buffer("to", bytes, usage)?);
            let copy = || {
                let mut encoder =
                    engine.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
                for _ in 0..COPIES {
                    encoder.copy_buffer_to_buffer(&from, 0, &to, 0, bytes);
                }
                let clock = Instant::now();
                engine.wait(engine.submit(encoder), GpuOptions::DEFAULT.patience)?;
                Ok::<_, GpuError>(clock.elapsed().as_secs_f64())
            };
            // The first copy also clears the buffers.
            let times = (0..6).map(|_| copy()).collect::<Result<Vec<_>, _>>()?;
            let best = times[1..].iter().copied().fold(f64::MAX, f64::min);
            Ok((2 * COPIES * bytes) as f64 / best)
        })
    }

    /// Runs a kernel on the bytes of each of its bindings, in their order, and returns the bytes that
    /// they have afterwards; uniforms come back as they were. Of kernels that have two texts, the one for
    /// a search for changes if `changes`.
    ///
    /// # Errors
    /// When the device refuses, is lost or does not answer within [`GpuOptions::patience`].
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
        self.engine.watch(|| {
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
        let (engine, device) = (&self.engine, &self.engine.device);
        let pipeline = engine.pipeline(kernel, variant)?;
        let is_uniform = |name: &str| matches!(name, "params" | "chunk");
        let mut buffers = Vec::new();
        for (&name, bytes) in kernel.bindings.iter().zip(bindings) {
            let usage = if is_uniform(name) { Usage::UNIFORM } else { Usage::STORAGE };
            let size = bytes.len().max(16) as u64;
            let buffer = engine.buffer(name, size, usage | Usage::COPY_DST | Usage::COPY_SRC)?;
            engine.queue.write_buffer(&buffer, 0, bytes);
            buffers.push(buffer);
        }
        let bound: Vec<_> = (0..)
            .zip(&buffers)
            .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
            .collect();
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(kernel.name),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &bound,
        });
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(0, &group, &[]);
            pass.dispatch_workgroups(workgroups.min(32_768), workgroups.div_ceil(32_768), 1);
        }
        let all: u64 = buffers.iter().map(wgpu::Buffer::size).sum();
        let staging = engine.buffer("staging", all, Usage::MAP_READ | Usage::COPY_DST)?;
        let mut at = 0;
        for buffer in &buffers {
            encoder.copy_buffer_to_buffer(buffer, 0, &staging, at, buffer.size());
            at += buffer.size();
        }
        let submission = engine.submit(encoder);
        readback::read(engine, &staging, all, submission, patience, |mut rest| {
            let take = |(bytes, buffer): (&Vec<u8>, &wgpu::Buffer)| {
                let (own, more) = rest.split_at(buffer.size() as usize);
                rest = more;
                own[..bytes.len()].to_vec()
            };
            bindings.iter().zip(&buffers).map(take).collect()
        })
    }
}

/// What an update of a [`Tracker`] has found.
#[derive(Clone, Debug, PartialEq)]
pub struct Tracked {
    /// Pairs that filters allow and that overlap now and did not before, or the other way round, in no
    /// particular order.
    pub pairs: Vec<Pair>,
    /// Boxes that were searched as if they had not been there before.
    pub restarted: Vec<u32>,
    /// What was done.
    pub report: Report,
}

/// Searches for changes on a device, update by update, and nothing but that.
#[derive(Debug)]
pub struct Tracker {
    gpu: GpuFinder,
    found: Found,
}

impl Tracker {
    /// On this device.
    pub fn new(gpu: GpuFinder) -> Self {
        Self { gpu, found: Found::default() }
    }

    /// The device, to make it fail.
    pub fn gpu(&self) -> &GpuFinder {
        &self.gpu
    }

    /// The pairs that an update changes.
    ///
    /// # Errors
    /// When the device fails, and with the error that the CPU would end in, too.
    pub fn update(&mut self, request: &ChangeRequest<'_>) -> Result<Tracked, Box<dyn Error>> {
        let mut report = Report::default();
        let restarted = match self.gpu.changes(request, &mut self.found, &mut report) {
            Ok(restarted) => restarted,
            Err(Failure::Call(error)) => return Err(error.into()),
            Err(Failure::Device(error)) => return Err(error.into()),
        };
        Ok(Tracked { pairs: self.found.chunks.concat(), restarted, report })
    }

    /// All pairs of boxes, on the same device and its buffers, in no particular order.
    ///
    /// # Errors
    /// As [`Tracker::update`].
    pub fn find(&mut self, boxes: &[Aabb], config: &Config) -> Result<Vec<Pair>, Box<dyn Error>> {
        let summary = &Summary::of(boxes, None);
        let request = Request { boxes, filters: None, accept: None, summary, config };
        match self.gpu.find(&request, &mut self.found, &mut Report::default()) {
            Ok(()) => Ok(self.found.chunks.concat()),
            Err(Failure::Call(error)) => Err(error.into()),
            Err(Failure::Device(error)) => Err(error.into()),
        }
    }
}
