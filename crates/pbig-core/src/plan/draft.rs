//! A plan on its way: its levels are on the stack until the memory of an earlier plan is found for them, so that where the
//! base is built anew again and again, nothing is allocated.

use super::levels::Levels;
use super::{Forecast, LevelPlan, Plan};
use std::sync::Arc;

/// A plan without its levels, and these.
pub(crate) struct Draft {
    plan: Plan,
    levels: Levels,
}

impl From<Plan> for Draft {
    /// Of a plan that has no levels.
    fn from(plan: Plan) -> Self {
        Self { plan, levels: Levels::new() }
    }
}

impl Draft {
    pub(super) fn new(plan: Plan, levels: Levels) -> Self {
        Self { plan, levels }
    }

    pub(crate) fn forecast(&self) -> &Forecast {
        &self.plan.forecast
    }

    /// In memory of its own.
    pub(crate) fn plan(self) -> Plan {
        Plan { levels: self.levels[..].into(), ..self.plan }
    }

    /// In memory that a plan before had, if nobody looks at that any more.
    pub(crate) fn plan_in(self, kept: &mut KeptLevels) -> Plan {
        if self.levels.is_empty() {
            return self.plan;
        }
        Plan { levels: kept.place(&self.levels), ..self.plan }
    }
}

/// Plans that may be there at once: the report's, that of the base, the one that is kept for builds to come, two that are
/// compared, and a free one.
const PLANS: usize = 6;

/// The levels of the last plans, of two lengths: those that were asked for last come first.
#[derive(Clone, Debug, Default)]
pub(crate) struct KeptLevels([[Arc<[LevelPlan]>; PLANS]; 2]);

impl KeptLevels {
    fn place(&mut self, levels: &[LevelPlan]) -> Arc<[LevelPlan]> {
        if self.0[0][0].len() != levels.len() {
            self.0.swap(0, 1);
        }
        let kept = &mut self.0[0];
        let is_free =
            |kept: &mut Arc<[LevelPlan]>| kept.len() == levels.len() && Arc::get_mut(kept).is_some();
        let Some(at) = kept.iter_mut().position(is_free) else {
            // All at once: plans with as many levels ask for nothing from now on.
            *kept = std::array::from_fn(|_| levels.into());
            return kept[0].clone();
        };
        if let Some(free) = Arc::get_mut(&mut kept[at]) {
            free.copy_from_slice(levels);
        }
        kept[at].clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::Chosen;

    fn drafted(boxes: &[u32]) -> Draft {
        let level = |&boxes| LevelPlan {
            boxes,
            classes: (0, 0),
            max_extent: [1.0; 3],
            cell: [2.0; 3],
            origin: [0.0; 3],
            dims: [1; 3],
            cells: 1,
            crowd: 0.0,
            camp: 0,
        };
        Draft::new(Plan { chosen: Chosen::Grid, ..Plan::default() }, boxes.iter().map(level).collect())
    }

    #[test]
    fn memory_is_used_again_once_nobody_has_the_plan() {
        let mut kept = KeptLevels::default();
        let first = drafted(&[1, 2]).plan_in(&mut kept);
        let others: [Plan; PLANS - 1] =
            std::array::from_fn(|i| drafted(&[3, 4 + i as u32]).plan_in(&mut kept));
        assert_eq!(first.levels[1].boxes, 2, "it is still there");
        let place = first.levels.as_ptr();
        drop(first);
        let last = drafted(&[7, 8]).plan_in(&mut kept);
        assert_eq!((last.levels.as_ptr(), last.levels[0].boxes), (place, 7));
        assert_eq!(drafted(&[9, 9]).plan_in(&mut kept).levels[1].boxes, 9, "none is free");
        let place = |kept: &mut KeptLevels, boxes: &[u32]| drafted(boxes).plan_in(kept).levels.as_ptr();
        let places = [place(&mut kept, &[1]), place(&mut kept, &[1, 2])];
        assert_eq!([place(&mut kept, &[3]), place(&mut kept, &[3, 4])], places, "two lengths by turns");
        assert_eq!(drafted(&[7]).plan_in(&mut kept).levels.len(), 1, "of another length");
        assert_eq!([&others[0], &others[4], &last].map(|plan| plan.levels[1].boxes), [4, 8, 8]);
        assert!(
            drafted(&[]).plan_in(&mut kept).levels.is_empty() && drafted(&[9]).plan().levels[0].boxes == 9
        );
    }
}
