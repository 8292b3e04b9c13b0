//! The device: its pipelines, buffers and submissions.

use super::adapter;
use super::error::{GpuError, Result};
use pbig_shaders::Kernel;
use std::collections::HashMap;
use std::fmt;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// Work of a test before each wait: it may destroy the device, or panic as wgpu does.
pub(super) type Hook = Box<dyn FnMut(&wgpu::Device) + Send>;

/// The name of a kernel, and true if it scans rows.
pub(super) type KernelId = (&'static str, bool);

pub(super) fn id_of(kernel: &Kernel) -> KernelId {
    (kernel.name, kernel.scans_rows)
}

/// Returns the values of the overrides that a kernel's source declares.
fn constants(kernel: &Kernel, source: &str, is_balanced: bool) -> Vec<(&'static str, f64)> {
    let all = [("BALANCED", is_balanced), ("ROWS", kernel.scans_rows)];
    let declared = all.into_iter().filter(|(name, _)| source.contains(&format!("override {name}")));
    declared.map(|(name, is_set)| (name, f64::from(u8::from(is_set)))).collect()
}

/// A device with its pipelines, shared by finders.
pub(super) struct GpuDevice {
    pub(super) handle: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    pub(super) name: String,
    pub(super) is_software: bool,
    pub(super) buffers_made: AtomicU32,
    /// Kernels that give the rows of a large cell equally many pairs, or do not.
    pub(super) pipelines: Mutex<HashMap<(KernelId, bool), wgpu::ComputePipeline>>,
    pub(super) is_lost: AtomicBool,
    /// Locked while a call of a page is in progress.
    #[cfg(target_arch = "wasm32")]
    pub(super) in_call: Mutex<()>,
    pub(super) hook: Mutex<Hook>,
}

/// A hook has no description.
impl fmt::Debug for GpuDevice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name)
    }
}

impl GpuDevice {
    pub(super) fn new(device: wgpu::Device, queue: wgpu::Queue) -> Result<Self> {
        check_limits(&device.limits())?;
        let info = device.adapter_info();
        Ok(Self {
            name: adapter::describe(&info),
            is_software: info.device_type == wgpu::DeviceType::Cpu,
            handle: device,
            queue,
            buffers_made: AtomicU32::new(0),
            pipelines: Mutex::default(),
            is_lost: AtomicBool::new(false),
            #[cfg(target_arch = "wasm32")]
            in_call: Mutex::default(),
            hook: Mutex::new(Box::new(|_| ())),
        })
    }

    /// Opens a device on an adapter, with its limits and the features that pbig uses.
    pub(super) async fn on(adapter: &wgpu::Adapter) -> Result<Self> {
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("pbig"),
            required_features: adapter.features() & wgpu::Features::TIMESTAMP_QUERY,
            required_limits: adapter.limits(),
            memory_hints: wgpu::MemoryHints::MemoryUsage,
            ..Default::default()
        };
        let opened = adapter.request_device(&descriptor).await;
        let (device, queue) = opened.map_err(|why| GpuError::NoDevice(why.to_string()))?;
        Self::new(device, queue)
    }

    /// Returns the process's device, which finders without a device of their own share. Opening a device takes tenths
    /// of a second. A lost device is replaced.
    pub(super) async fn shared() -> Result<Arc<Self>> {
        static SHARED: Mutex<Option<Arc<GpuDevice>>> = Mutex::new(None);
        let usable = || lock(&SHARED).clone().filter(|device| !device.is_lost());
        if let Some(device) = usable() {
            return Ok(device);
        }
        let opened = Arc::new(Self::on(&adapter::choose(None).await?).await?);
        // Another finder may have opened one meanwhile.
        Ok(usable().unwrap_or_else(|| lock(&SHARED).insert(opened).clone()))
    }

    pub(super) fn is_lost(&self) -> bool {
        self.is_lost.load(Ordering::Relaxed)
    }

    /// Returns the pipeline of a kernel, which is compiled at first use.
    pub(super) fn pipeline(&self, kernel: &'static Kernel, is_balanced: bool) -> wgpu::ComputePipeline {
        let mut pipelines = lock(&self.pipelines);
        let compiled = pipelines
            .entry((id_of(kernel), is_balanced))
            .or_insert_with(|| self.compile(kernel, is_balanced));
        compiled.clone()
    }

    fn compile(&self, kernel: &Kernel, is_balanced: bool) -> wgpu::ComputePipeline {
        let source = &kernel.source();
        let module = self.handle.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(kernel.name),
            source: wgpu::ShaderSource::Wgsl(source.as_str().into()),
        });
        self.handle.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(kernel.name),
            layout: None,
            module: &module,
            entry_point: Some(kernel.name),
            compilation_options: wgpu::PipelineCompilationOptions {
                constants: &constants(kernel, source, is_balanced),
                // Lane 0 would zero everything, which is slow. Kernels zero what they read.
                zero_initialize_workgroup_memory: false,
            },
            cache: None,
        })
    }

    /// Makes a buffer. One that the host writes is mapped.
    pub(super) fn buffer(&self, label: &str, size: u64, usage: wgpu::BufferUsages) -> wgpu::Buffer {
        self.buffers_made.fetch_add(1, Ordering::Relaxed);
        let mapped_at_creation = usage.contains(wgpu::BufferUsages::MAP_WRITE);
        let descriptor = wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation };
        self.handle.create_buffer(&descriptor)
    }

    /// Gives the first bytes of a buffer that the host has mapped to `take`, and unmaps the buffer.
    pub(super) fn read<T>(
        &self,
        from: &wgpu::Buffer,
        bytes: u64,
        take: impl FnOnce(&[u8]) -> T,
    ) -> Result<T> {
        let view = from.get_mapped_range(0..bytes).map_err(|_| self.give_up())?;
        let taken = take(&view);
        drop(view);
        from.unmap();
        Ok(taken)
    }

    pub(super) fn encoder(&self) -> wgpu::CommandEncoder {
        self.handle.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("pbig") })
    }

    pub(super) fn submit(&self, encoder: wgpu::CommandEncoder) -> wgpu::SubmissionIndex {
        self.queue.submit([encoder.finish()])
    }

    /// Marks the device as lost, because its state is unknown.
    pub(super) fn give_up(&self) -> GpuError {
        self.is_lost.store(true, Ordering::Relaxed);
        GpuError::Lost
    }
}

/// Locks a mutex even if another thread panicked while it held the lock: these mutexes guard caches only.
pub(super) fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Returns an error if the device lacks what every WebGPU device has.
fn check_limits(limits: &wgpu::Limits) -> Result<()> {
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
        Some((what, found, needed)) => {
            Err(GpuError::TooLimited(format!("{found} {what}, but {needed} are needed")))
        }
        None => Ok(()),
    }
}
