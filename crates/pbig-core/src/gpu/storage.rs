//! The buffers of a finder on the device. They grow when needed and shrink when they are hardly used.

use super::GpuError;
use super::device::GpuDevice;
use crate::config::GpuOptions;
use pbig_shaders::Buffer;
use std::collections::HashMap;

/// Calls after which a buffer is freed if none of them used a quarter of it.
const CALLS_PER_WINDOW: u32 = 64;

/// Smallest size of a buffer, in bytes.
const MIN_BUFFER_BYTES: u64 = 256;

/// Largest size of a buffer that is kept however little it is used, in bytes.
const ALWAYS_KEPT_BYTES: u64 = 1 << 16;

/// One of the two sets of buffers for chunks: two chunks can be in progress (PBIG 5.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Side {
    First,
    Second,
}

impl Side {
    pub(super) fn other(self) -> Self {
        match self {
            Self::First => Self::Second,
            Self::Second => Self::First,
        }
    }
}

/// A buffer of a finder.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum BufferId {
    /// A buffer that kernels bind.
    Bound(Buffer),
    /// A buffer that kernels bind, one for each side.
    Sided(Buffer, Side),
    /// The buffer through which the host reads a chunk's output.
    Staging(Side),
    /// The buffer through which the host reads parts of other buffers.
    FetchStaging,
}

impl BufferId {
    /// Returns the buffer for a binding in a submission on `side`.
    pub(super) fn of(binding: Buffer, side: Side) -> Self {
        match binding {
            Buffer::Chunk | Buffer::Totals | Buffer::Out => Self::Sided(binding, side),
            other => Self::Bound(other),
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Bound(buffer) | Self::Sided(buffer, _) => buffer.name(),
            Self::Staging(_) => "staging",
            Self::FetchStaging => "fetch staging",
        }
    }

    /// Returns the usage. All buffers but uniforms and those that the host reads can be bound, written and copied.
    fn usage(self) -> wgpu::BufferUsages {
        use wgpu::BufferUsages as Usage;
        match self {
            Self::Staging(_) | Self::FetchStaging => Usage::MAP_READ | Usage::COPY_DST,
            Self::Bound(Buffer::Dispatches) => Usage::STORAGE | Usage::INDIRECT,
            Self::Bound(buffer) | Self::Sided(buffer, _) if buffer.is_uniform() => {
                Usage::UNIFORM | Usage::COPY_DST
            }
            Self::Bound(_) | Self::Sided(..) => Usage::STORAGE | Usage::COPY_DST | Usage::COPY_SRC,
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
    buffers: HashMap<BufferId, KeptBuffer>,
    /// Number of changes of any buffer. Bind groups of an earlier generation are stale.
    pub(super) generation: u64,
    calls: u32,
    max_buffer_bytes: u64,
}

impl Storage {
    pub(super) fn new(device: &GpuDevice, options: &GpuOptions) -> Self {
        let max_buffer_bytes = device.max_buffer_bytes(options);
        Self { buffers: HashMap::new(), generation: 0, calls: 0, max_buffer_bytes }
    }

    /// Returns the largest size of a buffer, in bytes.
    pub(super) fn max_buffer_bytes(&self) -> u64 {
        self.max_buffer_bytes
    }

    /// Makes a buffer at least `bytes` long. A buffer that has to grow loses its content; the result is then true.
    pub(super) fn ensure(&mut self, device: &GpuDevice, id: BufferId, bytes: u64) -> Result<bool, GpuError> {
        if bytes > self.max_buffer_bytes {
            return Err(GpuError::TooLarge { what: id.name(), bytes, limit: self.max_buffer_bytes });
        }
        let bytes = bytes.max(MIN_BUFFER_BYTES);
        if let Some(kept) = self.buffers.get_mut(&id).filter(|kept| kept.buffer.size() >= bytes) {
            kept.used = kept.used.max(bytes);
            return Ok(false);
        }
        // A quarter more, so that a growing scene does not allocate with every call.
        let size =
            (bytes + bytes / 4).min(self.max_buffer_bytes).div_ceil(MIN_BUFFER_BYTES) * MIN_BUFFER_BYTES;
        // The old buffer goes first, because both at once may not fit.
        self.buffers.remove(&id);
        let buffer = device.buffer(id.name(), size, id.usage())?;
        self.buffers.insert(id, KeptBuffer { buffer, used: bytes });
        self.generation += 1;
        Ok(true)
    }

    /// Makes a buffer that kernels bind at least `bytes` long, see [`Storage::ensure`].
    pub(super) fn ensure_bound(
        &mut self,
        device: &GpuDevice,
        buffer: Buffer,
        bytes: u64,
    ) -> Result<bool, GpuError> {
        self.ensure(device, BufferId::Bound(buffer), bytes)
    }

    /// Returns a buffer that [`Storage::ensure`] has made.
    pub(super) fn get(&self, id: BufferId) -> &wgpu::Buffer {
        &self.buffers[&id].buffer
    }

    /// Returns a buffer that kernels bind.
    pub(super) fn bound(&self, buffer: Buffer) -> &wgpu::Buffer {
        self.get(BufferId::Bound(buffer))
    }

    /// Returns the size of a buffer in bytes, or 0 if there is none.
    pub(super) fn size(&self, id: BufferId) -> u64 {
        self.buffers.get(&id).map_or(0, |kept| kept.buffer.size())
    }

    /// Returns the bytes of all buffers.
    pub(super) fn bytes(&self) -> u64 {
        self.buffers.values().map(|kept| kept.buffer.size()).sum()
    }

    /// Notes the end of a call. Once in a window frees buffers that were hardly used, and returns true.
    pub(super) fn end_call(&mut self) -> bool {
        self.calls += 1;
        if self.calls < CALLS_PER_WINDOW {
            return false;
        }
        self.calls = 0;
        let before = self.buffers.len();
        self.buffers.retain(|_, kept| kept.buffer.size() <= (4 * kept.used).max(ALWAYS_KEPT_BYTES));
        self.buffers.values_mut().for_each(|kept| kept.used = 0);
        self.generation += u64::from(self.buffers.len() < before);
        true
    }
}
