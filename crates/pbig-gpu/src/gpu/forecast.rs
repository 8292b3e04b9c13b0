//! The forecast of a call, from the counts of earlier ones: its plan, and the lengths of its lists. A wrong plan costs time, a wrong
//! length a repetition.

use super::GpuError;
use super::kept_plan::{FINER_RETRY, KeptPlan};
use super::passes;
use super::storage::Storage;
use crate::GpuOptions;
use crate::layout::{COUNTED, Counters, FILTERED, LANES, Params, Totals, UNPLANNED};
use crate::pbig::Summary;
use crate::policy::WIDEST_ITEM;
use pbig_shaders::Buffer;

/// Number of boxes by which lists of the first call are longer than for the boxes there are: few boxes may need many entries.
const EXTRA_BOXES: u64 = 4096;

/// Maximum number of boxes whose pairs are all tested: the kernel counts in 32 bits, see `pair_index.wgsl`.
const MOST_ALL_PAIRS: u32 = 32_768;

/// The plan and the lengths that earlier calls have told.
#[derive(Debug, Default)]
pub(super) struct Forecast {
    pub(super) plan: Option<KeptPlan>,
    /// A new plan gets finer cells, because the last plan made too many tests for the boxes that it was made for.
    pub(super) is_finer: bool,
    /// Lengths of the lists of the last map.
    pub(super) lists: Counters,
    /// Words of pairs of the last call.
    pub(super) words: u64,
}

impl Forecast {
    /// Makes a plan for this number of boxes, on a device with buffers of at most this size.
    pub(super) fn make_plan(&mut self, summary: &Summary, boxes: u32, options: &GpuOptions, max_bytes: u64) {
        let cell_factor = if self.is_finer { FINER_RETRY } else { 1.0 };
        self.plan = Some(KeptPlan::new(summary, boxes, (options, cell_factor), max_bytes));
    }

    /// Forgets lengths that exceed a limit, and frees all buffers, which leave no room for other boxes.
    pub(super) fn forget_lengths(&mut self, storage: &mut Storage) {
        (self.lists, self.words) = Default::default();
        storage.free();
    }

    /// Makes the buffers of a call, and returns its parameters. Without a plan, only few boxes are searched.
    pub(super) fn params(
        &self,
        storage: &mut Storage,
        options: &GpuOptions,
        boxes: u32,
        has_filters: bool,
    ) -> Result<Params, GpuError> {
        let mut params = ungridded(storage, options, boxes, has_filters);
        let first_bytes = options.first_bytes * (u64::from(boxes) + EXTRA_BOXES);
        let first_bytes = first_bytes.min(storage.max_buffer_bytes);
        match &self.plan {
            _ if !needs_grid(options, boxes) => {}
            None => params.flags |= UNPLANNED,
            Some(kept) => {
                kept.check_entries(boxes)?;
                params = kept.plan.add_to(params);
                params.most_tests = kept.most_tests(boxes, options.boxes_per_cell);
                passes::make_buffers(storage, &mut params, &self.lists, first_bytes)?;
            }
        }
        storage.ensure(Buffer::Counters, size_of::<Counters>() as u64)?;
        storage.ensure(Buffer::Totals, size_of::<Totals>() as u64)?;
        storage.ensure(Buffer::Out, (4 * self.words).max(first_bytes))?;
        Ok(params)
    }
}

/// Returns true if not every pair is tested.
pub(super) fn needs_grid(options: &GpuOptions, boxes: u32) -> bool {
    boxes > options.all_pairs_up_to.clamp(1, MOST_ALL_PAIRS)
}

/// Returns the parameters of a call, without grid and capacities.
fn ungridded(storage: &Storage, options: &GpuOptions, boxes: u32, has_filters: bool) -> Params {
    Params {
        boxes,
        small_cell: options.small_cell.clamp(1, LANES),
        // The output of a work item must fit the smallest buffer.
        columns: if storage.max_buffer_bytes < 8 << 20 { 1 } else { WIDEST_ITEM },
        flags: FILTERED * u32::from(has_filters) + COUNTED * u32::from(options.count_tests),
        ..Params::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_boxes_have_a_grid_whatever_the_option() {
        let with = |all_pairs_up_to| GpuOptions { all_pairs_up_to, ..GpuOptions::DEFAULT };
        let first_grid = |options: GpuOptions| (0..70_000).find(|boxes| needs_grid(&options, *boxes));
        assert_eq!([0, 1, 1000, u32::MAX].map(|most| first_grid(with(most))), [2, 2, 1001, 32_769].map(Some));
    }
}
