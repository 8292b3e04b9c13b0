//! The plan of earlier calls. A plan decides only the time of a search, so it is kept until the boxes have outgrown it: then the
//! host looks at all of them once more. In between, a call costs it nothing for planning.

use super::{GpuError, GpuPlan};
use crate::GpuOptions;
use crate::layout::{Counters, LANES, MAX_LEVELS, MAX_SPAN};
use crate::pbig::Summary;
use crate::policy::most_tests;

/// Factor by which the number of boxes, or the work for a box, may change until a plan is outgrown.
const OUTGROWN: u64 = 2;

/// Factor on the cells with which a plan of too many tests is tried once more.
pub(super) const FINER_RETRY: f32 = 0.125;

/// Maximum number of cells of a plan.
const MAX_CELLS: u64 = 1 << 28;

/// Maximum number of cells that a box touches in its own level, in the next one, and so on. A coarser cell is at least two finer
/// ones long, so a box touches 4, then 3, then 2 cells on an axis.
const CELLS_OF_A_BOX: [u64; MAX_LEVELS - 1] = [64, 27, 8, 8, 8, 8, 8];
const _: () = assert!(MAX_SPAN == 4);

/// A plan, and how it did.
#[derive(Debug)]
pub(super) struct KeptPlan {
    pub(super) plan: GpuPlan,
    boxes: u64,
    /// Number of pairs that a sample promised.
    pairs: u64,
    /// Entries of cells, and tests, for a valid box in the first search.
    first_work: Option<f64>,
}

impl KeptPlan {
    /// Plans for this number of boxes, with a factor on the cells, on a device with buffers of at most this size.
    pub(super) fn new(
        summary: &Summary,
        boxes: u32,
        (options, cell_factor): (&GpuOptions, f32),
        max_bytes: u64,
    ) -> Self {
        let plan = GpuPlan::new(summary, options, cell_factor, (max_bytes / 8).min(MAX_CELLS) as u32);
        Self { plan, boxes: boxes.into(), pairs: summary.pairs(), first_work: None }
    }

    /// Returns true if a call of this number of boxes needs more tests than the plan promised.
    pub(super) fn refuses(&self, counters: &Counters, boxes: u32, boxes_per_cell: f32) -> bool {
        counters.too_many_tests != 0 || counters.tests > self.most_tests(boxes, boxes_per_cell)
    }

    /// Returns true if no search has used the plan.
    pub(super) fn is_new(&self) -> bool {
        self.first_work.is_none()
    }

    /// Returns true if the plan was made for about as many boxes.
    pub(super) fn suits(&self, boxes: usize) -> bool {
        let boxes = boxes as u64;
        boxes <= OUTGROWN * self.boxes && self.boxes <= OUTGROWN * boxes
    }

    /// Returns the tests that a call may need, in units of [`LANES`].
    pub(super) fn most_tests(&self, boxes: u32, boxes_per_cell: f32) -> u32 {
        let boxes = u64::from(boxes);
        let pairs = self.pairs.saturating_mul(boxes.div_ceil(self.boxes.max(1)));
        let most = most_tests(boxes, pairs, boxes_per_cell) / u64::from(LANES);
        // The device takes the largest number for no limit.
        most.min(u64::from(u32::MAX) - 1) as u32
    }

    /// Returns an error if 32 bits might not count the entries of this number of boxes, whatever their sizes.
    pub(super) fn check_entries(&self, boxes: u32) -> Result<(), GpuError> {
        // The last level has one cell.
        let of_a_box = 1 + CELLS_OF_A_BOX[..self.plan.levels.len() - 1].iter().sum::<u64>();
        let entries = u64::from(boxes) * of_a_box;
        if entries <= u32::MAX.into() {
            return Ok(());
        }
        let most = u32::MAX;
        Err(GpuError::Declined(format!(
            "{boxes} boxes may have {entries} entries in cells, but the device counts up to {most}"
        )))
    }

    /// Notes a call. Returns true if the work for a box has doubled or halved since the first one.
    pub(super) fn is_outgrown_after(&mut self, counters: &Counters) -> bool {
        let &Counters { entries, tests, valid, .. } = counters;
        let now = (f64::from(entries) + f64::from(LANES) * f64::from(tests)) / f64::from(valid.max(1));
        let first = *self.first_work.get_or_insert(now);
        now > OUTGROWN as f64 * first || first > OUTGROWN as f64 * now
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::Level;
    use pbig_core::Aabb;

    fn kept(boxes: usize) -> KeptPlan {
        let cubes: Vec<_> = (0..boxes).map(|i| Aabb::from_center([i as f32, 0.0, 0.0], [0.5; 3])).collect();
        KeptPlan::new(&Summary::of(&cubes), boxes as u32, (&GpuOptions::DEFAULT, 1.0), 1 << 23)
    }

    fn counted(valid: u32, entries: u32, tests: u32) -> Counters {
        Counters { valid, entries, tests, ..Counters::default() }
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

    /// Returns a plan of this number of levels. No search uses it.
    fn with_levels(levels: usize) -> KeptPlan {
        let mut plan = kept(1000);
        plan.plan.levels = vec![Level::default(); levels];
        plan
    }

    #[test]
    fn thirty_million_boxes_have_no_more_entries_than_32_bits_count() {
        for levels in 1..=MAX_LEVELS {
            for boxes in [10_000_000, 30_000_000] {
                assert_eq!(with_levels(levels).check_entries(boxes), Ok(()), "{levels} levels");
            }
        }
        // 132 x 32,537,631 = 2^32 - 4.
        let plan = with_levels(MAX_LEVELS);
        assert_eq!(plan.check_entries(32_537_631), Ok(()));
        let why = plan.check_entries(32_537_632).expect_err("2^32 + 128 entries").to_string();
        assert_eq!(
            why,
            "32537632 boxes may have 4294967424 entries in cells, but the device counts up to 4294967295"
        );
    }

    /// The table against the kernels' shifts: boxes of up to four cells on an axis, wherever they begin.
    #[test]
    fn a_box_touches_no_more_cells_of_a_level_than_the_table_says() {
        for (coarser, most) in CELLS_OF_A_BOX.into_iter().enumerate() {
            let touched = |low: u64| ((low + u64::from(MAX_SPAN) - 1) >> coarser) - (low >> coarser) + 1;
            assert_eq!((0..1024).map(touched).max().map(|axis| axis.pow(3)), Some(most), "{coarser}");
        }
    }

    /// The largest number would tell the device that there is no limit, even if its counts wrapped around.
    #[test]
    fn no_plan_may_need_any_number_of_tests() {
        let plan = KeptPlan { pairs: u64::MAX, ..kept(1000) };
        assert_eq!(plan.most_tests(u32::MAX, 4.0), u32::MAX - 1);
    }
}
