//! The buffers of a finder on the device, and the bind groups made of them. Buffers grow when needed and shrink when they
//! are hardly used. Each list goes up through a staging buffer, which stays mapped between calls: threads write it there once.

use super::error::{GpuError, Result};
use super::gpu_device::{GpuDevice, KernelId, id_of};
use crate::GpuOptions;
use crate::layout::{BOX_BYTES, Chunk, halves};
use crate::policy::MAX_BOXES;
use bytemuck::Pod;
use pbig_core::internal::{self as parallel, Clock, threads_for};
use pbig_shaders::{Buffer, Kernel};
use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use wgpu::CommandEncoder;

/// Calls after which a buffer is freed if none of them used a quarter of it.
const CALLS_PER_WINDOW: u32 = 64;

/// Smallest size of a buffer, in bytes.
const MIN_BUFFER_BYTES: u64 = 256;

/// Largest size of a buffer that is kept however little it is used, in bytes.
const ALWAYS_KEPT_BYTES: u64 = 1 << 16;

/// Bytes that a thread copies at a time: a multiple of [`wgpu::MAP_ALIGNMENT`].
const PIECE_BYTES: usize = 1 << 19;

/// The limit of one buffer, as errors name it.
const A_BUFFER: &str = "the device or GpuOptions::max_bytes";

/// A buffer of a finder.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum BufferId {
    /// A buffer that kernels bind.
    Bound(Buffer),
    /// One of two buffers through which the host reads other buffers, piece by piece.
    Staging(usize),
    /// The buffer through which the host writes a list.
    UploadStaging(Buffer),
}

impl From<Buffer> for BufferId {
    fn from(buffer: Buffer) -> Self {
        Self::Bound(buffer)
    }
}

impl BufferId {
    fn name(self) -> &'static str {
        match self {
            Self::Bound(buffer) => buffer.name(),
            Self::Staging(_) => "staging",
            Self::UploadStaging(_) => "upload staging",
        }
    }

    fn usage(self) -> wgpu::BufferUsages {
        use wgpu::BufferUsages as Usage;
        match self {
            Self::Staging(_) => Usage::MAP_READ | Usage::COPY_DST,
            Self::UploadStaging(_) => Usage::MAP_WRITE | Usage::COPY_SRC,
            Self::Bound(buffer) if buffer.is_uniform() => Usage::UNIFORM | Usage::COPY_DST,
            Self::Bound(Buffer::Dispatches | Buffer::LongRows | Buffer::PairCount) => {
                Usage::STORAGE | Usage::INDIRECT | Usage::COPY_DST | Usage::COPY_SRC
            }
            Self::Bound(_) => Usage::STORAGE | Usage::COPY_DST | Usage::COPY_SRC,
        }
    }
}

#[derive(Debug)]
struct KeptBuffer {
    buffer: wgpu::Buffer,
    /// Maximum number of bytes that a call of this window used.
    used: u64,
    /// False while the device has this staging buffer, if the host writes it.
    is_mapped: Arc<AtomicBool>,
}

/// Bytes that are on their way to a staging buffer.
pub(super) struct Fetch {
    pub(super) staging: wgpu::Buffer,
    pub(super) bytes: u64,
    pub(super) submission: wgpu::SubmissionIndex,
    /// Time of submitting the copies: a software adapter works meanwhile.
    pub(super) submitting: Duration,
}

#[derive(Debug)]
pub(super) struct Storage {
    pub(super) device: Arc<GpuDevice>,
    pub(super) options: GpuOptions,
    /// Largest size of a buffer, in bytes.
    pub(super) max_buffer_bytes: u64,
    buffers: HashMap<BufferId, KeptBuffer>,
    /// Bind groups of the present buffers.
    bind_groups: HashMap<KernelId, wgpu::BindGroup>,
    calls: u32,
}

impl Storage {
    pub(super) fn new(device: &Arc<GpuDevice>, options: &GpuOptions) -> Self {
        let limits = device.handle.limits();
        let most = limits.max_buffer_size.min(limits.max_storage_buffer_binding_size);
        Self {
            max_buffer_bytes: most.min(options.max_bytes.max(1 << 20)) / 256 * 256,
            options: *options,
            device: device.clone(),
            buffers: HashMap::new(),
            bind_groups: HashMap::new(),
            calls: 0,
        }
    }

    /// Returns true if this was made for a device and options.
    pub(super) fn suits(&self, device: &Arc<GpuDevice>, options: &GpuOptions) -> bool {
        Arc::ptr_eq(&self.device, device) && self.options == *options
    }

    /// Returns an error if so many boxes do not fit every buffer.
    pub(super) fn check_boxes(&self, boxes: u64) -> Result<()> {
        let limit = (self.max_buffer_bytes / BOX_BYTES, A_BUFFER).min((MAX_BOXES, "pbig"));
        check(boxes, limit, || format!("{boxes} boxes"))
    }

    /// Makes a buffer at least `bytes` long. A buffer that has to grow loses its content.
    pub(super) fn ensure(&mut self, id: impl Into<BufferId>, bytes: u64) -> Result<()> {
        let (id, most) = (id.into(), self.max_buffer_bytes);
        check(bytes, (most, A_BUFFER), || format!("the buffer {} needs {bytes} bytes", id.name()))?;
        let bytes = bytes.max(MIN_BUFFER_BYTES);
        if let Some(kept) = self.buffers.get_mut(&id).filter(|kept| kept.buffer.size() >= bytes) {
            kept.used = kept.used.max(bytes);
            return Ok(());
        }
        // The old buffer goes first, because both at once may not fit.
        self.buffers.remove(&id);
        self.bind_groups.clear();
        // A quarter more, so that a growing scene does not allocate with every call.
        let size = (bytes + bytes / 4).min(most).next_multiple_of(MIN_BUFFER_BYTES);
        let total = self.bytes() + size;
        check(total, (self.options.max_total_bytes, "GpuOptions::max_total_bytes"), || {
            format!("with the buffer {} the device's buffers need {total} bytes", id.name())
        })?;
        let buffer = self.device.buffer(id.name(), size, id.usage());
        self.buffers.insert(id, KeptBuffer { buffer, used: bytes, is_mapped: Arc::new(true.into()) });
        Ok(())
    }

    /// Returns a buffer that [`Storage::ensure`] has made.
    pub(super) fn get(&self, id: impl Into<BufferId>) -> &wgpu::Buffer {
        &self.buffers[&id.into()].buffer
    }

    /// Returns the size of a buffer in bytes, or 0 if there is none.
    pub(super) fn size(&self, id: impl Into<BufferId>) -> u64 {
        self.buffers.get(&id.into()).map_or(0, |kept| kept.buffer.size())
    }

    /// Returns a range of work with the room for its pairs, of which a call may have this number.
    pub(super) fn with_room(&self, items: Chunk, max_pairs: u64) -> Chunk {
        // A list of 2^32 - 1 words would have no place for the mark of none.
        let words = (self.size(Buffer::Out) / 4).min(u64::from(u32::MAX) - 1);
        Chunk { word_capacity: words as u32, pairs_left: halves(max_pairs), ..items }
    }

    pub(super) fn free(&mut self) {
        self.buffers.clear();
        self.bind_groups.clear();
    }

    pub(super) fn bytes(&self) -> u64 {
        self.buffers.values().map(|kept| kept.buffer.size()).sum()
    }

    /// Writes a few values, such as the parameters of a submission.
    pub(super) fn write<T: Pod>(&mut self, buffer: Buffer, data: &[T]) -> Result<()> {
        self.ensure(buffer, size_of_val(data) as u64)?;
        self.device.queue.write_buffer(self.get(buffer), 0, bytemuck::cast_slice(data));
        Ok(())
    }

    /// Makes a uniform anew. Commands that were recorded keep the old one.
    pub(super) fn replace<T: Pod>(&mut self, uniform: Buffer, value: &T) -> Result<()> {
        self.buffers.remove(&uniform.into());
        self.write(uniform, &[*value])
    }

    /// Makes the buffer of a list, and sends the list. Returns its bytes.
    pub(super) fn upload<T: Pod>(&mut self, buffer: Buffer, list: &[T]) -> Result<u64> {
        let list: &[u8] = bytemuck::cast_slice(list);
        let bytes = list.len() as u64;
        // Kernels bind it even if it is empty.
        self.ensure(buffer, bytes)?;
        if bytes > 0 {
            let id = BufferId::UploadStaging(buffer);
            self.stage(id, list)?;
            let KeptBuffer { buffer: staging, is_mapped, .. } = &self.buffers[&id];
            let (mut encoder, is_mapped) = (self.device.encoder(), is_mapped.clone());
            encoder.copy_buffer_to_buffer(staging, 0, self.get(buffer), 0, bytes);
            // A later wait maps it again.
            encoder.map_buffer_on_submit(staging, wgpu::MapMode::Write, .., move |result| {
                is_mapped.store(result.is_ok(), Ordering::Release);
            });
            self.device.submit(encoder);
        }
        Ok(bytes)
    }

    /// Writes a list into its staging buffer: each thread writes pieces of it straight into mapped memory.
    fn stage(&mut self, id: BufferId, list: &[u8]) -> Result<()> {
        // A call that failed has left the buffer to the device.
        if self.buffers.get(&id).is_some_and(|kept| !kept.is_mapped.load(Ordering::Acquire)) {
            self.buffers.remove(&id);
        }
        self.ensure(id, list.len() as u64)?;
        let kept = &self.buffers[&id];
        let pieces: Vec<&[u8]> = list.chunks(PIECE_BYTES).collect();
        let has_failed = AtomicBool::new(false);
        parallel::run(threads_for(pieces.len()), pieces.len(), |_, i| {
            let (from, piece) = ((i * PIECE_BYTES) as u64, pieces[i]);
            match kept.buffer.get_mapped_range_mut(from..from + piece.len() as u64) {
                Ok(mut view) => view.copy_from_slice(piece),
                Err(_) => has_failed.store(true, Ordering::Relaxed),
            }
        });
        if has_failed.into_inner() {
            return Err(self.device.give_up());
        }
        kept.buffer.unmap();
        kept.is_mapped.store(false, Ordering::Relaxed);
        Ok(())
    }

    /// Submits copies to a staging buffer of this number of bytes.
    pub(super) fn fetch(
        &mut self,
        staging: BufferId,
        bytes: u64,
        copy: impl FnOnce(&Self, &mut CommandEncoder, &wgpu::Buffer),
    ) -> Result<Fetch> {
        self.ensure(staging, bytes)?;
        let (staging, mut encoder) = (self.get(staging).clone(), self.device.encoder());
        copy(self, &mut encoder, &staging);
        let mut clock = Clock::start();
        let submission = self.device.submit(encoder);
        Ok(Fetch { staging, bytes, submission, submitting: clock.lap() })
    }

    pub(super) fn bind_group(
        &mut self,
        kernel: &Kernel,
        pipeline: &wgpu::ComputePipeline,
    ) -> wgpu::BindGroup {
        if let Some(known) = self.bind_groups.get(&id_of(kernel)) {
            return known.clone();
        }
        let entry = |(binding, &buffer): (u32, &Buffer)| wgpu::BindGroupEntry {
            binding,
            resource: self.get(buffer).as_entire_binding(),
        };
        let entries: Vec<_> = (0..).zip(kernel.bindings).map(entry).collect();
        let layout = &pipeline.get_bind_group_layout(0);
        let descriptor = wgpu::BindGroupDescriptor { label: Some(kernel.name), layout, entries: &entries };
        let made = self.device.handle.create_bind_group(&descriptor);
        self.bind_groups.insert(id_of(kernel), made.clone());
        made
    }

    /// Notes the end of a call. Once in a window frees buffers that were hardly used.
    pub(super) fn end_call(&mut self) {
        self.calls += 1;
        if self.calls < CALLS_PER_WINDOW {
            return;
        }
        self.calls = 0;
        self.buffers.retain(|_, kept| kept.buffer.size() <= (4 * kept.used).max(ALWAYS_KEPT_BYTES));
        self.buffers.values_mut().for_each(|kept| kept.used = 0);
        self.bind_groups.clear();
    }
}

/// Returns an error if what is needed exceeds a limit, which has a name.
fn check(needed: u64, (most, limit): (u64, &str), what: impl FnOnce() -> String) -> Result<()> {
    if needed <= most {
        Ok(())
    } else {
        Err(GpuError::Declined(format!("{}, but {limit} allows {most}", what())))
    }
}
