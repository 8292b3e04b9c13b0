//! The device: pipelines, buffers, submissions. With `readback`, the only place that talks to a queue.

use super::{GpuError, adapter};
use crate::config::GpuOptions;
use pbig_shaders::Kernel;
use std::collections::HashMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::Duration;

/// A fault to be injected by a test, at a later submission.
#[doc(hidden)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The device is destroyed before the submission.
    LoseDevice,
    /// The device has no memory for the next buffer.
    OutOfMemory,
    /// The kernels do not compile.
    RefuseShader,
    /// The device takes too long.
    Timeout,
    /// wgpu panics, as it does when a device is lost while it is waited for.
    Panic,
}

/// What is fixed when a pipeline is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Variant {
    root: u32,
    balanced: bool,
    /// Whether changes are searched for rather than overlaps.
    changes: bool,
}

impl Variant {
    pub(super) fn new(options: &GpuOptions, changes: bool) -> Self {
        Self { root: options.root.min(9), balanced: options.load_balancing, changes }
    }

    /// Two variants that are the same to a kernel are one.
    fn to(self, kernel: &Kernel) -> Self {
        Self { changes: self.changes && kernel.tells_changes(), ..self }
    }

    /// The overrides that a kernel has.
    fn constants(self, source: &str) -> Vec<(&'static str, f64)> {
        let all = [("ROOT", f64::from(self.root)), ("BALANCED", f64::from(u8::from(self.balanced)))];
        all.into_iter().filter(|(name, _)| source.contains(&format!("override {name}"))).collect()
    }
}

/// A device with its pipelines, shared by the finders that use it.
#[derive(Debug)]
pub(crate) struct Engine {
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    pub(super) name: String,
    pub(super) software: bool,
    pub(super) subgroups: bool,
    pub(super) timestamps: bool,
    pipelines: Mutex<HashMap<(&'static str, Variant), wgpu::ComputePipeline>>,
    lost: AtomicBool,
    fault: Mutex<Option<Fault>>,
    /// Submissions until the fault.
    countdown: AtomicU32,
}

impl Engine {
    pub(super) fn new(device: wgpu::Device, queue: wgpu::Queue) -> Result<Self, GpuError> {
        check_limits(&device.limits())?;
        let (features, info) = (device.features(), device.adapter_info());
        Ok(Self {
            name: adapter::describe(&info),
            software: info.device_type == wgpu::DeviceType::Cpu,
            subgroups: features.contains(wgpu::Features::SUBGROUP),
            timestamps: features.contains(wgpu::Features::TIMESTAMP_QUERY),
            device,
            queue,
            pipelines: Mutex::default(),
            lost: AtomicBool::new(false),
            fault: Mutex::default(),
            countdown: AtomicU32::new(0),
        })
    }

    /// A device of our own on an adapter.
    pub(super) fn on(adapter: &wgpu::Adapter) -> Result<Self, GpuError> {
        let (device, queue) = adapter::open(adapter)?;
        Self::new(device, queue)
    }

    /// The process's device, which finders without one of their own share: to open one takes tenths of
    /// a second. Opened anew when it has been lost.
    pub(super) fn shared() -> Result<Arc<Self>, GpuError> {
        static SHARED: OnceLock<Mutex<Option<Arc<Engine>>>> = OnceLock::new();
        let mut shared = lock(SHARED.get_or_init(Mutex::default));
        match &*shared {
            Some(engine) if !engine.is_lost() => Ok(engine.clone()),
            _ => {
                let engine = Arc::new(Self::on(&adapter::choose(None)?)?);
                *shared = Some(engine.clone());
                Ok(engine)
            }
        }
    }

    pub(super) fn is_lost(&self) -> bool {
        self.lost.load(Ordering::Relaxed)
    }

    /// In words, what was chosen for the device, and why.
    pub(super) fn variants(&self) -> Vec<String> {
        let scan = if self.subgroups {
            "with subgroups: the adapter has them"
        } else {
            "without subgroups: the adapter has none"
        };
        let times = if self.timestamps { "by timestamps" } else { "none: the adapter has no timestamps" };
        let most = self.most_bytes(&GpuOptions::DEFAULT);
        vec![
            format!("scan, schedule: {scan}"),
            "check, small cells: the device's square root, corrected by integers; large cells: balanced rows"
                .into(),
            format!("times of kernels: {times}"),
            format!(
                "sets are searched in parts from {} boxes on",
                most / size_of::<crate::layout::Located>() as u64
            ),
        ]
    }

    /// Arms a fault for after so many submissions.
    pub(super) fn inject(&self, fault: Fault, submissions: u32) {
        *lock(&self.fault) = Some(fault);
        self.countdown.store(submissions, Ordering::Relaxed);
    }

    /// Whether the given fault is due; it strikes once.
    fn strikes(&self, fault: Fault) -> bool {
        let mut armed = lock(&self.fault);
        let due = *armed == Some(fault) && self.countdown.load(Ordering::Relaxed) == 0;
        if due {
            *armed = None;
        }
        due
    }

    /// Largest buffer or binding.
    pub(super) fn most_bytes(&self, options: &GpuOptions) -> u64 {
        let limits = self.device.limits();
        let most = limits.max_buffer_size.min(limits.max_storage_buffer_binding_size);
        most.min(options.max_bytes.max(1 << 20)) / 256 * 256
    }

    /// Runs `work` and turns the errors that wgpu reports meanwhile into an `Err`.
    pub(super) fn watch<T, F: From<GpuError>>(&self, work: impl FnOnce() -> Result<T, F>) -> Result<T, F> {
        use wgpu::ErrorFilter::{Internal, OutOfMemory, Validation};
        let scopes = [Validation, OutOfMemory, Internal].map(|filter| self.device.push_error_scope(filter));
        let result = work();
        // Innermost first.
        let errors = scopes.into_iter().rev().map(|scope| pollster::block_on(scope.pop()));
        let error = errors.fold(None, |first: Option<wgpu::Error>, error| first.or(error));
        match error {
            None => result,
            Some(wgpu::Error::OutOfMemory { .. }) => Err(GpuError::OutOfMemory.into()),
            // A lost device refuses everything, in words that say nothing of the loss.
            Some(_) if !self.is_alive() => Err(self.give_up().into()),
            Some(other) => Err(GpuError::Refused(first_line(&other.to_string())).into()),
        }
    }

    /// Whether the device still takes work and finishes it, by trying.
    fn is_alive(&self) -> bool {
        self.is_idle_within(Duration::from_secs(1))
    }

    /// Whether the device finishes all its work in time, which it is given some more of to see.
    pub(super) fn is_idle_within(&self, limit: Duration) -> bool {
        let scope = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let submission = self.queue.submit([encoder.finish()]);
        let finished = self.poll(submission, limit).is_ok();
        let refused = pollster::block_on(scope.pop()).is_some();
        finished && !refused
    }

    /// The compiled kernel, compiled at first use.
    pub(super) fn pipeline(
        &self,
        kernel: &'static Kernel,
        variant: Variant,
    ) -> Result<wgpu::ComputePipeline, GpuError> {
        let variant = variant.to(kernel);
        let mut pipelines = lock(&self.pipelines);
        if let Some(pipeline) = pipelines.get(&(kernel.name, variant)) {
            return Ok(pipeline.clone());
        }
        let mut source = kernel.source(self.subgroups, variant.changes);
        if self.strikes(Fault::RefuseShader) {
            source.push_str("this is no WGSL");
        }
        let pipeline = self.watch(|| Ok::<_, GpuError>(self.compile(kernel, &source, variant)))?;
        pipelines.insert((kernel.name, variant), pipeline.clone());
        Ok(pipeline)
    }

    fn compile(&self, kernel: &Kernel, source: &str, variant: Variant) -> wgpu::ComputePipeline {
        let module = self.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(kernel.name),
            source: wgpu::ShaderSource::Wgsl(source.into()),
        });
        self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(kernel.name),
            layout: None,
            module: &module,
            entry_point: Some(kernel.name),
            compilation_options: wgpu::PipelineCompilationOptions {
                constants: &variant.constants(source),
                ..Default::default()
            },
            cache: None,
        })
    }

    pub(super) fn buffer(
        &self,
        label: &str,
        size: u64,
        usage: wgpu::BufferUsages,
    ) -> Result<wgpu::Buffer, GpuError> {
        if self.strikes(Fault::OutOfMemory) {
            return Err(GpuError::OutOfMemory);
        }
        let descriptor =
            wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
        Ok(self.device.create_buffer(&descriptor))
    }

    pub(super) fn submit(&self, encoder: wgpu::CommandEncoder) -> wgpu::SubmissionIndex {
        if self.strikes(Fault::LoseDevice) {
            self.device.destroy();
        }
        let left = self.countdown.load(Ordering::Relaxed);
        self.countdown.store(left.saturating_sub(1), Ordering::Relaxed);
        self.queue.submit([encoder.finish()])
    }

    /// Waits for a submission, but not longer than `patience`.
    pub(super) fn wait(&self, submission: wgpu::SubmissionIndex, patience: Duration) -> Result<(), GpuError> {
        if self.strikes(Fault::Timeout) {
            self.give_up();
            return Err(GpuError::Timeout(patience));
        }
        match self.poll(submission, patience) {
            Ok(()) => Ok(()),
            Err(Some(wgpu::PollError::Timeout)) => {
                self.give_up();
                // To drop the last handle of a queue waits for it, without a limit: this one is kept.
                std::mem::forget((self.device.clone(), self.queue.clone()));
                Err(GpuError::Timeout(patience))
            }
            // The submission was not accepted: what was wrong with it is known by the error scopes.
            Err(Some(_)) if self.is_alive() => Err(GpuError::Refused("the submission".into())),
            Err(_) => Err(self.give_up()),
        }
    }

    /// Waits; `Err(None)` when wgpu panicked, as it does when the driver reports a lost device.
    fn poll(
        &self,
        submission: wgpu::SubmissionIndex,
        patience: Duration,
    ) -> Result<(), Option<wgpu::PollError>> {
        let wait = wgpu::PollType::Wait { submission_index: Some(submission), timeout: Some(patience) };
        let poll = || {
            assert!(!self.strikes(Fault::Panic), "an injected fault");
            self.device.poll(wait)
        };
        match catch_unwind(AssertUnwindSafe(poll)) {
            Ok(polled) => polled.map(|_| ()).map_err(Some),
            Err(_) => Err(None),
        }
    }

    /// A device that was given up for a while and works again.
    pub(super) fn take_back(&self) {
        self.lost.store(false, Ordering::Relaxed);
    }

    /// Marks the device as lost: what it is doing, or whether it is there at all, is unknown.
    pub(super) fn give_up(&self) -> GpuError {
        self.lost.store(true, Ordering::Relaxed);
        GpuError::Lost
    }
}

/// A lock that a panic in another thread does not poison: what is behind it is only a cache.
pub(super) fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn first_line(text: &str) -> String {
    text.lines().map(str::trim).filter(|line| !line.is_empty()).take(3).collect::<Vec<_>>().join(": ")
}

/// The kernels need what every WebGPU device has.
fn check_limits(limits: &wgpu::Limits) -> Result<(), GpuError> {
    let needs = [
        ("storage buffers a stage", limits.max_storage_buffers_per_shader_stage.into(), 8),
        ("invocations a workgroup", limits.max_compute_invocations_per_workgroup.into(), 256),
        ("bytes of workgroup memory", limits.max_compute_workgroup_storage_size.into(), 16_384),
        ("workgroups in a dimension", limits.max_compute_workgroups_per_dimension.into(), 65_535),
        ("invocations along x", limits.max_compute_workgroup_size_x.into(), 256),
        ("bytes a storage binding", limits.max_storage_buffer_binding_size, 1 << 20),
        ("bytes a buffer", limits.max_buffer_size, 1 << 20),
    ];
    match needs.into_iter().find(|&(_, found, needed)| found < needed) {
        Some((what, found, needed)) => Err(GpuError::TooLimited { what, found, needed }),
        None => Ok(()),
    }
}
