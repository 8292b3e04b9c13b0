//! `PbigBroadPhase`: rapier's calls translated to the finder's.

use crate::call::Call;
use crate::events::Outbox;
use crate::roll::Roll;
use crate::scene_tree::SceneTree;
use crate::stats::{Kept, Totals};
use pbig_core::{BroadPhase as Finder, Config, Limits};
use rapier3d::prelude::{
    BroadPhase, BroadPhasePairEvent, ColliderHandle, ColliderPair, ColliderSet, IntegrationParameters,
    NarrowPhase, RigidBodySet,
};

/// The broad phase to hand to rapier's `PhysicsPipeline` or `CollisionPipeline`.
///
/// A collider's index is its id in the finder. Each collider is stored with its box and filter, and
/// set again whenever rapier lists it as modified: rapier does not tell what has changed, and a
/// collider whose fat box still holds it and whose filter is the same costs nothing more.
///
/// A clone, and one restored from a snapshot (feature `serde`), goes on as the original does.
#[derive(Clone)]
pub struct PbigBroadPhase {
    pub(crate) finder: Finder,
    pub(crate) roll: Roll,
    /// Margin in units of `IntegrationParameters::length_unit`.
    pub(crate) relative_margin: f32,
    pub(crate) outbox: Outbox,
    /// Indices of the listed colliders of one call.
    pub(crate) indices: Vec<u32>,
    pub(crate) tree: SceneTree,
    pub(crate) kept: Kept,
    /// The last call had nothing to do, and left everything so that another one has not either.
    pub(crate) idle: bool,
    #[cfg(feature = "shadow")]
    pub(crate) shadow: Option<Box<crate::shadow::Checker>>,
}

impl Default for PbigBroadPhase {
    fn default() -> Self {
        Self::new()
    }
}

impl std::fmt::Debug for PbigBroadPhase {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut shown = f.debug_struct("PbigBroadPhase");
        shown.field("colliders", &self.roll.len()).field("pairs", &self.pair_count());
        shown.field("config", self.finder.config()).finish_non_exhaustive()
    }
}

impl PbigBroadPhase {
    /// The defaults: a margin of 1% of the length unit, as rapier's own broad phase has, and no limit on colliders or pairs,
    /// as rapier has none. `pbig accuracy` compares margins. Half of this one makes the whole step faster where bodies lie just
    /// 2% of the length unit apart, so that neighbours pair with this one and do not with half (its scene `pile`); elsewhere
    /// none from 0 to 0.02 is faster than the noise. Without any, rounding is not covered: pairs were missed from a thousand
    /// units from the origin on.
    pub const CONFIG: Config = Config { margin: 0.01, limits: Limits::UNLIMITED, ..Config::DEFAULT };

    /// An empty broad phase with [`PbigBroadPhase::CONFIG`].
    pub fn new() -> Self {
        Self::with_config(Self::CONFIG)
    }

    /// An empty broad phase. [`Config::margin`] is in units of rapier's `length_unit`; one that is
    /// not a finite length of at least 0 is replaced by the default. Limits are not used: rapier's
    /// trait knows no errors.
    pub fn with_config(config: Config) -> Self {
        Self::on(config, Finder::new)
    }

    /// As [`PbigBroadPhase::with_config`], on a given device: with [`pbig_core::Backend::Gpu`] always,
    /// with [`pbig_core::Backend::Auto`] when it is no software and turns out faster than the CPU.
    #[cfg(feature = "gpu")]
    pub fn with_gpu(config: Config, gpu: pbig_core::GpuFinder) -> Self {
        Self::on(config, |config| Finder::with_gpu(config, gpu))
    }

    /// Goes on with this device, from the next update: one restored from a snapshot has none.
    #[cfg(feature = "gpu")]
    pub fn set_gpu(&mut self, gpu: pbig_core::GpuFinder) {
        self.finder.set_gpu(gpu);
    }

    /// The adapter of the device in use: name, kind and API.
    #[cfg(feature = "gpu")]
    pub fn adapter(&self) -> Option<&str> {
        self.finder.adapter()
    }

    fn on(config: Config, make: impl FnOnce(Config) -> Result<Finder, pbig_core::Error>) -> Self {
        let margin = if config.margin >= 0.0 && config.margin.is_finite() {
            config.margin
        } else {
            Self::CONFIG.margin
        };
        let config = Config { margin, limits: Limits::UNLIMITED, ..config };
        Self::around(make(config).expect("the margin was checked above"), margin)
    }

    pub(crate) fn around(finder: Finder, relative_margin: f32) -> Self {
        Self {
            finder,
            roll: Roll::default(),
            relative_margin,
            outbox: Outbox::default(),
            indices: Vec::new(),
            tree: SceneTree::default(),
            kept: Kept::default(),
            idle: false,
            #[cfg(feature = "shadow")]
            shadow: None,
        }
    }

    /// Starts again beside a world that it has not accompanied: one restored from a snapshot without this broad
    /// phase, or one that rapier's own broad phase has served so far. The next update looks at all
    /// colliders; pairs that the narrow phase has and that are none end then. Until then [`PbigBroadPhase::why`] and
    /// queries know of no collider.
    ///
    /// Without this call a new broad phase notices such a world too, but not the pairs that ended before it was
    /// there: the narrow phase keeps those until one of their colliders is removed. It notices by the number of colliders; so
    /// a world that is rolled back to another one of as many under a broad phase that stays has to be adopted, or the
    /// broad phase rolled back with it.
    pub fn adopt(&mut self, narrow_phase: &NarrowPhase) {
        let contacts = narrow_phase.contact_pairs().map(|pair| (pair.collider1, pair.collider2));
        let intersections = narrow_phase.intersection_pairs().map(|(one, other, _)| (one, other));
        self.outbox.adopted = contacts.chain(intersections).map(|(a, b)| ColliderPair::new(a, b)).collect();
        self.forget_all();
        self.idle = false;
        self.start_shadow_over();
    }

    /// Pairs that rapier knows of, but for adopted ones before the next update.
    pub fn pair_count(&self) -> usize {
        self.finder.pair_count()
    }

    /// The pairs that rapier knows of, in no particular order, but for adopted ones before the next update.
    pub fn pairs(&self) -> impl Iterator<Item = ColliderPair> {
        self.finder.pairs().map(|pair| self.outbox.pair(pair, &self.roll, |id| self.finder.degree(id)))
    }

    /// Forgets a collider, if this very one is on the roll. Its pairs end without an event: the
    /// narrow phase drops the pairs of removed and disabled colliders itself.
    pub(crate) fn forget(&mut self, handle: ColliderHandle) {
        if self.roll.strike(handle) {
            self.finder.remove(handle.into_raw_parts().0);
        }
    }

    /// Keeps a collider on the roll, without a box.
    pub(crate) fn disable(&mut self, handle: ColliderHandle) {
        self.roll.enter(handle);
        self.finder.remove(handle.into_raw_parts().0);
    }

    /// First what is removed, because a modified collider may have taken the index of a removed one.
    fn take_in(&mut self, call: &Call<'_>) {
        for &handle in call.removed {
            // Disabled colliders are listed as removed, too.
            if call.colliders.contains(handle) { self.disable(handle) } else { self.forget(handle) }
        }
        self.outbox.purge(call.removed);
        // A length unit that makes no sense leaves the margin as it was.
        let _ = self.finder.set_margin(self.relative_margin * call.params.length_unit);
        self.look_at(call, call.modified);
        if self.roll.is_behind(call.colliders) {
            self.rescan(call);
        }
    }

    /// Rapier lists a collider that neither moves nor changes only once, and this broad phase was not there: it is
    /// new beside a world restored from a snapshot, or the world has been replaced. Then nothing that is stored can
    /// be trusted. (A pair that is added again does no harm.)
    fn rescan(&mut self, call: &Call<'_>) {
        self.forget_all();
        let all: Vec<ColliderHandle> = call.colliders.iter().map(|(handle, _)| handle).collect();
        tracing::debug!("pbig: another world, all {} colliders are looked at", all.len());
        self.look_at(call, &all);
        self.kept.totals.rescans += 1;
        self.start_shadow_over();
    }

    /// Whether nothing is left to do: no change that an update which failed has left behind, no adopted pair, and no
    /// checker that wants to see every call.
    fn rests(&self) -> bool {
        #[cfg(feature = "shadow")]
        let is_watched = self.shadow.is_some();
        #[cfg(not(feature = "shadow"))]
        let is_watched = false;
        !is_watched && self.outbox.adopted.is_empty() && self.finder.changes().next().is_none()
    }

    fn start_shadow_over(&mut self) {
        #[cfg(feature = "shadow")]
        if let Some(checker) = &mut self.shadow {
            checker.start_over(self.outbox.adopted.iter().copied());
        }
    }

    fn forget_all(&mut self) {
        let all: Vec<ColliderHandle> = self.roll.handles().collect();
        all.into_iter().for_each(|handle| self.forget(handle));
        self.tree = SceneTree::default();
    }

    fn find_and_send(&mut self, events: &mut Vec<BroadPhasePairEvent>) {
        self.note_for_queries();
        if let Err(error) = self.finder.update() {
            self.kept.totals.failures += 1;
            tracing::error!("pbig: no pairs in this update: {error}");
            return;
        }
        let found = self.finder.events();
        let count = found.added.len() + found.removed.len() + self.outbox.adopted.len();
        if count == 0 {
            return;
        }
        let _span = tracing::debug_span!(target: "pbig", "events").entered();
        let sent = self.outbox.send(&self.finder, found, &self.roll, events);
        (self.kept.added, self.kept.deleted) = sent;
        self.kept.totals.added += sent.0 as u64;
        self.kept.totals.deleted += sent.1 as u64;
    }

    /// Boxes that have changed, for the tree of those who ask.
    pub(crate) fn note_for_queries(&mut self) {
        if self.tree.is_used() {
            self.tree.note(self.finder.changes(), self.roll.len());
        }
    }

    /// A call with news, or after one that left something to do. (Apart, as what it puts on the stack would be there for
    /// calls at rest, too.)
    #[inline(never)]
    fn take(&mut self, call: &Call<'_>, has_news: bool, events: &mut Vec<BroadPhasePairEvent>) {
        let (modified, removed) = (call.modified, call.removed);
        let _span = tracing::debug_span!(target: "pbig", "update", modified = modified.len()).entered();
        let totals = Totals { updates: self.kept.totals.updates + 1, ..self.kept.totals };
        self.kept = Kept { modified: modified.len(), removed: removed.len(), totals, ..Kept::default() };
        #[cfg(feature = "shadow")]
        let before = events.len();
        self.take_in(call);
        self.find_and_send(events);
        #[cfg(feature = "shadow")]
        if let Some(checker) = &mut self.shadow {
            checker.watch(call, &events[before..]);
        }
        self.idle = !has_news && self.rests();
    }
}

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
        let has_news = !modified.is_empty() || !removed.is_empty() || self.roll.is_behind(colliders);
        if self.idle && !has_news {
            // A world at rest: a few comparisons. The statistics of the call before hold for this one.
            self.kept.totals.updates += 1;
            return;
        }
        self.take(&Call { params, colliders, bodies, modified, removed }, has_news, events);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rapier3d::prelude::{ColliderBuilder, RigidBodyBuilder, nalgebra, vector};

    #[test]
    fn an_update_that_fails_sends_nothing_and_the_next_one_sees_its_changes() {
        let (mut bodies, mut colliders) = (RigidBodySet::new(), ColliderSet::new());
        let mut ball = |x: f32| {
            let body = bodies.insert(RigidBodyBuilder::dynamic().translation(vector![x, 0.0, 0.0]));
            colliders.insert_with_parent(ColliderBuilder::ball(0.5), body, &mut bodies)
        };
        let handles: Vec<ColliderHandle> = (0..12).map(|i| ball(0.1 * i as f32)).collect();
        let limits = Limits { max_pairs: 3, ..Limits::UNLIMITED };
        let finder = Finder::new(Config { limits, ..PbigBroadPhase::CONFIG }).expect("a margin");
        let mut broad_phase = PbigBroadPhase::around(finder, 0.01);
        let params = IntegrationParameters::default();
        let mut update = |modified: &[ColliderHandle], removed: &[ColliderHandle]| {
            let mut events = Vec::new();
            broad_phase.update(&params, &colliders, &bodies, modified, removed, &mut events);
            (events.len(), broad_phase.stats().totals.failures, broad_phase.pair_count())
        };
        assert_eq!(update(&handles, &[]), (0, 1, 0), "66 pairs");
        assert_eq!(update(&[], &[]), (0, 2, 0), "still");
        // Disabled, as far as a broad phase is told.
        assert_eq!(update(&[], &handles[3..]), (3, 2, 3));
        assert_eq!(update(&[], &[]), (0, 2, 3));
    }
}
