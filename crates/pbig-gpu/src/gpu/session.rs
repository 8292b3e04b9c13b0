//! The state of a finder on a device, and what happens before a search: upload, plan, choice of the coding.

use super::coding::{Counted, bits_that_fit};
use super::declined::Declined;
use super::device::GpuDevice;
use super::error::Failure;
use super::job::{Input, Job};
use super::kept_plan::KeptPlan;
use super::readback::Timestamps;
use super::sink::Sink;
use super::storage::Storage;
use super::upload::UploadCache;
use super::{GpuError, GpuPlan};
use crate::decode::pair_count;
use crate::layout::{BITS, COUNTED, Counters, DeviceBox, FILTERED, LANES, Params, RAW, SORTED};
use crate::pbig::Summary;
use crate::policy::WIDEST_ITEM;
use crate::policy::allowed_by_wish;
use crate::{Coding, GpuOptions};
use pbig_core::{DeviceFound, DeviceReport, internal::Clock};
use std::sync::Arc;
use std::time::Duration;

/// Maximum number of words of output per changed box that are prefetched: four pairs. The output of a burst of pairs
/// says nothing about an update with few changes.
const PREFETCHED_WORDS_PER_CHANGE: u64 = 8;

/// Number of boxes by which lists of the first call are longer than for the boxes there are: few boxes may need many entries.
const EXTRA_BOXES: u64 = 4096;

/// Maximum number of cells of a plan.
const MAX_CELLS: u64 = 1 << 28;

/// Lengths of lists and output that earlier calls needed.
#[derive(Debug, Default)]
pub(super) struct Sizes {
    /// Lengths of the lists of the map in the last call.
    pub(super) lists: Counters,
    /// Expected words of output of a chunk: these are prefetched.
    pub(super) expected_words: u64,
    /// Maximum number of words of a chunk of this job.
    pub(super) max_words: u64,
    pub(super) word_capacity: u64,
}

/// The state of a finder on a device, kept from call to call.
#[derive(Debug)]
pub(super) struct Session {
    pub(super) device: Arc<GpuDevice>,
    pub(super) options: GpuOptions,
    pub(super) storage: Storage,
    pub(super) uploaded: UploadCache,
    pub(super) timestamps: [Option<Timestamps>; 2],
    pub(super) sizes: Sizes,
    /// Counts of the last search.
    pub(super) counted: Counted,
    pub(super) plan: Option<KeptPlan>,
    /// Factor on the cell size: smaller while cells hold too many boxes.
    pub(super) cell_factor: f32,
    /// Number of boxes of a set that needed parts, and of its parts, until the next window of [`Storage::end_call`].
    pub(super) split: Option<(usize, usize)>,
    pub(super) declined: Declined,
    /// This job searches for changes instead of all overlaps.
    pub(super) finds_changes: bool,
    /// Changes were uploaded that no submission has applied yet.
    pub(super) has_pending_changes: bool,
    /// Entries of this job's map, once fetched.
    pub(super) table: Option<Vec<u32>>,
    /// Time of the host in this job, recording and submitting.
    pub(super) recording: Duration,
}

impl Session {
    pub(super) fn new(device: Arc<GpuDevice>, options: &GpuOptions) -> Result<Self, GpuError> {
        Ok(Self {
            options: *options,
            storage: Storage::new(device.clone(), options),
            uploaded: UploadCache::default(),
            timestamps: [Timestamps::new(&device, options)?, Timestamps::new(&device, options)?],
            sizes: Sizes::default(),
            counted: Counted::default(),
            plan: None,
            cell_factor: 1.0,
            split: None,
            declined: Declined::default(),
            finds_changes: false,
            has_pending_changes: false,
            table: None,
            recording: Duration::ZERO,
            device,
        })
    }

    /// Notes the end of a call, which is one job or several. Makes the cells of the next search finer if these held far
    /// too many boxes, coarser if they were nearly empty.
    pub(super) fn end_call(&mut self, found: &DeviceFound, kept: u64) {
        const TOO_FULL: u64 = 64;
        const NEARLY_EMPTY: u64 = 4;
        if self.storage.end_call() {
            self.split = None;
        }
        if found.plan.is_none() {
            return;
        }
        let pairs = (found.pairs.len() + found.ended.len()) as u64;
        let useful_tests = (u64::from(found.valid) + kept.max(pairs)).max(1);
        let factor = match found.checks.made / useful_tests {
            0..NEARLY_EMPTY => (self.cell_factor * 2.0).min(1.0),
            NEARLY_EMPTY..=TOO_FULL => self.cell_factor,
            _ => (self.cell_factor * 0.5).max(1.0 / 64.0),
        };
        if factor != self.cell_factor {
            (self.cell_factor, self.plan) = (factor, None);
        }
    }

    pub(super) async fn run(&mut self, job: &Job<'_>, sink: &mut Sink) -> Result<(), Failure> {
        let params = self.upload(job, &mut sink.found.report)?;
        let result = self.search(job, params, sink).await;
        sink.found.valid = if job.needs_grid { self.sizes.lists.valid } else { job.valid() };
        if !self.options.count_tests {
            sink.found.checks.made += if job.needs_grid {
                u64::from(LANES) * u64::from(self.sizes.lists.tests)
            } else {
                pair_count(params.boxes)
            };
        }
        let report = &mut sink.found.report;
        if job.needs_grid {
            report.cells += self.plan.as_ref().map_or(0, |kept| u64::from(kept.plan.cells));
            report.entries += u64::from(self.sizes.lists.entries);
        }
        report.device_bytes = report.device_bytes.max(self.storage.bytes());
        report.record += std::mem::take(&mut self.recording);
        result
    }

    /// Uploads the boxes of a job. Returns its parameters, without grid and capacities.
    fn upload(&mut self, job: &Job<'_>, report: &mut DeviceReport) -> Result<Params, GpuError> {
        self.table = None;
        self.sizes.expected_words = std::mem::take(&mut self.sizes.max_words);
        let is_first = self.sizes.expected_words == 0 && self.sizes.lists == Counters::default();
        if is_first && self.options.first_bytes > 0 {
            // A pair a box.
            self.sizes.expected_words = 2 * job.boxes.len() as u64;
        }
        self.sizes.word_capacity = self.sizes.expected_words;
        self.finds_changes = !matches!(job.input, Input::Boxes);
        self.storage.bytes_sent = 0;
        let mut params = self.params(job);
        let mut clock = Clock::start();
        let (storage, uploaded, filters) = (&mut self.storage, &mut self.uploaded, job.filters);
        match job.input {
            Input::Boxes if job.needs_grid => {
                params.flags |= RAW;
                uploaded.upload_all(storage, job.boxes, filters, &mut params)?;
            }
            Input::Boxes => {
                let boxes: Vec<_> = job.boxes.iter().map(DeviceBox::new).collect();
                uploaded.upload_all(storage, &boxes, filters, &mut params)?;
            }
            Input::Motions(motions) => uploaded.upload_all(storage, motions, filters, &mut params)?,
            Input::Changes(changes) => {
                let most = PREFETCHED_WORDS_PER_CHANGE * changes.changed.len() as u64;
                self.sizes.expected_words = self.sizes.expected_words.min(most);
                uploaded.upload_changes(storage, changes, &mut params)?;
            }
        };
        report.uploaded += self.storage.bytes_sent;
        report.upload += clock.lap();
        self.has_pending_changes = params.known > 0;
        Ok(params)
    }

    /// Returns the bytes of a list whose length no call has told.
    pub(super) fn first_bytes(&self, boxes: u32) -> u64 {
        self.options.first_bytes * (u64::from(boxes) + EXTRA_BOXES)
    }

    fn params(&self, job: &Job<'_>) -> Params {
        let flags = [(job.filters.is_some(), FILTERED), (self.options.count_tests, COUNTED)];
        Params {
            small_cell: self.options.small_cell.clamp(1, LANES),
            // The output of a work item must fit the smallest buffer.
            columns: if self.storage.max_buffer_bytes < 8 << 20 { 1 } else { WIDEST_ITEM },
            flags: flags.into_iter().filter(|(is_set, _)| *is_set).map(|(_, flag)| flag).sum(),
            split: job.split,
            ..Params::default()
        }
    }

    /// Adds to the parameters of a job what a plan and the coding of the output set.
    pub(super) async fn with_plan(
        &mut self,
        job: &Job<'_>,
        mut params: Params,
        report: &mut DeviceReport,
    ) -> Result<Params, GpuError> {
        if job.needs_grid {
            let allowed = allowed_by_wish(self.options.boxes_per_cell);
            let kept = self.plan(job, &params, report).await?;
            check_entries(kept, params.boxes)?;
            params = kept.plan.add_to(params);
            params.most_tests = kept.most_tests(params.boxes, allowed);
        }
        params.flags |= self.coding_flags(job, &params);
        Ok(params)
    }

    /// Returns the plan: the kept one, or one for the boxes that the device has now.
    async fn plan(
        &mut self,
        job: &Job<'_>,
        params: &Params,
        report: &mut DeviceReport,
    ) -> Result<&KeptPlan, GpuError> {
        let plan = match self.plan.take_if(|kept| kept.suits(job.boxes.len())) {
            Some(kept) => kept,
            None => {
                let classes = self.measure(params, report).await?;
                let mut clock = Clock::start();
                let summary = Summary::of_classes(classes, job.boxes);
                let plan = KeptPlan::new(self.plan_for(&summary), params.boxes, summary.pairs());
                report.plan += clock.lap();
                plan
            }
        };
        Ok(self.plan.insert(plan))
    }

    fn plan_for(&self, summary: &Summary) -> GpuPlan {
        let max_cells = (self.storage.max_buffer_bytes / 8).min(MAX_CELLS) as u32;
        GpuPlan::new(summary, &self.options, self.cell_factor, max_cells)
    }

    /// Returns the flags of the coding: plain pairs where the device sorts, and for changes. These are rarely so many that
    /// records or bits are smaller, and need a mark.
    fn coding_flags(&self, job: &Job<'_>, params: &Params) -> u32 {
        let (has_grid, most) = (params.levels > 0, self.storage.max_buffer_bytes);
        let flags = match self.options.coding {
            _ if self.finds_changes => 0,
            // One bit a pair fits the smallest buffer.
            _ if !has_grid && self.sizes.word_capacity > most / 4 => BITS,
            Coding::Auto if job.is_sorted && has_grid => 0,
            Coding::Auto if job.is_sorted => bits_that_fit(params, most),
            wanted => self.counted.flag(wanted, params),
        };
        if flags == 0 && has_grid && job.is_sorted { SORTED } else { flags }
    }
}

/// Returns an error if 32 bits might not count the entries of this number of boxes: up to 4 x 4 x 4 in each level but the last.
fn check_entries(kept: &KeptPlan, boxes: u32) -> Result<(), GpuError> {
    let entries = u64::from(boxes) * (64 * (kept.plan.levels.len() as u64 - 1) + 1);
    let limit = u64::from(u32::MAX);
    if entries > limit { Err(GpuError::TooLarge { what: "entries", bytes: entries, limit }) } else { Ok(()) }
}
