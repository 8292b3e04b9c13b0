//! What updates have taken, and the report of what that decides.

use super::BroadPhase;
use crate::Updates;
use crate::plan::{Chosen, Measured, NoGpu, NoNear};

impl BroadPhase {
    /// What has decided about an update that is done. Edits and lists have not learned from it yet.
    pub(super) fn report_measured(&mut self) {
        self.report.plan.no_gpu = self.no_gpu();
        let plan = &self.report.plan;
        let is_free = self.config.study.updates == Updates::Auto;
        let has_list =
            plan.near.is_some() || matches!(plan.no_near, Some(NoNear::Unpaid(_) | NoNear::Compared));
        let is_searched = matches!(plan.chosen, Chosen::Edit | Chosen::Grid);
        self.report.plan.measured = Measured {
            edit: self.rebuild.measured().filter(|_| is_free && is_searched && plan.near.is_none()),
            near: self.near.worth.share().filter(|_| is_free && has_list),
            grid: self.small.turns.share_of_grid().filter(|_| self.may_be_small()),
            gpu: None,
        };
    }

    fn no_gpu(&self) -> Option<NoGpu> {
        self.base.wants_gpu(&self.config, self.report.changed as usize).err().flatten()
    }
}

/// The time of some updates, and the boxes that have changed in them.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Spent {
    pub(super) ns: f32,
    pub(super) changed: f32,
}

impl Spent {
    pub(super) fn add(&mut self, ns: f32, changed: f32) {
        *self = Self { ns: self.ns + ns, changed: self.changed + changed };
    }

    /// By changed box, what this took of what another took.
    pub(super) fn share_of(self, other: Self) -> f32 {
        self.ns * other.changed / (other.ns * self.changed)
    }

    pub(super) fn is_less(self, other: Self) -> bool {
        self.ns * other.changed < other.ns * self.changed
    }
}
