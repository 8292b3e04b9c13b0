//! `PbigBroadPhase`: translates rapier's calls into calls of the core.

use crate::PbigConfig;
use crate::call::Call;
use crate::events::{EventWriter, ordered};
use crate::registry::ColliderRegistry;
use crate::scene_tree::SceneTree;
use crate::stats::{Counts, Totals};
use pbig_core::Error;
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
    pub(crate) core: pbig_core::BroadPhase,
    pub(crate) registry: ColliderRegistry,
    /// Margin in units of `IntegrationParameters::length_unit`.
    pub(crate) relative_margin: f32,
    pub(crate) writer: EventWriter,
    /// Proxies that several threads compute. Kept for its memory.
    #[cfg(feature = "parallel")]
    pub(crate) proxies: Vec<crate::proxy::Proxy>,
    pub(crate) tree: SceneTree,
    pub(crate) counts: Counts,
    last_error: Option<Error>,
    /// The last call had nothing to do and left nothing to do.
    pub(crate) is_idle: bool,
    /// The last call stored only some of the listed colliders: a shape panicked, or the core refused a box. The next call
    /// reads all colliders, because rapier lists a change only once.
    is_incomplete: bool,
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
        shown.field("colliders", &self.registry.len()).field("pairs", &self.pair_count());
        shown.field("margin", &self.relative_margin).finish_non_exhaustive()
    }
}

impl PbigBroadPhase {
    /// Creates an empty broad phase with [`PbigConfig::DEFAULT`].
    pub fn new() -> Self {
        Self::with_config(PbigConfig::DEFAULT).expect("the default margin is a length")
    }

    /// Creates an empty broad phase.
    ///
    /// # Errors
    /// [`Error::Margin`].
    pub fn with_config(config: PbigConfig) -> Result<Self, Error> {
        pbig_core::BroadPhase::new(config.into()).map(Self::around)
    }

    /// As [`PbigBroadPhase::with_config`], on a given device. [`pbig_core::Backend::Gpu`] always uses it.
    /// [`pbig_core::Backend::Auto`] uses it for large changes, unless it is a software adapter.
    ///
    /// # Errors
    /// [`Error::Margin`].
    #[cfg(feature = "gpu")]
    pub fn with_gpu(config: PbigConfig, gpu: pbig_core::GpuFinder) -> Result<Self, Error> {
        pbig_core::BroadPhase::with_gpu(config.into(), gpu).map(Self::around)
    }

    /// Uses this device from the next update on. A broad phase restored from a snapshot has none.
    #[cfg(feature = "gpu")]
    pub fn set_gpu(&mut self, gpu: pbig_core::GpuFinder) {
        self.core.set_gpu(gpu);
    }

    /// Returns the name, kind and API of the device in use.
    #[cfg(feature = "gpu")]
    pub fn adapter(&self) -> Option<&str> {
        self.core.adapter()
    }

    /// As [`PbigBroadPhase::with_config`], with any settings of the core; its margin is in units of rapier's `length_unit`.
    /// For studies and tests (feature `unstable-study`).
    ///
    /// # Errors
    /// [`Error::Margin`].
    #[cfg(feature = "unstable-study")]
    pub fn with_core_config(config: pbig_core::Config) -> Result<Self, Error> {
        pbig_core::BroadPhase::new(config).map(Self::around)
    }

    pub(crate) fn around(core: pbig_core::BroadPhase) -> Self {
        Self {
            relative_margin: core.config().margin,
            core,
            registry: ColliderRegistry::default(),
            writer: EventWriter::default(),
            #[cfg(feature = "parallel")]
            proxies: Vec::new(),
            tree: SceneTree::default(),
            counts: Counts::default(),
            last_error: None,
            is_idle: false,
            is_incomplete: false,
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
        self.writer.adopted = contacts.chain(intersections).map(|(a, b)| ColliderPair::new(a, b)).collect();
        self.forget_all();
        self.is_idle = false;
        self.restart_shadow();
    }

    /// Returns the error of the last update, or `None` if it succeeded. If pairs could not be found, no events were sent, and
    /// the next update sees the same changes again. If a box could not be stored, the next update reads all colliders.
    pub fn last_error(&self) -> Option<&Error> {
        self.last_error.as_ref()
    }

    /// Returns the number of pairs that rapier knows of. Adopted pairs count from the next update on.
    pub fn pair_count(&self) -> usize {
        self.core.pair_count()
    }

    /// Returns the pairs that rapier knows of, in no particular order; the collider with fewer pairs comes first in each.
    /// Adopted pairs are among them from the next update on.
    pub fn pairs(&self) -> impl Iterator<Item = ColliderPair> {
        // Counted here: after a failed update the core would look at all pairs of a collider for each of its pairs.
        let mut degrees = vec![0; self.core.id_count() as usize];
        for pair in self.core.pairs() {
            degrees[pair.a as usize] += 1;
            degrees[pair.b as usize] += 1;
        }
        self.core.pairs().map(move |pair| ordered(pair, &self.registry, |id| degrees[id as usize]))
    }

    /// Removes first, because a modified collider may reuse the index of a removed one.
    fn read(&mut self, call: &Call<'_>) {
        for &handle in call.removed {
            // Rapier lists disabled colliders as removed, too.
            if call.colliders.contains(handle) { self.disable(handle) } else { self.forget(handle) }
        }
        self.writer.forget_adopted(call.removed);
        let margin = self.core.set_margin(self.relative_margin * call.params.length_unit);
        if std::mem::replace(&mut self.is_incomplete, true) {
            self.read_listed(call, &all_of(call.colliders));
        } else {
            self.read_listed(call, call.modified);
        }
        if self.registry.differs_from(call.colliders) {
            self.rescan(call);
        }
        // Up to here only a refused box sets an error; the margin's is noted below.
        self.is_incomplete = self.last_error.is_some();
        if let Err(error) = margin {
            self.note_error(error);
        }
    }

    /// Reads all colliders of a world that is not the one known so far. Rapier lists a collider that neither moves nor changes
    /// only once, and this broad phase missed it. Nothing that is stored can be trusted. (Adding a pair again does no harm.)
    fn rescan(&mut self, call: &Call<'_>) {
        self.forget_all();
        let all = all_of(call.colliders);
        tracing::debug!("pbig: another world, all {} colliders are read", all.len());
        self.read_listed(call, &all);
        self.counts.totals.rescans += 1;
        self.restart_shadow();
    }

    fn forget_all(&mut self) {
        self.registry.clear();
        self.core.clear();
        self.tree = SceneTree::default();
    }

    fn restart_shadow(&mut self) {
        #[cfg(feature = "shadow")]
        if let Some(checker) = &mut self.shadow {
            checker.start_over(self.writer.adopted.iter().copied());
        }
    }

    fn find_and_send(&mut self, events: &mut Vec<BroadPhasePairEvent>) {
        if self.tree.is_used() {
            self.tree.note(self.core.changes(), self.registry.len());
        }
        if let Err(error) = self.core.update() {
            return self.note_error(error);
        }
        let found = self.core.events();
        if found.added.is_empty() && found.removed.is_empty() && self.writer.adopted.is_empty() {
            return;
        }
        let _span = tracing::debug_span!(target: "pbig", "events").entered();
        let degree = |id| self.core.degree(id);
        let (added, deleted) = self.writer.write(found, &self.registry, degree, events);
        self.counts.note_events(added, deleted);
    }

    pub(crate) fn note_error(&mut self, error: Error) {
        tracing::error!("pbig: {error}");
        self.last_error = Some(error);
    }

    /// Handles a call that has something to do.
    // Not inlined, so that idle calls do not reserve its stack.
    #[inline(never)]
    fn handle(&mut self, call: &Call<'_>, has_changes: bool, events: &mut Vec<BroadPhasePairEvent>) {
        let (modified, removed) = (call.modified.len(), call.removed.len());
        let _span = tracing::debug_span!(target: "pbig", "update", modified).entered();
        let totals = Totals { updates: self.counts.totals.updates + 1, ..self.counts.totals };
        self.counts = Counts { modified, removed, totals, ..Counts::default() };
        (self.last_error, self.is_idle) = (None, false);
        #[cfg(feature = "shadow")]
        let start = events.len();
        self.read(call);
        self.find_and_send(events);
        self.counts.totals.failures += u64::from(self.last_error.is_some());
        #[cfg(feature = "shadow")]
        if let Some(checker) = &mut self.shadow {
            checker.watch(call, &events[start..]);
        }
        self.is_idle = !has_changes && self.has_nothing_left();
    }

    /// Returns true if nothing is left to do: no change or error of a failed update, no adopted pair, and no checker, which
    /// sees every call.
    fn has_nothing_left(&self) -> bool {
        #[cfg(feature = "shadow")]
        let is_watched = self.shadow.is_some();
        #[cfg(not(feature = "shadow"))]
        let is_watched = false;
        let is_done = self.last_error.is_none() && self.core.changes().next().is_none();
        is_done && !is_watched && self.writer.adopted.is_empty()
    }
}

fn all_of(colliders: &ColliderSet) -> Vec<ColliderHandle> {
    colliders.iter().map(|(handle, _)| handle).collect()
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
        let has_changes =
            !modified.is_empty() || !removed.is_empty() || self.registry.differs_from(colliders);
        if self.is_idle && !has_changes {
            // A sleeping world: a few comparisons. The counts of the last call are those of this one.
            self.counts.totals.updates += 1;
            return;
        }
        self.handle(&Call { params, colliders, bodies, modified, removed }, has_changes, events);
    }
}

#[cfg(test)]
mod tests;
