//! `PbigBroadPhase`: rapier's calls translated to the finder's, and its events back.

use crate::proxy::{collision_aabb, filter_of};
use pbig_core::{Aabb, BroadPhase as Finder, Config, Limits, Pair, ProxyFilter, Report};
use rapier3d::prelude::{
    BroadPhase, BroadPhasePairEvent, ColliderHandle, ColliderPair, ColliderSet, IntegrationParameters,
    RigidBodySet,
};
use rayon::prelude::*;

/// A collider index that is not in the finder. Rapier's generations cannot reach it.
const ABSENT: u32 = u32::MAX;

/// Modified colliders from which their boxes are computed on several threads: below, a second one
/// costs more than it saves.
const PARALLEL_FROM: usize = 2048;

/// What the finder is told about a collider; nothing when it is gone or disabled.
type Proxy = Option<(Aabb, ProxyFilter)>;

/// The broad phase to hand to rapier's `PhysicsPipeline` or `CollisionPipeline`.
///
/// A collider's index is its id in the finder. Each collider is stored with its box and filter, and
/// set again whenever rapier lists it as modified: rapier does not tell what has changed, and a
/// collider whose fat box still holds it and whose filter is the same costs nothing more.
#[derive(Clone, Debug)]
pub struct PbigBroadPhase {
    finder: Finder,
    /// By collider index: the generation that the finder holds.
    generations: Vec<u32>,
    /// Margin in units of `IntegrationParameters::length_unit`.
    relative_margin: f32,
    /// Of the modified colliders of one call, in their order.
    proxies: Vec<Proxy>,
    /// By collider index: pairs before this call; only for the colliders in its events.
    before: Vec<u32>,
}

impl Default for PbigBroadPhase {
    fn default() -> Self {
        Self::new()
    }
}

impl PbigBroadPhase {
    /// The defaults: a margin of 1% of the length unit, as rapier's own broad phase has, and no
    /// limit on colliders or pairs, as rapier has none.
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
        let finder = make(config).expect("the margin was checked above");
        Self {
            finder,
            generations: Vec::new(),
            relative_margin: margin,
            proxies: Vec::new(),
            before: Vec::new(),
        }
    }

    /// What the last update did.
    pub fn report(&self) -> &Report {
        self.finder.report()
    }

    /// Pairs that rapier knows of.
    pub fn pair_count(&self) -> usize {
        self.finder.pair_count()
    }

    /// The pairs that rapier knows of, in no particular order.
    pub fn pairs(&self) -> impl Iterator<Item = ColliderPair> {
        self.finder.pairs().map(|pair| self.handles(pair))
    }

    fn handle(&self, index: u32) -> ColliderHandle {
        ColliderHandle::from_raw_parts(index, self.generations[index as usize])
    }

    /// The collider with fewer pairs first, then the lower index: rapier looks for the edge of a
    /// pair by walking the pairs of the first (measured on 0.27, 30,000 balls on one ground: 17 ms
    /// in this order, 1.05 s in the other).
    fn handles(&self, pair: Pair) -> ColliderPair {
        self.ordered(pair, |id| self.finder.degree(id))
    }

    fn ordered(&self, pair: Pair, degree: impl Fn(u32) -> u32) -> ColliderPair {
        let (a, b) = (self.handle(pair.a), self.handle(pair.b));
        if degree(pair.b) < degree(pair.a) { ColliderPair::new(b, a) } else { ColliderPair::new(a, b) }
    }

    /// Forgets a collider, if the finder holds this very one. Its pairs end without an event: the
    /// narrow phase drops the pairs of removed and disabled colliders itself.
    fn remove(&mut self, handle: ColliderHandle) {
        let (index, generation) = handle.into_raw_parts();
        if self.generations.get(index as usize) == Some(&generation) {
            self.finder.remove(index);
            self.generations[index as usize] = ABSENT;
        }
    }

    fn set(&mut self, handle: ColliderHandle, aabb: Aabb, filter: ProxyFilter) {
        let (index, generation) = handle.into_raw_parts();
        self.claim(index, generation);
        if let Err(error) = self.finder.set(index, aabb, filter) {
            tracing::error!("pbig: collider {handle:?} is ignored: {error}");
        }
    }

    /// Boxes and filters of the modified colliders. Most of it is waiting for the memory of each
    /// collider and body, which a second thread halves.
    fn compute_proxies(
        &mut self,
        params: &IntegrationParameters,
        colliders: &ColliderSet,
        bodies: &RigidBodySet,
        modified: &[ColliderHandle],
    ) {
        let proxy = |handle: &ColliderHandle| -> Proxy {
            let collider = colliders.get(*handle).filter(|collider| collider.is_enabled())?;
            Some((collision_aabb(params, bodies, collider), filter_of(bodies, collider)))
        };
        if modified.len() < PARALLEL_FROM || rayon::current_num_threads() == 1 {
            self.proxies.clear();
            self.proxies.extend(modified.iter().map(proxy));
        } else {
            modified
                .par_iter()
                .with_min_len(PARALLEL_FROM / 4)
                .map(proxy)
                .collect_into_vec(&mut self.proxies);
        }
    }

    /// Makes the index stand for this generation; a predecessor that was never reported as removed
    /// is removed now.
    fn claim(&mut self, index: u32, generation: u32) {
        let i = index as usize;
        if i >= self.generations.len() {
            self.generations.resize(i + 1, ABSENT);
        }
        if self.generations[i] != generation {
            self.finder.remove(index);
            self.generations[i] = generation;
        }
    }

    /// A pair that has ended is ordered by the pairs that its colliders had before: a ground that has
    /// lost all of them must not come first.
    fn send(&mut self, events: &mut Vec<BroadPhasePairEvent>) {
        let found = self.finder.events();
        self.before.resize(self.generations.len(), 0);
        let both = |pair: &Pair| [pair.a, pair.b];
        let touched = || found.removed.iter().chain(&found.added).flat_map(both);
        touched().for_each(|id| self.before[id as usize] = self.finder.degree(id));
        found.removed.iter().flat_map(both).for_each(|id| self.before[id as usize] += 1);
        found.added.iter().flat_map(both).for_each(|id| self.before[id as usize] -= 1);
        let before = |id: u32| self.before[id as usize];
        let removed = found.removed.iter().map(|&pair| self.ordered(pair, before));
        let added = found.added.iter().map(|&pair| self.handles(pair));
        events.extend(removed.map(BroadPhasePairEvent::DeletePair));
        events.extend(added.map(BroadPhasePairEvent::AddPair));
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
        // First, because a modified collider may have taken the index of a removed one.
        for &handle in removed_colliders {
            self.remove(handle);
        }
        // A length unit that makes no sense leaves the margin as it was.
        let _ = self.finder.set_margin(self.relative_margin * params.length_unit);
        self.compute_proxies(params, colliders, bodies, modified_colliders);
        for (i, &handle) in modified_colliders.iter().enumerate() {
            match self.proxies[i] {
                Some((aabb, filter)) => self.set(handle, aabb, filter),
                None => self.remove(handle),
            }
        }
        match self.finder.update() {
            Ok(_) => self.send(events),
            Err(error) => tracing::error!("pbig: no pairs in this update: {error}"),
        }
    }
}
