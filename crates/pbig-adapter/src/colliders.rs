//! The colliders of a world by handle, their boxes in the core, and the events for the narrow phase.

use crate::events::{EventWriter, PairEvent, handles};
use crate::order::PairOrder;
use crate::registry::ColliderRegistry;
use crate::scene_query::SceneQuery;
use crate::stats::{Counts, Totals};
use crate::tree::SceneTree;
use crate::{Bounds, BoxStore, Handle, HandlePair, Margins, Scene, Tree};
use pbig_core::{BroadPhase, Error, PairDevice, ProxyFilter};
use std::collections::HashSet;

/// The numbers of a world.
type RealOf<T> = <<T as Tree>::Aabb as Bounds>::Real;
/// A scene query of a world.
type QueryOf<T> = SceneQuery<<T as Tree>::Aabb, RealOf<T>>;

/// The part of a broad phase that does not depend on rapier's version.
///
/// A collider's index is the id of its box in the core. The core drops a change if the stored AABB, which is larger by the
/// margin, still contains the collider.
///
/// A clone sends the same events as the original.
#[derive(Clone, Debug)]
pub struct Colliders<T: Tree> {
    pub(crate) core: BroadPhase,
    pub(crate) boxes: <T::Aabb as Bounds>::Store,
    pub(crate) registry: ColliderRegistry,
    pub(crate) writer: EventWriter,
    /// The margins of the last update; the usual one is valid.
    pub(crate) margins: Margins,
    /// Proxies that several threads compute. Kept for its memory.
    #[cfg(feature = "parallel")]
    pub(crate) proxies: Vec<(Handle, crate::Proxy<T::Aabb>)>,
    tree: SceneTree<T>,
    pub(crate) counts: Counts,
    last_error: Option<Error>,
    /// True if the last call had nothing to do and left nothing to do.
    is_idle: bool,
    /// The last call stored only some of the listed colliders: a shape panicked, or the core refused a box. The next call
    /// reads all colliders, because rapier lists a change only once.
    pub(crate) is_incomplete: bool,
    /// Boxes of a broad phase that stopped: the next call starts from these.
    inherited: Vec<(u32, T::Aabb)>,
}

impl<T: Tree> Colliders<T> {
    /// Creates an empty world.
    pub fn new(core: BroadPhase) -> Self {
        Self {
            core,
            boxes: Default::default(),
            registry: ColliderRegistry::default(),
            writer: EventWriter::default(),
            margins: Margins::default(),
            #[cfg(feature = "parallel")]
            proxies: Vec::new(),
            tree: SceneTree::default(),
            counts: Counts::default(),
            last_error: None,
            is_idle: false,
            is_incomplete: false,
            inherited: Vec::new(),
        }
    }

    /// Returns the core. The id of a box is the index of its collider.
    pub fn core(&self) -> &BroadPhase {
        &self.core
    }

    /// Uses this device in later updates.
    pub fn set_device(&mut self, device: Box<dyn PairDevice>) {
        self.core.set_device(device);
    }

    /// Changes the margin of boxes that are set after this call, in the world's unit. A negative, infinite or NaN margin is the
    /// error of this update.
    #[inline(always)]
    pub(crate) fn set_margin(&mut self, margin: f32) {
        if let Err(error) = self.boxes.set_margin(&mut self.core, margin) {
            self.note_error(error);
        }
    }

    /// Takes over a world whose narrow phase has these pairs. The next update finds no collider known, so it reads all, and ends
    /// pairs that do not overlap. `boxes` are the previous broad phase's, by collider index: a box that holds its collider is kept.
    /// With `keeps_order` the colliders of each pair are in the order of its event, and its end will have that order.
    pub fn adopt(&mut self, pairs: Vec<HandlePair>, boxes: Vec<(u32, T::Aabb)>, keeps_order: bool) {
        self.forget_all();
        (self.is_idle, self.is_incomplete) = (false, !pairs.is_empty() || !boxes.is_empty());
        self.writer.adopt(pairs, keeps_order);
        self.inherited = boxes;
    }

    /// Sets the AABBs of colliders, and keeps their filters. A collider without a box gets a filter that admits all, until the next update
    /// sets its own before it looks for pairs.
    #[inline(always)]
    pub fn set_aabbs(&mut self, margins: &Margins, moved: impl Iterator<Item = (Handle, T::Aabb)>) {
        self.set_margin(margins.usual);
        for (handle, aabb) in moved {
            self.counts.moved += 1;
            if let Some(margin) = margins.own(&aabb, false) {
                self.set_margin(margin);
            }
            // A collider that was disabled is known but has no box.
            if !(self.registry.contains(handle) && self.boxes.set_aabb(&mut self.core, handle.index, aabb)) {
                self.enable(handle, aabb, ProxyFilter::ALL);
            }
        }
        if !self.boxes.changes(&self.core).is_empty() {
            self.tree.expire();
        }
    }

    /// Visits the indices of colliders whose boxes, margins included, a query meets, and perhaps some that it barely misses.
    /// `visit` returns the time or distance up to which more are wanted, by the rules of [`pbig_core::BoxIndex::cast_aabb`].
    #[inline(always)]
    pub fn visit(&self, query: &QueryOf<T>, mut visit: impl FnMut(u32) -> RealOf<T>) {
        let boxes = &self.boxes;
        match query {
            SceneQuery::Sweep(start, velocity, time) => {
                let (start, velocity) = boxes.narrow_motion(start, velocity);
                let time = boxes.narrow_bound(*time);
                let visit = |id| boxes.narrow_bound(visit(id));
                self.core.index().cast_aabb(&start, velocity, time, visit);
            }
            SceneQuery::Near(point, distance) => {
                let (point, distance) = (boxes.narrow_point(point), boxes.narrow_bound(*distance));
                let visit = |id| boxes.narrow_bound(visit(id));
                self.core.index().near(point, distance, visit);
            }
            SceneQuery::Overlap(aabb) => {
                let visit = |id| {
                    if boxes.overlaps(id, aabb) {
                        visit(id);
                    }
                };
                self.core.index().overlapping(&boxes.narrow_box(aabb), visit);
            }
        }
    }

    /// Returns a tree of the same boxes, for queries that need one.
    pub fn tree(&self) -> &T {
        let changes = self.boxes.changes(&self.core).iter().copied();
        self.tree.get(self.core.id_count(), changes, |id| self.boxes.fat(&self.core, id))
    }

    /// Updates the boxes that rapier lists, and sends the events.
    pub fn update(
        &mut self,
        scene: &impl Scene<Aabb = T::Aabb>,
        margins: &Margins,
        send: impl FnMut(PairEvent),
    ) {
        let (listed, removed) = (scene.listed_count(), scene.removed().count());
        let has_changes = listed + removed > 0 || self.differs_from(scene);
        self.begin_counts(listed, removed);
        let _span = tracing::debug_span!(target: "pbig", "update", self.counts.modified).entered();
        (self.last_error, self.is_idle) = (None, false);
        // A shape may panic in the middle.
        self.tree.expire();
        self.read(scene, margins);
        self.tree.note(self.boxes.changes(&self.core).iter().copied(), self.registry.len());
        self.find_and_send(|handle| scene.size(handle), send);
        self.counts.totals.failures += u64::from(self.last_error.is_some());
        // The report of a skipped update is that of the last one: it has to say that nothing changed.
        self.is_idle = !has_changes && self.core.report().changed == 0 && self.has_nothing_left();
    }

    fn begin_counts(&mut self, listed: usize, removed: usize) {
        let totals = Totals { updates: self.counts.totals.updates + 1, ..self.counts.totals };
        let modified = listed + self.counts.moved;
        self.counts = Counts { modified, removed, totals, ..Counts::default() };
    }

    /// Counts an update in which rapier lists nothing, and returns true if there is nothing else to do either.
    #[inline(always)]
    pub fn skips(&mut self, scene: &impl Scene<Aabb = T::Aabb>) -> bool {
        let skips = self.is_idle
            && scene.listed_count() == 0
            && scene.removed().next().is_none()
            && self.has_no_changes()
            && !self.differs_from(scene);
        if skips {
            self.begin_counts(0, 0);
        }
        skips
    }

    fn differs_from(&self, scene: &impl Scene<Aabb = T::Aabb>) -> bool {
        self.registry.len() != scene.collider_count()
    }

    /// Returns true if nothing is left to do: no change or error of a failed update, and no adopted pair.
    fn has_nothing_left(&self) -> bool {
        self.last_error.is_none() && self.has_no_changes() && self.writer.adopted.is_empty()
    }

    fn has_no_changes(&self) -> bool {
        self.core.changes().is_empty() && self.boxes.changes(&self.core).is_empty()
    }

    /// Removes first, because a modified collider may reuse the index of a removed one.
    fn read(&mut self, scene: &impl Scene<Aabb = T::Aabb>, margins: &Margins) {
        for (handle, exists) in scene.removed() {
            // Rapier lists disabled colliders as removed, too.
            if exists { self.disable(handle) } else { self.forget(handle) }
        }
        self.writer.forget_adopted(scene.removed().map(|(handle, _)| handle));
        let margin = self.boxes.set_margin(&mut self.core, margins.usual);
        self.margins = Margins { usual: self.boxes.margin(&self.core), ..*margins };
        if std::mem::replace(&mut self.is_incomplete, true) {
            self.read_all(scene);
        } else {
            self.read_listed(scene);
        }
        if self.differs_from(scene) {
            self.rescan(scene);
        }
        // Only a refused box can have set an error before this line. The margin's error is noted below.
        self.is_incomplete = self.last_error.is_some();
        self.inherited.clear();
        self.boxes.settle(&mut self.core);
        if let Err(error) = margin {
            self.note_error(error);
        }
    }

    fn read_all(&mut self, scene: &impl Scene<Aabb = T::Aabb>) {
        let mut inherited = std::mem::take(&mut self.inherited);
        if !inherited.is_empty() {
            // Another collider may use the index of a removed one.
            let gone: HashSet<u32> = scene.removed().map(|(handle, _)| handle.index).collect();
            inherited.retain(|(id, _)| !gone.contains(id));
        }
        if !inherited.is_empty() && self.boxes.set_margin(&mut self.core, 0.0).is_ok() {
            for &(id, aabb) in &inherited {
                _ = self.boxes.set(&mut self.core, id, aabb, Default::default());
            }
            self.set_margin(self.margins.usual);
        }
        scene.for_each_collider(|handle, proxy| self.set_proxy(handle, proxy, false));
        for (id, _) in inherited {
            if self.registry.handle(id).is_none() {
                self.boxes.remove(&mut self.core, id);
            }
        }
    }

    /// Reads all colliders of a world that is not the one known so far. Rapier lists a collider that neither moves nor changes
    /// only once, and this broad phase missed it. Nothing that is stored can be trusted. (Adding a pair again does no harm.)
    fn rescan(&mut self, scene: &impl Scene<Aabb = T::Aabb>) {
        self.forget_all();
        tracing::debug!("pbig: another world, all {} colliders are read", scene.collider_count());
        self.read_all(scene);
        self.counts.totals.rescans += 1;
    }

    fn forget_all(&mut self) {
        self.registry.clear();
        self.boxes.clear(&mut self.core);
        self.tree = SceneTree::default();
        self.writer.order = PairOrder::default();
    }

    fn find_and_send(&mut self, size: impl Fn(Handle) -> u8, send: impl FnMut(PairEvent)) {
        let found = match self.boxes.update(&mut self.core) {
            Ok(found) => found,
            Err(error) => return self.note_error(error),
        };
        if found.added.is_empty() && found.removed.is_empty() && self.writer.adopted.is_empty() {
            return;
        }
        let _span = tracing::debug_span!(target: "pbig", "events").entered();
        let (added, deleted) = self.writer.write(found, &self.registry, size, send);
        self.counts.note_events(added, deleted);
    }

    /// Logs an error and keeps it as that of this update.
    pub(crate) fn note_error(&mut self, error: Error) {
        tracing::error!("pbig: {error}");
        self.last_error = Some(error);
    }

    /// Makes the next update look at the world although rapier lists nothing.
    pub fn wake_up(&mut self) {
        self.is_idle = false;
    }

    /// Returns the error of the last update, or `None` if it succeeded.
    pub fn last_error(&self) -> Option<&Error> {
        self.last_error.as_ref()
    }

    /// Returns the number of pairs that rapier knows of. Adopted pairs count after the next update.
    pub fn pair_count(&self) -> usize {
        self.boxes.pair_count(&self.core)
    }

    /// Returns the pairs that rapier knows of, sorted by the two indices; in each, the colliders are in the order of its events.
    /// Adopted pairs are included after the next update.
    pub fn pairs(&self) -> impl Iterator<Item = HandlePair> {
        self.core.pairs().filter(|pair| self.boxes.admits(pair)).map(|pair| {
            let [a, b] = handles(pair, &self.registry);
            self.writer.order.of(a, b)
        })
    }

    /// Returns the pairs that [`Colliders::adopt`] was given and no update has looked at since.
    pub fn adopted(&self) -> &[HandlePair] {
        &self.writer.adopted
    }

    /// Returns the boxes of all colliders that have one, with their margins, by ascending index.
    pub fn boxes(&self) -> impl Iterator<Item = (Handle, T::Aabb)> {
        let of = |id| Some((self.registry.handle(id)?, self.boxes.fat(&self.core, id)?));
        (0..self.core.id_count()).filter_map(of)
    }
}
