//! The buffers of a finder on the device, and the bind groups made of them. Buffers grow when needed and shrink when they
//! are hardly used. Lists go up through one staging buffer, which stays mapped between calls: the host copies each list once.

use super::GpuError;
use super::gpu_device::{GpuDevice, Variant};
use crate::GpuOptions;
use bytemuck::Pod;
use pbig_core::internal::{self as parallel, threads_for};
use pbig_shaders::{Buffer, Kernel};
use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Calls after which a buffer is freed if none of them used a quarter of it.
const CALLS_PER_WINDOW: u32 = 64;

/// Smallest size of a buffer, in bytes.
const MIN_BUFFER_BYTES: u64 = 256;

/// Largest size of a buffer that is kept however little it is used, in bytes.
const ALWAYS_KEPT_BYTES: u64 = 1 << 16;

/// Bytes that a thread copies at a time: a multiple of [`wgpu::MAP_ALIGNMENT`].
const PIECE_BYTES: usize = 1 << 19;

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
    /// The buffer through which the host writes into others.
    UploadStaging,
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
            Self::UploadStaging => "upload staging",
        }
    }

    fn usage(self) -> wgpu::BufferUsages {
        use wgpu::BufferUsages as Usage;
        match self {
            Self::Staging(_) | Self::FetchStaging => Usage::MAP_READ | Usage::COPY_DST,
            Self::UploadStaging => Usage::MAP_WRITE | Usage::COPY_SRC,
            Self::Bound(Buffer::Dispatches | Buffer::LongRows, _) => Usage::STORAGE | Usage::INDIRECT,
            Self::Bound(buffer, _) if buffer.is_uniform() => Usage::UNIFORM | Usage::COPY_DST,
            Self::Bound(..) => Usage::STORAGE | Usage::COPY_DST | Usage::COPY_SRC,
        }
    }
}

/// A list for a buffer of the device.
pub(super) struct Upload<'a> {
    buffer: Buffer,
    bytes: &'a [u8],
}

impl<'a> Upload<'a> {
    pub(super) fn new<T: Pod>(buffer: Buffer, list: &'a [T]) -> Self {
        Self { buffer, bytes: bytemuck::cast_slice(list) }
    }

    fn len(&self) -> u64 {
        self.bytes.len() as u64
    }
}

#[derive(Debug)]
struct KeptBuffer {
    buffer: wgpu::Buffer,
    /// Maximum number of bytes that a call of this window used.
    used: u64,
}

/// The buffers of a finder.
#[derive(Debug)]
pub(super) struct Storage {
    pub(super) device: Arc<GpuDevice>,
    /// Largest size of a buffer, in bytes.
    pub(super) max_buffer_bytes: u64,
    /// Bytes of lists that went up and were not yet reported.
    pub(super) bytes_sent: u64,
    buffers: HashMap<BufferId, KeptBuffer>,
    /// The host may write into the staging buffer.
    is_staging_mapped: Arc<AtomicBool>,
    /// Copies from the staging buffer, which the next submission makes.
    pub(super) copies: Option<wgpu::CommandEncoder>,
    /// Bind groups of the present buffers.
    bind_groups: HashMap<(&'static str, Variant, Side), wgpu::BindGroup>,
    calls: u32,
}

impl Storage {
    pub(super) fn new(device: Arc<GpuDevice>, options: &GpuOptions) -> Self {
        Self {
            max_buffer_bytes: device.max_buffer_bytes(options),
            device,
            bytes_sent: 0,
            buffers: HashMap::new(),
            is_staging_mapped: Arc::default(),
            copies: None,
            bind_groups: HashMap::new(),
            calls: 0,
        }
    }

    /// Makes a buffer at least `bytes` long. Returns true if it is new: a buffer that has to grow loses its content.
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
        let is_mapped = id == BufferId::UploadStaging;
        let buffer = self.device.buffer(id.name(), size, id.usage(), is_mapped)?;
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

    /// Writes a few values, such as the parameters of a submission.
    pub(super) fn write<T: Pod>(&mut self, id: impl Into<BufferId>, data: &[T]) -> Result<(), GpuError> {
        let id = id.into();
        self.ensure(id, size_of_val(data) as u64)?;
        self.device.queue.write_buffer(self.get(id), 0, bytemuck::cast_slice(data));
        Ok(())
    }

    /// Makes the buffers of lists, and writes these into the staging buffer, from where the next submission copies them.
    pub(super) fn upload(&mut self, uploads: &[Upload<'_>]) -> Result<(), GpuError> {
        // A call that failed before it was submitted leaves copies behind.
        self.copies = None;
        for upload in uploads {
            self.ensure(upload.buffer, upload.len())?;
        }
        let bytes: u64 = uploads.iter().map(|upload| aligned(upload.len())).sum();
        self.bytes_sent += uploads.iter().map(Upload::len).sum::<u64>();
        if bytes > self.max_buffer_bytes {
            // Each list fits a buffer, but not all together.
            let write = |up: &Upload<'_>| self.device.queue.write_buffer(self.get(up.buffer), 0, up.bytes);
            uploads.iter().for_each(write);
            return Ok(());
        }
        if bytes == 0 { Ok(()) } else { self.stage(bytes, uploads) }
    }

    /// Writes lists into the staging buffer, and records their copies.
    fn stage(&mut self, bytes: u64, uploads: &[Upload<'_>]) -> Result<(), GpuError> {
        self.map_staging(bytes)?;
        let pieces = self.record_copies(uploads);
        let staging = self.get(BufferId::UploadStaging);
        let has_failed = AtomicBool::new(false);
        parallel::run(threads_for(pieces.len()), pieces.len(), |_, i| {
            let (from, piece) = pieces[i];
            match staging.get_mapped_range_mut(from..from + piece.len() as u64) {
                Ok(mut view) => view.copy_from_slice(piece),
                Err(_) => has_failed.store(true, Ordering::Relaxed),
            }
        });
        if has_failed.into_inner() {
            return Err(self.device.give_up());
        }
        staging.unmap();
        self.is_staging_mapped.store(false, Ordering::Relaxed);
        Ok(())
    }

    /// Gives each list a place in the staging buffer, and records its copy. Returns the pieces that threads write there.
    fn record_copies<'a>(&mut self, uploads: &[Upload<'a>]) -> Vec<(u64, &'a [u8])> {
        let (mut pieces, mut from) = (Vec::new(), 0);
        let mut encoder = self.device.encoder();
        let staging = self.get(BufferId::UploadStaging);
        for upload in uploads.iter().filter(|upload| upload.len() > 0) {
            encoder.copy_buffer_to_buffer(staging, from, self.get(upload.buffer), 0, upload.len());
            // Each but the last ends at a multiple of the alignment.
            for piece in upload.bytes.chunks(PIECE_BYTES) {
                pieces.push((from, piece));
                from += piece.len() as u64;
            }
            from = aligned(from);
        }
        self.copies = Some(encoder);
        pieces
    }

    /// Makes a mapped staging buffer, unless there is one.
    fn map_staging(&mut self, bytes: u64) -> Result<(), GpuError> {
        if !self.is_staging_mapped.load(Ordering::Acquire) {
            // A call that failed has left it to the device.
            self.buffers.remove(&BufferId::UploadStaging);
        }
        if self.ensure(BufferId::UploadStaging, bytes)? {
            self.is_staging_mapped = Arc::new(AtomicBool::new(true));
        }
        Ok(())
    }

    /// Asks for the staging buffer back once the device has made its copies: the wait for the submission maps it.
    pub(super) fn take_staging_back(&self) {
        let is_mapped = self.is_staging_mapped.clone();
        let staging = self.get(BufferId::UploadStaging);
        staging.map_async(wgpu::MapMode::Write, .., move |result| {
            is_mapped.store(result.is_ok(), Ordering::Release);
        });
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
            resource: self.get(BufferId::of(variant.bound(buffer), side)).as_entire_binding(),
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

/// Returns the next place at which a mapped range may begin.
fn aligned(place: u64) -> u64 {
    place.next_multiple_of(wgpu::MAP_ALIGNMENT)
}
