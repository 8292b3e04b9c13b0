//! Searches whose boxes and pairs stay on the device: nothing is sent, awaited or read back but the counts of earlier calls.
//!
//! The host cannot know what a call will find. It takes plan and lengths from earlier calls, whose counts come home on their own. A
//! wrong plan or length costs time, or the call says that it is not complete.

use super::error::{GpuError, Result};
use super::forecast::Forecast;
use super::gpu_device::GpuDevice;
use super::passes::{self, Groups, Step};
use super::reports::{Reports, SUMMARY_BYTES};
use super::storage::Storage;
use crate::GpuOptions;
use crate::layout::{BOX_BYTES, Chunk, Counters, FILTER_BYTES, LANES, PairCount, Params, wide};
use pbig_shaders::{self as shaders, Buffer};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::Arc;
use wgpu::CommandEncoder;

/// Boxes in a buffer of the caller's device, for [`super::GpuFinder::record_pairs`].
#[derive(Clone, Copy, Debug)]
pub struct DeviceBoxes<'a> {
    /// The boxes: six `f32` each, the least x, y and z, then the greatest. A box that is not valid has no pairs. The usage
    /// includes `COPY_SRC`.
    pub buffer: &'a wgpu::Buffer,
    /// Bytes before the first box, a multiple of 4.
    pub offset: u64,
    /// Number of boxes.
    pub count: u32,
    /// The filters, a [`pbig_core::ProxyFilter`] of 16 bytes for each box: a buffer whose usage includes `COPY_SRC`, and the bytes before the first
    /// filter, a multiple of 4. None if all boxes may pair.
    pub filters: Option<(&'a wgpu::Buffer, u64)>,
}

/// A list of the caller: the buffer that gets a copy, the caller's buffer, the first byte and the number of bytes there.
type List<'a> = (Buffer, &'a wgpu::Buffer, u64, u64);

impl<'a> DeviceBoxes<'a> {
    fn lists(&self) -> impl Iterator<Item = List<'a>> {
        let count = u64::from(self.count);
        let boxes = (Buffer::Boxes, self.buffer, self.offset, BOX_BYTES * count);
        let of_filters = move |(buffer, offset)| (Buffer::Filters, buffer, offset, FILTER_BYTES * count);
        [boxes].into_iter().chain(self.filters.map(of_filters))
    }
}

/// The pairs of a search, on the device. The next search of the finder overwrites both buffers, or makes larger ones.
#[derive(Clone, Debug, PartialEq)]
pub struct DevicePairs {
    /// The pairs, in no order: two `u32` each, the smaller index first. The usage includes `STORAGE` and `COPY_SRC`.
    pub pairs: wgpu::Buffer,
    /// A [`PairCount`]. The usage includes `STORAGE`, `INDIRECT` and `COPY_SRC`.
    pub count: wgpu::Buffer,
}

/// The state of a finder for boxes that live on its device.
#[derive(Debug)]
pub(super) struct Resident {
    pub(super) storage: Storage,
    reports: Reports,
    forecast: Forecast,
    /// The uniforms of the last call.
    uniforms: Option<(Params, Chunk)>,
    /// Hash of the caller's buffers that were used last.
    used: Option<u64>,
}

impl Resident {
    pub(super) fn new(device: &Arc<GpuDevice>, options: &GpuOptions) -> Self {
        Self {
            storage: Storage::new(device, options),
            reports: Reports::default(),
            forecast: Forecast::default(),
            uniforms: None,
            used: None,
        }
    }

    /// Records a search. Submits nothing, and waits for nothing.
    pub(super) fn record(
        &mut self,
        encoder: &mut CommandEncoder,
        boxes: &DeviceBoxes<'_>,
    ) -> Result<DevicePairs> {
        self.storage.check_boxes(boxes.count.into())?;
        boxes.lists().try_for_each(check_list)?;
        self.probe(boxes)?;
        self.learn();
        let params = self.prepare(boxes).inspect_err(|error| {
            self.forecast.note_error(error, &mut self.storage);
            self.uniforms = None;
        })?;
        // Copies, as bindings begin at multiples of more than a box.
        for (to, from, offset, bytes) in boxes.lists().filter(|(.., bytes)| *bytes > 0) {
            encoder.copy_buffer_to_buffer(from, offset, self.storage.get(to), 0, bytes);
        }
        let measures = self.forecast.needs_plan(&self.storage.options, params.boxes);
        self.record_steps(encoder, &params, measures);
        self.reports.record(&self.storage, encoder, &params, measures);
        let [pairs, count] = [Buffer::Out, Buffer::PairCount].map(|id| self.storage.get(id).clone());
        self.storage.end_call();
        Ok(DevicePairs { pairs, count })
    }

    /// Copies from the caller's buffers in commands that are thrown away: wgpu checks them when they are finished, and an encoder of
    /// the caller is finished where nobody asks what is wrong.
    fn probe(&mut self, boxes: &DeviceBoxes<'_>) -> Result<()> {
        let mut hasher = DefaultHasher::new();
        boxes.lists().for_each(|(_, from, ..)| from.hash(&mut hasher));
        let hash = Some(hasher.finish());
        if self.used == hash {
            return Ok(());
        }
        self.storage.ensure(Buffer::Counters, size_of::<Counters>() as u64)?;
        let (device, to) = (&self.storage.device, self.storage.get(Buffer::Counters));
        device.watch_now(|| {
            let mut encoder = device.encoder();
            for (_, from, ..) in boxes.lists() {
                encoder.copy_buffer_to_buffer(from, 0, to, 0, from.size().min(4));
            }
            encoder.finish();
            Ok(())
        })?;
        self.used = hash;
        Ok(())
    }

    /// Takes the counts of earlier calls into account.
    fn learn(&mut self) {
        let Self { storage, reports, forecast, .. } = self;
        reports.take(&storage.device, |params, counts, summary| {
            if forecast.learn(params, &counts.counters) {
                forecast.words = wide(counts.totals.words);
            }
            if let Some(summary) = summary.filter(|_| forecast.is_current(params)) {
                forecast.make_plan(&summary, params.boxes, storage);
            }
        });
    }

    /// Makes the buffers of a call, and returns its parameters.
    fn prepare(&mut self, boxes: &DeviceBoxes<'_>) -> Result<Params> {
        let (storage, count) = (&mut self.storage, boxes.count);
        let params = self.forecast.params(storage, count, boxes.filters.is_some())?;
        // Kernels bind filters even if there are none.
        storage.ensure(Buffer::Filters, 0)?;
        boxes.lists().try_for_each(|(to, _, _, bytes)| storage.ensure(to, bytes))?;
        storage.ensure(Buffer::Summary, SUMMARY_BYTES)?;
        storage.ensure(Buffer::PairCount, size_of::<PairCount>() as u64)?;
        self.set_uniforms(&params)?;
        Ok(params)
    }

    /// Makes the uniforms of a call, unless they are those of the last one. Commands that are recorded read them later, so they never
    /// change.
    fn set_uniforms(&mut self, params: &Params) -> Result<()> {
        let all = Chunk { small_items: u32::MAX, large_items: u32::MAX, ..Chunk::default() };
        let chunk = self.storage.with_room(all, u64::MAX);
        if self.uniforms != Some((*params, chunk)) {
            self.storage.replace(Buffer::Params, params)?;
            self.storage.replace(Buffer::Chunk, &chunk)?;
            self.uniforms = Some((*params, chunk));
        }
        Ok(())
    }

    fn record_steps(&mut self, encoder: &mut CommandEncoder, params: &Params, measures: bool) {
        let mut steps = if params.levels > 0 {
            passes::map_and_check(params)
        } else {
            [&passes::check_all(params)[..], &[passes::CLEAR_COUNTERS]].concat()
        };
        if measures {
            steps.push(Step::Clear(Buffer::Summary, SUMMARY_BYTES));
            steps.push(Step::Run(&shaders::MEASURE, Groups::Direct(params.boxes.div_ceil(LANES))));
        }
        steps.push(Step::Run(&shaders::CONCLUDE, Groups::Direct(1)));
        passes::record(&mut self.storage, encoder, &steps, None);
    }
}

/// Returns an error unless a list can be copied.
fn check_list((list, buffer, offset, bytes): List<'_>) -> Result<()> {
    let (what, size, usage) = (list.name(), buffer.size(), buffer.usage());
    let fault = if !usage.contains(wgpu::BufferUsages::COPY_SRC) {
        format!("the buffer of {what} has the usage {usage:?}, but it needs COPY_SRC")
    } else if !offset.is_multiple_of(wgpu::COPY_BUFFER_ALIGNMENT) {
        format!("the {what} begin at byte {offset}, which is no multiple of 4")
    } else if offset.checked_add(bytes).is_none_or(|end| end > size) {
        format!("{bytes} bytes of {what} from byte {offset} on are wanted, but their buffer has {size}")
    } else {
        return Ok(());
    };
    Err(GpuError::Argument(fault))
}
