//! The buffers of a finder on the device, and the bind groups made of them. Buffers grow when needed and shrink when they
//! are hardly used.

use super::GpuError;
use super::device::{GpuDevice, Variant};
use crate::config::GpuOptions;
use bytemuck::Pod;
use pbig_shaders::{Buffer, Kernel};
use std::collections::HashMap;
use std::sync::Arc;

/// Calls after which a buffer is freed if none of them used a quarter of it.
const CALLS_PER_WINDOW: u32 = 64;

/// Smallest size of a buffer, in bytes.
const MIN_BUFFER_BYTES: u64 = 256;

/// Largest size of a buffer that is kept however little it is used, in bytes.
const ALWAYS_KEPT_BYTES: u64 = 1 << 16;

/// One of the two sets of buffers for chunks, 0 or 1: two chunks can be in progress (PBIG 5.3).
pub(super) type Side = usize;

/// A buffer of a finder.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum BufferId {
    /// A buffer that kernels bind. Only those of a chunk have a second side.
    Bound(Buffer, Side),
    /// The buffer through which the host reads a chunk's output.
    Staging(Side),
    /// The buffer through which the host reads parts of other buffers.
    FetchStaging,
}

impl From<Buffer> for BufferId {
    fn from(buffer: Buffer) -> Self {
        Self::Bound(buffer, 0)
    }
}

impl BufferId {
    /// Returns the buffer for a binding in a submission on `side`.
    pub(super) fn of(binding: Buffer, side: Side) -> Self {
        match binding {
            Buffer::Chunk | Buffer::Totals | Buffer::Out => Self::Bound(binding, side),
            other => other.into(),
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Bound(buffer, _) => buffer.name(),
            Self::Staging(_) => "staging",
            Self::FetchStaging => "fetch staging",
        }
    }

    fn usage(self) -> wgpu::BufferUsages {
        use wgpu::BufferUsages as Usage;
        match self {
            Self::Staging(_) | Self::FetchStaging => Usage::MAP_READ | Usage::COPY_DST,
            Self::Bound(Buffer::Dispatches, _) => Usage::STORAGE | Usage::INDIRECT,
            Self::Bound(buffer, _) if buffer.is_uniform() => Usage::UNIFORM | Usage::COPY_DST,
            Self::Bound(..) => Usage::STORAGE | Usage::COPY_DST | Usage::COPY_SRC,
        }
    }
}

#[derive(Debug)]
struct KeptBuffer {
    buffer: wgpu::Buffer,
    /// Most bytes that a call of this window used.
    used: u64,
}

/// The buffers of a finder.
#[derive(Debug)]
pub(super) struct Storage {
    pub(super) device: Arc<GpuDevice>,
    /// Largest size of a buffer, in bytes.
    pub(super) max_buffer_bytes: u64,
    /// Bytes written since the last reset.
    pub(super) bytes_sent: u64,
    buffers: HashMap<BufferId, KeptBuffer>,
    /// Bind groups of the present buffers.
    bind_groups: HashMap<(&'static str, Variant, Side), wgpu::BindGroup>,
    calls: u32,
}

impl Storage {
    pub(super) fn new(device: Arc<GpuDevice>, options: &GpuOptions) -> Self {
        let max_buffer_bytes = device.max_buffer_bytes(options);
        let (buffers, bind_groups) = (HashMap::new(), HashMap::new());
        Self { device, max_buffer_bytes, bytes_sent: 0, buffers, bind_groups, calls: 0 }
    }

    /// Makes a buffer at least `bytes` long. A buffer that has to grow loses its content; the result is then true.
    pub(super) fn ensure(&mut self, id: impl Into<BufferId>, bytes: u64) -> Result<bool, GpuError> {
        let (id, limit) = (id.into(), self.max_buffer_bytes);
        if bytes > limit {
            return Err(GpuError::TooLarge { what: id.name(), bytes, limit });
        }
        let bytes = bytes.max(MIN_BUFFER_BYTES);
        if let Some(kept) = self.buffers.get_mut(&id).filter(|kept| kept.buffer.size() >= bytes) {
            kept.used = kept.used.max(bytes);
            return Ok(false);
        }
        // A quarter more, so that a growing scene does not allocate with every call.
        let size = (bytes + bytes / 4).min(limit).next_multiple_of(MIN_BUFFER_BYTES);
        // The old buffer goes first, because both at once may not fit.
        self.buffers.remove(&id);
        self.bind_groups.clear();
        let buffer = self.device.buffer(id.name(), size, id.usage())?;
        self.buffers.insert(id, KeptBuffer { buffer, used: bytes });
        Ok(true)
    }

    /// Returns a buffer that [`Storage::ensure`] has made.
    pub(super) fn get(&self, id: impl Into<BufferId>) -> &wgpu::Buffer {
        &self.buffers[&id.into()].buffer
    }

    /// Returns the size of a buffer in bytes, or 0 if there is none.
    pub(super) fn size(&self, id: impl Into<BufferId>) -> u64 {
        self.buffers.get(&id.into()).map_or(0, |kept| kept.buffer.size())
    }

    pub(super) fn bytes(&self) -> u64 {
        self.buffers.values().map(|kept| kept.buffer.size()).sum()
    }

    /// Writes elements into a buffer, from the element `start` on.
    pub(super) fn write<T: Pod>(&mut self, id: impl Into<BufferId>, start: usize, data: &[T]) {
        let at = (start * size_of::<T>()) as u64;
        self.device.queue.write_buffer(self.get(id), at, bytemuck::cast_slice(data));
        self.bytes_sent += size_of_val(data) as u64;
    }

    pub(super) fn upload<T: Pod>(&mut self, id: impl Into<BufferId>, data: &[T]) -> Result<(), GpuError> {
        let id = id.into();
        self.ensure(id, size_of_val(data) as u64)?;
        self.write(id, 0, data);
        Ok(())
    }

    pub(super) fn bind_group(
        &mut self,
        kernel: &'static Kernel,
        variant: Variant,
        side: Side,
        pipeline: &wgpu::ComputePipeline,
    ) -> wgpu::BindGroup {
        let key = (kernel.name, variant, side);
        if let Some(known) = self.bind_groups.get(&key) {
            return known.clone();
        }
        let entry = |(binding, &buffer): (u32, &Buffer)| wgpu::BindGroupEntry {
            binding,
            resource: self.get(BufferId::of(buffer, side)).as_entire_binding(),
        };
        let entries: Vec<_> = (0..).zip(kernel.bindings).map(entry).collect();
        let layout = &pipeline.get_bind_group_layout(0);
        let descriptor = wgpu::BindGroupDescriptor { label: Some(kernel.name), layout, entries: &entries };
        let made = self.device.handle.create_bind_group(&descriptor);
        self.bind_groups.insert(key, made.clone());
        made
    }

    /// Notes the end of a call. Once in a window frees buffers that were hardly used, and returns true.
    pub(super) fn end_call(&mut self) -> bool {
        self.calls += 1;
        if self.calls < CALLS_PER_WINDOW {
            return false;
        }
        self.calls = 0;
        self.buffers.retain(|_, kept| kept.buffer.size() <= (4 * kept.used).max(ALWAYS_KEPT_BYTES));
        self.buffers.values_mut().for_each(|kept| kept.used = 0);
        self.bind_groups.clear();
        true
    }
}
