//! The plan of earlier calls. A plan decides only the time of a search, so it is kept until the boxes have outgrown it: then the
//! device measures the boxes once more. In between, a call costs the host nothing for planning.

use super::GpuPlan;
use crate::layout::{Counters, LANES};
use crate::policy::most_tests;

/// Factor by which the number of boxes, or the work for a box, may change until a plan is outgrown.
const OUTGROWN: u64 = 2;

/// Tests that a kept plan may need, as a multiple of those in its first call. With more, nothing is tested: boxes that have
/// jumped into one cell would keep the device busy for seconds.
const MAX_TESTS_FACTOR: u64 = 4;

/// Tests that every plan may need, in units of [`LANES`].
const ALWAYS_ALLOWED_TESTS: u64 = 1024;

/// A plan, and how it did.
#[derive(Debug)]
pub(super) struct KeptPlan {
    pub(super) plan: GpuPlan,
    boxes: u64,
    /// Number of pairs that a sample promised.
    pairs: u64,
    first: Option<Work>,
}

/// The work of a call.
#[derive(Clone, Copy, Debug)]
struct Work {
    boxes: u64,
    /// In units of [`LANES`].
    tests: u64,
    /// Entries of cells, and tests.
    all: u64,
}

impl Work {
    fn of(counters: &Counters) -> Self {
        let tests = u64::from(counters.tests);
        let all = u64::from(counters.entries) + u64::from(LANES) * tests;
        Self { boxes: u64::from(counters.valid).max(1), tests, all: all.max(1) }
    }
}

impl KeptPlan {
    /// Keeps a plan that was made for this number of boxes, with about this number of pairs.
    pub(super) fn new(plan: GpuPlan, boxes: u32, pairs: u64) -> Self {
        Self { plan, boxes: u64::from(boxes), pairs, first: None }
    }

    /// Returns true if no search has used the plan.
    pub(super) fn is_new(&self) -> bool {
        self.first.is_none()
    }

    /// Returns true if the plan was made for about as many boxes.
    pub(super) fn suits(&self, boxes: usize) -> bool {
        let boxes = boxes as u64;
        boxes <= OUTGROWN * self.boxes && self.boxes <= OUTGROWN * boxes
    }

    /// Returns the tests that a call may need, in units of [`LANES`].
    pub(super) fn most_tests(&self, boxes: u32, allowed_by_wish: u64) -> u32 {
        let boxes = u64::from(boxes);
        let pairs = self.pairs.saturating_mul(boxes.div_ceil(self.boxes.max(1)));
        let most = most_tests(boxes, pairs).saturating_mul(allowed_by_wish) / u64::from(LANES);
        let usual = self.first.map_or(u64::MAX, |first| {
            MAX_TESTS_FACTOR * (first.tests.max(1) * boxes / first.boxes) + ALWAYS_ALLOWED_TESTS
        });
        // The device takes the largest number for no limit.
        most.min(usual).min(u64::from(u32::MAX) - 1) as u32
    }

    /// Notes a call. Returns true if the work for a box has doubled or halved since the first one.
    pub(super) fn is_outgrown_after(&mut self, counters: &Counters) -> bool {
        let now = Work::of(counters);
        let first = *self.first.get_or_insert(now);
        let product = |all: u64, boxes: u64| u128::from(all) * u128::from(boxes);
        let (before, now) = (product(first.all, now.boxes), product(now.all, first.boxes));
        let outgrown = u128::from(OUTGROWN);
        now > outgrown * before || before > outgrown * now
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::GpuOptions;
    use crate::pbig::Summary;
    use pbig_core::Aabb;

    fn kept(boxes: u32) -> KeptPlan {
        let cubes: Vec<_> = (0..boxes).map(|i| Aabb::from_center([i as f32, 0.0, 0.0], [0.5; 3])).collect();
        KeptPlan::new(GpuPlan::new(&Summary::of(&cubes), &GpuOptions::DEFAULT, 1.0, 1 << 20), boxes, 0)
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

    #[test]
    fn later_calls_may_need_four_times_the_tests_of_the_first() {
        let mut plan = kept(100_000);
        assert_eq!(u64::from(plan.most_tests(100_000, 1)), most_tests(100_000, 0) / 256);
        assert_eq!(u64::from(plan.most_tests(100_000, 8)), most_tests(100_000, 0) / 32);
        plan.is_outgrown_after(&counted(100_000, 0, 4000));
        assert_eq!(plan.most_tests(100_000, 1), 4 * 4000 + 1024);
        assert_eq!(plan.most_tests(50_000, 1), 4 * 2000 + 1024);
    }

    /// The largest number would tell the device that there is no limit, even if its counts wrapped around.
    #[test]
    fn no_plan_may_need_any_number_of_tests() {
        let mut plan = KeptPlan { pairs: u64::MAX, ..kept(1000) };
        assert_eq!(plan.most_tests(u32::MAX, 1), u32::MAX - 1);
        plan.is_outgrown_after(&counted(1, 0, u32::MAX));
        assert_eq!(plan.most_tests(u32::MAX, 1), u32::MAX - 1);
    }
}
