//! The state of a finder on a device, and what happens before a search: upload, plan, choice of the coding.

use super::GpuError;
use super::error::Failure;
use super::gpu_device::GpuDevice;
use super::job::Job;
use super::kept_plan::KeptPlan;
use super::readback::Timestamps;
use super::sink::Sink;
use super::storage::{Storage, Upload};
use crate::GpuOptions;
use crate::decode::pair_count;
use crate::layout::{COUNTED, Counters, FILTERED, LANES, Params};
use crate::policy::WIDEST_ITEM;
use pbig_core::internal::Clock;
use pbig_shaders::Buffer;
use std::sync::Arc;

/// Number of boxes by which lists of the first call are longer than for the boxes there are: few boxes may need many entries.
const EXTRA_BOXES: u64 = 4096;

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
    /// Timestamps, if kernels are timed. Submissions use them one after the other.
    pub(super) timestamps: Option<Timestamps>,
    pub(super) sizes: Sizes,
    pub(super) plan: Option<KeptPlan>,
    /// Factor on the cells of a new plan: below 1 if this job's first plan made too many tests.
    pub(super) cell_factor: f32,
    /// Number of boxes of a set that needed parts, and of its parts, until the next window of [`Storage::end_call`].
    pub(super) split: Option<(usize, usize)>,
    /// The call's ids of this job's boxes, if it is a part of the call.
    pub(super) part_ids: Option<Vec<u32>>,
    /// Entries of this job's map, once fetched.
    pub(super) table: Option<Vec<u32>>,
    /// Parameters of this job.
    pub(super) params: Params,
    /// Pairs and counts of this call so far.
    pub(super) sink: Sink,
}

impl Session {
    pub(super) fn new(device: Arc<GpuDevice>, options: &GpuOptions) -> Result<Self, GpuError> {
        Ok(Self {
            options: *options,
            storage: Storage::new(device.clone(), options),
            timestamps: Timestamps::new(&device, options)?,
            sizes: Sizes::default(),
            plan: None,
            cell_factor: 1.0,
            split: None,
            part_ids: None,
            table: None,
            params: Params::default(),
            sink: Sink::default(),
            device,
        })
    }

    /// Notes the end of a call, which is one job or several.
    pub(super) fn end_call(&mut self) {
        if self.storage.end_call() {
            self.split = None;
        }
    }

    /// Forgets what a call without an answer has left: a plan that no search has used was made for its boxes.
    pub(super) fn forget_call(&mut self) {
        self.sink = Sink::default();
        self.plan.take_if(|kept| kept.is_new());
    }

    /// Searches the boxes of a job, and adds its pairs and counts to those of the call.
    pub(super) async fn run(&mut self, job: &Job<'_>) -> Result<(), Failure> {
        self.upload(job)?;
        let result = self.search(job).await;
        let (found, lists) = (&mut self.sink.found, &self.sizes.lists);
        let tests = if job.needs_grid(&self.options) {
            found.valid = lists.valid;
            found.report.cells += self.plan.as_ref().map_or(0, |kept| u64::from(kept.plan.cells));
            found.report.entries += u64::from(lists.entries);
            u64::from(LANES) * u64::from(lists.tests)
        } else {
            found.valid = job.valid();
            pair_count(self.params.boxes)
        };
        if !self.options.count_tests {
            found.checks.made += tests;
        }
        found.report.device_bytes = found.report.device_bytes.max(self.storage.bytes());
        result
    }

    /// Uploads the boxes of a job, and sets its parameters, without grid and capacities.
    fn upload(&mut self, job: &Job<'_>) -> Result<(), GpuError> {
        self.table = None;
        self.sizes.expected_words = std::mem::take(&mut self.sizes.max_words);
        let is_first = self.sizes.expected_words == 0 && self.sizes.lists == Counters::default();
        if is_first && self.options.first_bytes > 0 {
            // A pair a box.
            self.sizes.expected_words = 2 * job.boxes.len() as u64;
        }
        self.sizes.word_capacity = self.sizes.expected_words;
        let (boxes, has_filters) = (job.boxes.len() as u32, job.filters.is_some());
        self.params = params_of(&self.options, &self.storage, boxes, has_filters, job.split.unwrap_or(0));
        let mut clock = Clock::start();
        // A failed upload leaves its bytes.
        self.storage.bytes_sent = 0;
        self.storage.upload(&[
            // All boxes: to find those that moved, the host would have to read a copy of the last call's, too.
            Upload::new(Buffer::Boxes, job.boxes),
            Upload::new(Buffer::Filters, job.filters.unwrap_or(&[])),
        ])?;
        let report = &mut self.sink.found.report;
        report.uploaded += std::mem::take(&mut self.storage.bytes_sent);
        report.upload += clock.lap();
        Ok(())
    }

    /// Adds to the parameters what a plan and the coding of the output set.
    pub(super) fn add_plan(&mut self, job: &Job<'_>) -> Result<(), GpuError> {
        if job.needs_grid(&self.options) {
            self.plan.take_if(|kept| !kept.suits(job.boxes.len()));
            let (options, factor, max_bytes) =
                (&self.options, self.cell_factor, self.storage.max_buffer_bytes);
            let report = &mut self.sink.found.report;
            let kept = self.plan.get_or_insert_with(|| {
                let mut clock = Clock::start();
                let plan = KeptPlan::new(job.boxes, (options, factor), max_bytes);
                report.plan += clock.lap();
                plan
            });
            check_entries(kept, self.params.boxes)?;
            self.params = kept.plan.add_to(self.params);
            self.params.most_tests = kept.most_tests(self.params.boxes, options.boxes_per_cell);
        }
        self.params.flags |= self.coding_flag(job);
        Ok(())
    }
}

/// Returns the bytes of a list whose length no call has told.
pub(super) fn first_bytes(options: &GpuOptions, boxes: u32) -> u64 {
    options.first_bytes * (u64::from(boxes) + EXTRA_BOXES)
}

/// Returns the parameters of a call, without grid and capacities.
pub(super) fn params_of(
    options: &GpuOptions,
    storage: &Storage,
    boxes: u32,
    has_filters: bool,
    split: u32,
) -> Params {
    Params {
        boxes,
        small_cell: options.small_cell.clamp(1, LANES),
        // The output of a work item must fit the smallest buffer.
        columns: if storage.max_buffer_bytes < 8 << 20 { 1 } else { WIDEST_ITEM },
        flags: FILTERED * u32::from(has_filters) + COUNTED * u32::from(options.count_tests),
        split,
        ..Params::default()
    }
}

/// Returns an error if 32 bits might not count the entries of this number of boxes: up to 4 x 4 x 4 in each level but the last.
pub(super) fn check_entries(kept: &KeptPlan, boxes: u32) -> Result<(), GpuError> {
    let entries = u64::from(boxes) * (64 * (kept.plan.levels.len() as u64 - 1) + 1);
    let limit = u64::from(u32::MAX);
    if entries > limit { Err(GpuError::TooLarge { what: "entries", bytes: entries, limit }) } else { Ok(()) }
}
