//! The buffers of a finder on the device: they grow when they must and shrink when they may.

use super::GpuError;
use super::engine::Engine;
use crate::config::GpuOptions;
use std::collections::HashMap;

/// Calls after which a buffer that was never a quarter full gives its memory back.
const WINDOW: u32 = 64;

/// Smallest buffer.
const SMALLEST: u64 = 256;

#[derive(Debug)]
struct Slab {
    buffer: wgpu::Buffer,
    /// Most bytes used in one call of this window.
    used: u64,
}

/// Buffers by name.
#[derive(Debug)]
pub(super) struct Storage {
    slabs: HashMap<&'static str, Slab>,
    /// Counts the changes of any buffer: bind groups made before are stale.
    pub(super) generation: u64,
    calls: u32,
    most_bytes: u64,
}

impl Storage {
    pub(super) fn new(engine: &Engine, options: &GpuOptions) -> Self {
        Self { slabs: HashMap::new(), generation: 0, calls: 0, most_bytes: engine.most_bytes(options) }
    }

    /// Largest buffer.
    pub(super) fn most_bytes(&self) -> u64 {
        self.most_bytes
    }

    /// Makes a buffer at least `bytes` long; what was in it is lost if it had to grow. Returns whether
    /// it had.
    pub(super) fn ensure(
        &mut self,
        engine: &Engine,
        name: &'static str,
        bytes: u64,
    ) -> Result<bool, GpuError> {
        if bytes > self.most_bytes {
            return Err(GpuError::TooLarge { what: name, bytes, limit: self.most_bytes });
        }
        let bytes = bytes.max(SMALLEST);
        if let Some(slab) = self.slabs.get_mut(name).filter(|slab| slab.buffer.size() >= bytes) {
            slab.used = slab.used.max(bytes);
            return Ok(false);
        }
        // A quarter more, so that a scene that grows does not allocate with every call.
        let size = (bytes + bytes / 4).min(self.most_bytes).div_ceil(SMALLEST) * SMALLEST;
        // The old one first: both at once may not fit.
        self.slabs.remove(name);
        let buffer = engine.buffer(name, size, usage(name))?;
        self.slabs.insert(name, Slab { buffer, used: bytes });
        self.generation += 1;
        Ok(true)
    }

    /// A buffer that [`Storage::ensure`] has made.
    pub(super) fn get(&self, name: &str) -> &wgpu::Buffer {
        &self.slabs[name].buffer
    }

    pub(super) fn size(&self, name: &str) -> u64 {
        self.slabs.get(name).map_or(0, |slab| slab.buffer.size())
    }

    /// Bytes of all buffers.
    pub(super) fn bytes(&self) -> u64 {
        self.slabs.values().map(|slab| slab.buffer.size()).sum()
    }

    /// To be called after each call: gives back, now and then, what has not been needed for long. True
    /// when it did so.
    pub(super) fn end_call(&mut self) -> bool {
        self.calls += 1;
        if self.calls < WINDOW {
            return false;
        }
        self.calls = 0;
        let before = self.slabs.len();
        self.slabs.retain(|_, slab| slab.buffer.size() <= (4 * slab.used).max(1 << 16));
        self.slabs.values_mut().for_each(|slab| slab.used = 0);
        self.generation += u64::from(self.slabs.len() < before);
        true
    }
}

/// What a buffer is for, by its name; every buffer can be bound, written and read back, but for those
/// that the host reads.
fn usage(name: &str) -> wgpu::BufferUsages {
    use wgpu::BufferUsages as Usage;
    match name {
        "params" | "chunk0" | "chunk1" => Usage::UNIFORM | Usage::COPY_DST,
        "staging0" | "staging1" | "table" => Usage::MAP_READ | Usage::COPY_DST,
        "dispatches" => Usage::STORAGE | Usage::INDIRECT,
        _ => Usage::STORAGE | Usage::COPY_DST | Usage::COPY_SRC,
    }
}
