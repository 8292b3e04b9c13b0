//! The forecast of a search, from the counts of earlier ones: its plan, and the lengths of its lists. A wrong plan costs time, a wrong
//! length a repetition. A plan is kept until the boxes have outgrown it: until then planning costs nothing.

use super::GpuPlan;
use super::error::{GpuError, Result};
use super::passes;
use super::storage::Storage;
use crate::GpuOptions;
use crate::layout::{COUNTED, Cell, Counters, FILTERED, LANES, Params, Totals, UNPLANNED};
use crate::pbig::Summary;
use crate::policy::{WIDEST_ITEM, most_tests};
use pbig_shaders::Buffer;

/// Number of boxes by which lists of the first call are longer than for the boxes there are: few boxes may need many entries.
const EXTRA_BOXES: u64 = 4096;

/// Maximum number of boxes whose pairs are all tested: the kernel counts in 32 bits, see `pair_index.wgsl`.
const MOST_ALL_PAIRS: u32 = 32_768;

/// Factor by which the number of boxes, or the work for a box, may change until a plan is outgrown.
const OUTGROWN: u64 = 2;

/// Factor on the cells with which a plan of too many tests is tried once more.
const FINER_RETRY: f32 = 0.125;

/// Maximum number of cells of a plan.
const MAX_CELLS: u64 = 1 << 28;

/// The plan and the lengths that earlier calls have told.
#[derive(Debug, Default)]
pub(super) struct Forecast {
    kept: Option<KeptPlan>,
    /// The plan was refused, or the boxes have outgrown it.
    pub(super) is_outdated: bool,
    /// A new plan gets finer cells, because the last plan made too many tests for the boxes that it was made for.
    pub(super) is_finer: bool,
    /// Lengths of the lists of the last map.
    pub(super) lists: Counters,
    /// Words of pairs of the last call.
    pub(super) words: u64,
}

/// A plan, and how it did.
#[derive(Debug)]
struct KeptPlan {
    plan: GpuPlan,
    boxes: u64,
    /// Number of pairs that a sample promised.
    pairs: u64,
    /// Entries of cells, and tests, for a valid box in the first search.
    first_work: Option<f64>,
}

impl Forecast {
    /// Begins a call that finds out the lengths and the plan it needs. A plan that no search has used was made for the boxes of a call
    /// without an answer.
    pub(super) fn start(&mut self) {
        self.is_finer = false;
        self.is_outdated |= self.kept.as_ref().is_some_and(KeptPlan::is_new);
    }

    pub(super) fn plan(&self) -> Option<&GpuPlan> {
        self.kept.as_ref().map(|kept| &kept.plan)
    }

    /// Returns true if a search of this number of boxes needs another plan than there is.
    pub(super) fn needs_plan(&self, options: &GpuOptions, boxes: u32) -> bool {
        let suits = |kept: &KeptPlan| !self.is_outdated && kept.suits(boxes);
        needs_grid(options, boxes) && !self.kept.as_ref().is_some_and(suits)
    }

    /// Makes a plan for this number of boxes.
    pub(super) fn make_plan(&mut self, summary: &Summary, boxes: u32, storage: &Storage) {
        if self.kept.take_if(|kept| !kept.suits(boxes)).is_some() {
            // The next call may have far fewer chunks.
            self.lists = Counters::default();
        }
        let cell_factor = if self.is_finer { FINER_RETRY } else { 1.0 };
        let max_cells = (storage.max_buffer_bytes / size_of::<Cell>() as u64).min(MAX_CELLS) as u32;
        let plan = GpuPlan::new(summary, storage.options.boxes_per_cell, cell_factor, max_cells);
        self.kept = Some(KeptPlan { plan, boxes: boxes.into(), pairs: summary.pairs(), first_work: None });
        self.is_outdated = false;
    }

    /// Learns from the counts of a search with these parameters. Returns true if it has made all its tests.
    pub(super) fn learn(&mut self, params: &Params, counters: &Counters) -> bool {
        if params.levels == 0 {
            return params.flags & UNPLANNED == 0;
        }
        let Some(kept) = self.kept.as_mut().filter(|kept| kept.plan.is_in(params)) else { return false };
        // First: lists that a plan for other boxes makes are not worth their memory.
        if !passes::tests_fit(params, counters) {
            self.refuse(params.boxes);
            return false;
        }
        self.lists = *counters;
        let has_lists = passes::lists_fit(params, counters);
        self.is_outdated |= has_lists && kept.is_outgrown_after(counters);
        self.is_finer &= !has_lists;
        has_lists
    }

    /// Returns true if no plan was made since a search with these parameters was recorded.
    pub(super) fn is_current(&self, params: &Params) -> bool {
        self.kept.as_ref().map_or(params.levels == 0, |kept| kept.plan.is_in(params))
    }

    /// Gives up a plan that makes too many tests: it may have been made for other boxes. One that was made for these is followed by one
    /// of finer cells: a few boxes far away leave too large ones.
    fn refuse(&mut self, boxes: u32) {
        if let Some(kept) = self.kept.as_ref().filter(|kept| !self.is_outdated && kept.suits(boxes)) {
            self.is_finer = kept.is_new() && !self.is_finer;
        }
        (self.is_outdated, self.lists) = (true, Counters::default());
    }

    /// After a call that exceeded a limit, forgets the lengths that may have, and frees all buffers: they leave no room for other boxes.
    pub(super) fn note_error(&mut self, error: &GpuError, storage: &mut Storage) {
        if let GpuError::Declined(_) = error {
            (self.lists, self.words) = Default::default();
            storage.free();
        }
    }

    /// Makes the buffers of a call, and returns its parameters. Without a plan, only few boxes are searched.
    pub(super) fn params(&self, storage: &mut Storage, boxes: u32, has_filters: bool) -> Result<Params> {
        let mut params = self.without_capacities(storage, boxes, has_filters);
        let first_bytes = storage.options.first_bytes.saturating_mul(u64::from(boxes) + EXTRA_BOXES);
        let first_bytes = first_bytes.min(storage.max_buffer_bytes);
        if params.levels > 0 {
            passes::make_buffers(storage, &mut params, &self.lists, first_bytes)?;
        }
        storage.ensure(Buffer::Counters, size_of::<Counters>() as u64)?;
        storage.ensure(Buffer::Totals, size_of::<Totals>() as u64)?;
        storage.ensure(Buffer::Out, (4 * self.words).max(first_bytes))?;
        Ok(params)
    }

    fn without_capacities(&self, storage: &Storage, boxes: u32, has_filters: bool) -> Params {
        let options = &storage.options;
        let needs_grid = needs_grid(options, boxes);
        let kept = self.kept.as_ref().filter(|_| needs_grid);
        let is_unplanned = needs_grid && kept.is_none();
        let flags = [(FILTERED, has_filters), (COUNTED, options.count_tests), (UNPLANNED, is_unplanned)];
        Params {
            boxes,
            small_cell: options.small_cell.clamp(1, LANES),
            // The output of a work item must fit the smallest buffer.
            columns: if storage.max_buffer_bytes < 8 << 20 { 1 } else { WIDEST_ITEM },
            flags: flags.into_iter().map(|(flag, is_set)| flag * u32::from(is_set)).sum(),
            most_tests: kept.map_or(0, |kept| kept.most_tests(boxes, options.boxes_per_cell)),
            ..kept.map_or(Params::default(), |kept| kept.plan.params)
        }
    }
}

impl KeptPlan {
    /// Returns true if no search has used the plan.
    fn is_new(&self) -> bool {
        self.first_work.is_none()
    }

    /// Returns true if the plan was made for about as many boxes.
    fn suits(&self, boxes: u32) -> bool {
        let boxes = u64::from(boxes);
        boxes <= OUTGROWN * self.boxes && self.boxes <= OUTGROWN * boxes
    }

    /// Returns the tests that a call may need, in units of [`LANES`].
    fn most_tests(&self, boxes: u32, boxes_per_cell: f32) -> u32 {
        let boxes = u64::from(boxes);
        let pairs = self.pairs.saturating_mul(boxes.div_ceil(self.boxes.max(1)));
        let most = most_tests(boxes, pairs, boxes_per_cell) / u64::from(LANES);
        // The device takes the largest number for no limit.
        most.min(u64::from(u32::MAX) - 1) as u32
    }

    /// Notes a call. Returns true if the work for a box has doubled or halved since the first one.
    fn is_outgrown_after(&mut self, counters: &Counters) -> bool {
        let &Counters { entries, tests, valid, .. } = counters;
        let now = (f64::from(entries) + f64::from(LANES) * f64::from(tests)) / f64::from(valid.max(1));
        let first = *self.first_work.get_or_insert(now);
        now > OUTGROWN as f64 * first || first > OUTGROWN as f64 * now
    }
}

/// Returns true if not every pair is tested.
fn needs_grid(options: &GpuOptions, boxes: u32) -> bool {
    boxes > options.all_pairs_up_to.clamp(1, MOST_ALL_PAIRS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use pbig_core::Aabb;

    fn kept(boxes: usize) -> KeptPlan {
        let cubes: Vec<_> = (0..boxes).map(|i| Aabb::from_center([i as f32, 0.0, 0.0], [0.5; 3])).collect();
        let plan = GpuPlan::new(&Summary::of(&cubes), GpuOptions::DEFAULT.boxes_per_cell, 1.0, 1 << 20);
        KeptPlan { plan, boxes: boxes as u64, pairs: 0, first_work: None }
    }

    fn counted(valid: u32, entries: u32, tests: u32) -> Counters {
        Counters { valid, entries, tests, ..Counters::default() }
    }

    /// Returns a forecast with a plan for this number of boxes, and the parameters of a search with it that has room for ten entries
    /// and for 100 workgroups of tests.
    fn planned(boxes: usize) -> (Forecast, Params) {
        let kept = kept(boxes);
        let (entry_capacity, most_tests) = (10, 100);
        let params = Params { boxes: boxes as u32, entry_capacity, most_tests, ..kept.plan.params };
        (Forecast { kept: Some(kept), ..Forecast::default() }, params)
    }

    /// Returns what a search has told: a new plan is needed, it gets finer cells, entries of the last map.
    fn told(forecast: &Forecast) -> (bool, bool, u32) {
        (forecast.is_outdated, forecast.is_finer, forecast.lists.entries)
    }

    #[test]
    fn a_search_without_a_grid_is_complete_unless_it_waits_for_a_plan() {
        let (mut forecast, planned) = planned(1000);
        let all_pairs = Params { boxes: 1000, ..Params::default() };
        let unplanned = Params { flags: FILTERED | UNPLANNED, ..all_pairs };
        assert!(forecast.learn(&all_pairs, &counted(1000, 7, 1)));
        assert!(!forecast.learn(&unplanned, &counted(1000, 7, 1)));
        assert_eq!(told(&forecast), (false, false, 0), "they have no lists");
        assert!(forecast.is_current(&planned) && !forecast.is_current(&unplanned));
        assert!(Forecast::default().is_current(&unplanned) && !Forecast::default().is_current(&planned));
    }

    #[test]
    fn a_search_tells_the_lengths_of_its_lists_whether_they_fit_or_not() {
        let (mut forecast, params) = planned(1000);
        forecast.is_finer = true;
        assert!(!forecast.learn(&params, &counted(1000, 11, 1)));
        assert_eq!(told(&forecast), (false, true, 11), "the repeat has finer cells, too");
        assert!(forecast.learn(&params, &counted(1000, 10, 1)));
        assert_eq!(told(&forecast), (false, false, 10));
        assert!(!forecast.learn(&params, &counted(1000, 11, 100)));
        assert_eq!(told(&forecast), (false, false, 11), "a repeat keeps the plan");
        assert!(forecast.learn(&params, &counted(1000, 9, 100)));
        assert_eq!(told(&forecast), (true, false, 9), "the work for a box has grown");
    }

    #[test]
    fn nothing_is_learned_from_a_search_with_another_plan() {
        let (mut forecast, _) = planned(1000);
        let (other, params) = planned(100);
        assert!(other.is_current(&params) && !forecast.is_current(&params));
        assert!(!forecast.learn(&params, &counted(100, 7, 1)));
        assert!(!forecast.learn(&params, &counted(100, 7, 101)));
        assert!(!Forecast::default().learn(&params, &counted(100, 7, 1)));
        assert_eq!(told(&forecast), (false, false, 0));
    }

    /// Cells that are too large for the boxes that they were made for become finer once. Other boxes get a plan of their own first.
    #[test]
    fn a_plan_of_too_many_tests_is_given_up_and_followed_by_finer_cells_if_it_was_new() {
        let refused = |change: fn(&mut Forecast, &mut Params)| {
            let (mut forecast, mut params) = planned(1000);
            forecast.lists = counted(1000, 7, 1);
            change(&mut forecast, &mut params);
            assert!(!forecast.learn(&params, &counted(1000, 7, 101)));
            told(&forecast)
        };
        assert_eq!(refused(|_, _| ()), (true, true, 0));
        assert_eq!(refused(|it, _| it.is_finer = true), (true, false, 0), "finer cells are not enough");
        assert_eq!(
            refused(|it, params| _ = it.learn(params, &counted(1000, 7, 1))),
            (true, false, 0),
            "used before"
        );
        assert_eq!(refused(|_, params| params.boxes = 2001), (true, false, 0), "made for other boxes");
        assert_eq!(refused(|it, _| it.is_outdated = true), (true, false, 0), "given up before");
        let wrapped = Counters { too_many_tests: 1, ..counted(1000, 7, 1) };
        let (mut forecast, params) = planned(1000);
        assert!(!forecast.learn(&params, &wrapped));
        assert_eq!(told(&forecast), (true, true, 0), "a number that wrapped around");
    }

    #[test]
    fn a_plan_suits_up_to_twice_as_many_boxes_and_half_as_many() {
        let plan = kept(1000);
        assert!(plan.suits(1000) && plan.suits(2000) && plan.suits(500));
        assert!(!plan.suits(2001) && !plan.suits(499));
    }

    #[test]
    fn a_plan_is_outgrown_when_work_for_a_box_doubles_or_halves() {
        let mut plan = kept(1000);
        assert!(!plan.is_outgrown_after(&counted(1000, 8000, 40)));
        assert!(!plan.is_outgrown_after(&counted(2000, 16_000, 80)), "twice the boxes");
        assert!(!plan.is_outgrown_after(&counted(1000, 8000, 70)));
        assert!(plan.is_outgrown_after(&counted(1000, 8000, 120)));
        assert!(plan.is_outgrown_after(&counted(1000, 4000, 15)));
    }

    /// The largest number would tell the device that there is no limit, even if its counts wrapped around.
    #[test]
    fn no_plan_may_need_any_number_of_tests() {
        let plan = KeptPlan { pairs: u64::MAX, ..kept(1000) };
        assert_eq!(plan.most_tests(u32::MAX, 4.0), u32::MAX - 1);
    }

    #[test]
    fn many_boxes_have_a_grid_whatever_the_option() {
        let with = |all_pairs_up_to| GpuOptions { all_pairs_up_to, ..GpuOptions::DEFAULT };
        let first_grid = |options: GpuOptions| (0..70_000).find(|boxes| needs_grid(&options, *boxes));
        assert_eq!([0, 1, 1000, u32::MAX].map(|most| first_grid(with(most))), [2, 2, 1001, 32_769].map(Some));
    }
}
