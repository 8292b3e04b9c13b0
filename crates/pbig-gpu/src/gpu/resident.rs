//! Searches whose boxes and pairs stay on the device: nothing is sent, awaited or read back but the counts of earlier calls.
//!
//! The host cannot know what a call will find. It takes plan and lengths from earlier calls, whose counts come home on their own. A
//! wrong plan or length costs time, or the call says that it is not complete.

use super::GpuError;
use super::forecast::{Forecast, needs_grid};
use super::gpu_device::GpuDevice;
use super::kept_plan::KeptPlan;
use super::passes::{self, Groups, Recording, Step};
use super::reports::{Learned, Reports};
use super::storage::Storage;
use crate::GpuOptions;
use crate::layout::{Chunk, Counters, DeviceBox, LANES, PairCount, Params, SUMMARY_WORDS, UNPLANNED, wide};
use pbig_core::ProxyFilter;
use pbig_shaders::{self as shaders, Buffer};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::Arc;

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
    /// The filters, a [`ProxyFilter`] of 16 bytes for each box: a buffer whose usage includes `COPY_SRC`, and the bytes before the first
    /// filter, a multiple of 4. None if all boxes may pair.
    pub filters: Option<(&'a wgpu::Buffer, u64)>,
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
    options: GpuOptions,
    storage: Storage,
    reports: Reports,
    forecast: Forecast,
    /// Number of plans so far: a report of an earlier one says nothing of the present one.
    plans: u32,
    /// The boxes have outgrown the plan, or there is none: the next call measures them.
    wants_measure: bool,
    /// The uniforms of the last call.
    uniforms: Option<(Params, Chunk)>,
    /// Hash of the caller's buffers that were used last.
    used: Option<u64>,
}

impl Resident {
    pub(super) fn new(device: &Arc<GpuDevice>, options: &GpuOptions) -> Self {
        Self {
            options: *options,
            storage: Storage::new(device.clone(), options),
            reports: Reports::default(),
            forecast: Forecast::default(),
            plans: 0,
            wants_measure: true,
            uniforms: None,
            used: None,
        }
    }

    /// Returns true if this was made for a device and options.
    pub(super) fn suits(&self, device: &Arc<GpuDevice>, options: &GpuOptions) -> bool {
        Arc::ptr_eq(&self.storage.device, device) && self.options == *options
    }

    /// Records a search. Submits nothing, and waits for nothing.
    pub(super) fn record(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        boxes: &DeviceBoxes<'_>,
    ) -> Result<DevicePairs, GpuError> {
        check_boxes(boxes, self.storage.max_boxes())?;
        self.probe(boxes)?;
        let learned = self.reports.take(&self.storage.device);
        learned.into_iter().for_each(|learned| self.learn(learned));
        let prepared = self.prepare(boxes);
        if prepared.is_err() {
            self.forecast.forget_lengths(&mut self.storage);
            self.uniforms = None;
        }
        let params = prepared?;
        self.copy_boxes(encoder, boxes);
        self.record_steps(encoder, &params);
        self.record_report(encoder, &params);
        let [pairs, count] = [Buffer::Out, Buffer::PairCount].map(|id| self.storage.get(id).clone());
        self.storage.end_call();
        Ok(DevicePairs { pairs, count })
    }

    /// Copies from the caller's buffers in commands that are thrown away: wgpu checks them when they are finished, and an encoder of
    /// the caller is finished where nobody asks what is wrong.
    fn probe(&mut self, boxes: &DeviceBoxes<'_>) -> Result<(), GpuError> {
        let mut hasher = DefaultHasher::new();
        (boxes.buffer, boxes.filters.map(|(buffer, _)| buffer)).hash(&mut hasher);
        let hash = Some(hasher.finish());
        if self.used == hash {
            return Ok(());
        }
        let device = self.storage.device.clone();
        self.storage.ensure(Buffer::Counters, size_of::<Counters>() as u64)?;
        let to = self.storage.get(Buffer::Counters);
        device.watch_now(|| {
            let mut encoder = device.encoder();
            for (from, _) in [(boxes.buffer, 0)].into_iter().chain(boxes.filters) {
                encoder.copy_buffer_to_buffer(from, 0, to, 0, from.size().min(4));
            }
            encoder.finish();
            Ok(())
        })?;
        self.used = hash;
        Ok(())
    }

    /// Takes the counts of an earlier call into account, unless there is another plan since.
    fn learn(&mut self, learned: Learned) {
        let Learned { counts, summary, boxes, plan } = learned;
        let needs_plan = needs_grid(&self.options, boxes);
        if needs_plan && plan != self.plans {
            return;
        }
        // Without room for the lists nothing was checked. The number of pairs does not depend on the plan.
        let words = wide(counts.totals.words);
        let forecast = &mut self.forecast;
        forecast.words = if words > 0 { words } else { forecast.words };
        if let Some(summary) = summary {
            forecast.make_plan(&summary, boxes, &self.options, self.storage.max_buffer_bytes);
            (self.plans, self.wants_measure) = (self.plans + 1, false);
            return;
        }
        if let Some(kept) = forecast.plan.as_mut().filter(|_| needs_plan) {
            if kept.refuses(&counts.counters, boxes, self.options.boxes_per_cell) {
                return self.replan();
            }
            self.wants_measure |= kept.is_outgrown_after(&counts.counters);
        }
        if needs_plan {
            self.forecast.lists = counts.counters;
        }
    }

    /// Gives up a plan that makes too many tests. One that was made for these boxes is followed by one of finer cells.
    fn replan(&mut self) {
        let forecast = &mut self.forecast;
        let is_new = forecast.plan.as_ref().is_some_and(KeptPlan::is_new);
        if !self.wants_measure {
            forecast.is_finer = is_new && !forecast.is_finer;
        }
        self.wants_measure = true;
    }

    /// Makes the buffers of a call, and returns its parameters.
    fn prepare(&mut self, boxes: &DeviceBoxes<'_>) -> Result<Params, GpuError> {
        let (storage, options, count) = (&mut self.storage, &self.options, boxes.count);
        let params = self.forecast.params(storage, options, count, boxes.filters.is_some())?;
        let is_outgrown = |kept: &KeptPlan| params.levels > 0 && !kept.suits(count as usize);
        self.wants_measure |= self.forecast.plan.as_ref().is_some_and(is_outgrown);
        let sizes = [
            (Buffer::Boxes, BOX_BYTES * u64::from(count)),
            (Buffer::Filters, boxes.filters.map_or(0, |_| FILTER_BYTES * u64::from(count))),
            (Buffer::Summary, 4 * u64::from(SUMMARY_WORDS)),
            (Buffer::PairCount, size_of::<PairCount>() as u64),
        ];
        sizes.into_iter().try_for_each(|(buffer, bytes)| storage.ensure(buffer, bytes))?;
        self.set_uniforms(&params)?;
        Ok(params)
    }

    /// Makes the uniforms of a call, unless they are those of the last one. Commands that are recorded read them later, so they never
    /// change.
    fn set_uniforms(&mut self, params: &Params) -> Result<(), GpuError> {
        let all = Chunk { small_items: u32::MAX, large_items: u32::MAX, ..Chunk::default() };
        let chunk = self.storage.with_room(all, u64::MAX);
        if self.uniforms != Some((*params, chunk)) {
            self.storage.replace(Buffer::Params, params)?;
            self.storage.replace(Buffer::Chunk, &chunk)?;
            self.uniforms = Some((*params, chunk));
        }
        Ok(())
    }

    /// Copies the boxes, as bindings begin at multiples of more than a box.
    fn copy_boxes(&self, encoder: &mut wgpu::CommandEncoder, boxes: &DeviceBoxes<'_>) {
        let count = u64::from(boxes.count);
        let mut copy = |from, offset, to, bytes: u64| {
            if bytes > 0 {
                encoder.copy_buffer_to_buffer(from, offset, self.storage.get(to), 0, bytes);
            }
        };
        copy(boxes.buffer, boxes.offset, Buffer::Boxes, BOX_BYTES * count);
        if let Some((filters, offset)) = boxes.filters {
            copy(filters, offset, Buffer::Filters, FILTER_BYTES * count);
        }
    }

    fn record_steps(&mut self, encoder: &mut wgpu::CommandEncoder, params: &Params) {
        let mut steps = vec![Step::Clear(Buffer::Counters, size_of::<Counters>() as u64)];
        if params.levels > 0 {
            steps = passes::map_and_check(params);
        } else if params.flags & UNPLANNED == 0 {
            steps.extend(passes::check_all(params));
        } else {
            steps.push(passes::CLEAR_TOTALS);
        }
        if self.measures(params) {
            steps.push(Step::Clear(Buffer::Summary, 4 * u64::from(SUMMARY_WORDS)));
            steps.push(Step::Run(&shaders::MEASURE, Groups::Direct(params.boxes.div_ceil(LANES))));
        }
        steps.push(Step::Run(&shaders::CONCLUDE, Groups::Direct(1)));
        let (storage, is_balanced) = (&mut self.storage, self.options.load_balancing);
        Recording { storage, encoder, is_balanced, timer: None }.record(&steps);
    }

    /// Returns true if a call measures the boxes.
    fn measures(&self, params: &Params) -> bool {
        self.wants_measure && needs_grid(&self.options, params.boxes)
    }

    /// Lets the counts come home, where a later call finds them.
    fn record_report(&mut self, encoder: &mut wgpu::CommandEncoder, params: &Params) {
        let summary = self.measures(params).then(|| self.storage.get(Buffer::Summary));
        let [counters, totals] = [Buffer::Counters, Buffer::Totals].map(|id| self.storage.get(id));
        self.reports.record(
            &self.storage.device,
            encoder,
            (counters, totals, summary),
            (params.boxes, self.plans),
        );
    }
}

const BOX_BYTES: u64 = size_of::<DeviceBox>() as u64;
const FILTER_BYTES: u64 = size_of::<ProxyFilter>() as u64;

/// Returns an error if boxes or filters do not lie in their buffers, or are more than a search can have.
fn check_boxes(boxes: &DeviceBoxes<'_>, most: u64) -> Result<(), GpuError> {
    if u64::from(boxes.count) > most {
        let count = boxes.count;
        return Err(GpuError::Argument(format!(
            "{count} boxes, but the device or GpuOptions::max_bytes allows {most}"
        )));
    }
    check_range("boxes", boxes.buffer, boxes.offset, BOX_BYTES * u64::from(boxes.count))?;
    boxes.filters.map_or(Ok(()), |(buffer, offset)| {
        check_range("filters", buffer, offset, FILTER_BYTES * u64::from(boxes.count))
    })
}

/// Returns an error unless bytes of a buffer can be copied.
fn check_range(what: &str, buffer: &wgpu::Buffer, offset: u64, bytes: u64) -> Result<(), GpuError> {
    let (size, usage) = (buffer.size(), buffer.usage());
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
