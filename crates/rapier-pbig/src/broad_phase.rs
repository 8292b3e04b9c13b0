//! `PbigBroadPhase`: translates rapier's calls into calls of the core.

use crate::PbigConfig;
use crate::call::Call;
use crate::scene::{handle, to_event, to_pair};
use crate::tree::ParryTree;
use pbig_adapter::{Colliders, Error, HandlePair, Margins, Why};
use rapier3d::prelude::{
    BroadPhase, BroadPhasePairEvent, ColliderHandle, ColliderPair, ColliderSet, IntegrationParameters,
    NarrowPhase, RigidBodySet,
};

/// The broad phase to pass to rapier's `PhysicsPipeline` or `CollisionPipeline`.
///
/// A collider's index is the id of its box in the core. Rapier does not tell what has changed about a modified collider, so
/// its AABB and its filter are computed again. The core drops the change if the stored AABB, which is larger by the margin,
/// still contains the collider.
///
/// A clone, and a broad phase restored from a snapshot (feature `serde`), sends the same events as the original.
#[derive(Clone)]
pub struct PbigBroadPhase {
    pub(crate) colliders: Colliders<ParryTree>,
    /// Margin in units of `IntegrationParameters::length_unit`.
    pub(crate) relative_margin: f32,
    #[cfg(feature = "shadow")]
    pub(crate) shadow: Option<Box<crate::shadow::Watcher>>,
}

impl std::fmt::Debug for PbigBroadPhase {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut shown = f.debug_struct("PbigBroadPhase");
        shown.field("colliders", &self.stats().colliders).field("pairs", &self.pair_count());
        shown.field("margin", &self.relative_margin).finish_non_exhaustive()
    }
}

impl PbigBroadPhase {
    /// Creates an empty broad phase with [`PbigConfig::DEFAULT`].
    pub fn new() -> Self {
        Self::default()
    }

    /// As [`PbigBroadPhase::with_config`], with any settings of the core; its margin is in units of rapier's `length_unit`.
    /// For studies and tests.
    ///
    /// # Errors
    /// [`Error::Margin`].
    #[doc(hidden)]
    pub fn with_core_config(config: pbig_core::Config) -> Result<Self, Error> {
        pbig_core::BroadPhase::new(config).map(Self::around)
    }

    pub(crate) fn around(core: pbig_core::BroadPhase) -> Self {
        Self {
            relative_margin: core.config().margin,
            colliders: Colliders::new(core),
            #[cfg(feature = "shadow")]
            shadow: None,
        }
    }

    /// Takes over a world that another broad phase has served so far: one restored from a snapshot without this broad phase,
    /// or one that used rapier's own. The next update reads all colliders, and ends the narrow phase's pairs that do not
    /// overlap. Until then [`PbigBroadPhase::why`] and queries know of no collider.
    ///
    /// Without this call a new broad phase notices such a world by the number of colliders, but not the pairs that ended
    /// before: the narrow phase keeps those until one of their colliders is removed. A world that is replaced by one with the
    /// same number of colliders is not noticed: adopt it, or restore the broad phase together with it.
    pub fn adopt(&mut self, narrow_phase: &NarrowPhase) {
        let contacts = narrow_phase.contact_pairs().map(|pair| (pair.collider1, pair.collider2));
        let intersections = narrow_phase.intersection_pairs().map(|(one, other, _)| (one, other));
        let pairs = contacts.chain(intersections).map(|(a, b)| HandlePair(handle(a), handle(b)));
        self.colliders.adopt(pairs.collect(), Vec::new(), true);
        self.restart_shadow();
    }

    /// Returns why these two colliders are a pair since the last update, or the first test that they fail.
    ///
    /// ```
    /// use rapier3d::prelude::*;
    /// use rapier_pbig::{PbigBroadPhase, Why};
    ///
    /// let (mut broad_phase, bodies, mut colliders) =
    ///     (PbigBroadPhase::new(), RigidBodySet::new(), ColliderSet::new());
    /// let ball = |x: f32| ColliderBuilder::ball(0.5).translation(vector![x, 0.0, 0.0]);
    /// let handles = [0.0, 0.9, 5.0].map(|x| colliders.insert(ball(x)));
    /// let params = IntegrationParameters::default();
    /// broad_phase.update(&params, &colliders, &bodies, &handles, &[], &mut Vec::new());
    /// assert!(matches!(broad_phase.why(handles[0], handles[1]), Why::BodyTypes(_)), "both are fixed");
    /// let why = broad_phase.why(handles[0], handles[2]);
    /// assert_eq!(why.to_string(), "not reported: the boxes are 3.998 apart on the x axis");
    /// ```
    pub fn why(&self, one: ColliderHandle, other: ColliderHandle) -> Why {
        self.colliders.why(handle(one), handle(other))
    }

    fn restart_shadow(&mut self) {
        #[cfg(feature = "shadow")]
        if let Some(watcher) = &mut self.shadow {
            watcher.start_over(self.colliders.adopted().iter().copied());
        }
    }

    /// Handles a call that has something to do.
    // Not inlined, so that idle calls do not reserve its stack.
    #[inline(never)]
    fn handle(&mut self, call: &Call<'_>, events: &mut Vec<BroadPhasePairEvent>) {
        #[cfg(feature = "shadow")]
        let (start, rescans) = (events.len(), self.stats().totals.rescans);
        let usual = self.relative_margin * call.params.length_unit;
        #[cfg(feature = "shadow")]
        let adopted = self.colliders.adopted().to_vec();
        let margins = Margins { usual, ..Margins::default() };
        self.colliders.update(call, &margins, |event| events.push(to_event(event)));
        #[cfg(feature = "shadow")]
        if let Some(watcher) = &mut self.shadow {
            if self.colliders.stats().totals.rescans > rescans {
                watcher.start_over(adopted);
            }
            watcher.watch(call, &events[start..]);
        }
    }

    /// Returns true if the call has nothing to do. With a checker it returns false, because a checker sees every call.
    #[inline(always)]
    fn skips(&mut self, call: &Call<'_>) -> bool {
        #[cfg(feature = "shadow")]
        if self.shadow.is_some() {
            return false;
        }
        self.colliders.skips(call)
    }
}

pbig_adapter::define_methods!(PbigBroadPhase);

impl BroadPhase for PbigBroadPhase {
    fn update(
        &mut self,
        params: &IntegrationParameters,
        colliders: &ColliderSet,
        bodies: &RigidBodySet,
        modified_colliders: &[ColliderHandle],
        removed_colliders: &[ColliderHandle],
        events: &mut Vec<BroadPhasePairEvent>,
    ) {
        let (modified, removed) = (modified_colliders, removed_colliders);
        let call = Call { params, colliders, bodies, modified, removed };
        // A sleeping world takes a few comparisons. The counts of the last call are those of this one.
        if !self.skips(&call) {
            self.handle(&call, events);
        }
    }
}

#[cfg(test)]
mod tests;
