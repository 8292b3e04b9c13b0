//! Compares every update with rapier's own broad phase ("stock") and with brute force (the "oracle").
//!
//! See [`Checker`] for what is compared. Stock is a second `BroadPhaseBvh`, which sees the same calls.

pub use pbig_adapter::shadow::{Checker, Difference, Fault, ReplayError, Shadow, Side, View, write_frames};

use crate::PbigFinder;
use crate::scene::{Call, groups_of, handle};
use crate::tree::from_tree;
use pbig_adapter::shadow::Watched;
use pbig_adapter::{Aabb, Handle, HandlePair, PairEvent};
use rapier3d::parry::bounding_volume::Aabb as TreeAabb;
use rapier3d::parry::query::{contact, distance};
use rapier3d::prelude::*;
use std::panic::{AssertUnwindSafe, catch_unwind};

impl PbigFinder {
    /// Compares every update with this reference; a second call adds the other one. [`PbigFinder::differences`] lists what
    /// is wrong. The first difference is also a `tracing` error, and the AABBs of the calls up to it are written into a file
    /// for `pbig replay` in the system's folder for temporary files. (The file has no filters and no margin.)
    ///
    /// For tests, and for an app that seems to miss a pair. Add it before the finder is installed. See [`Shadow`] for the
    /// cost.
    ///
    /// ```
    /// use rapier_pbig::{PbigFinder, shadow::Shadow};
    /// use rapier3d::prelude::BroadPhaseBvh;
    ///
    /// let mut broad_phase = BroadPhaseBvh::new();
    /// let finder = PbigFinder::default().with_shadow(Shadow::Stock).with_shadow(Shadow::Oracle);
    /// rapier_pbig::install_finder(&mut broad_phase, finder);
    /// // The app's steps.
    /// let finder = rapier_pbig::finder(&broad_phase).expect("it is installed");
    /// assert!(finder.differences().is_empty(), "{}", finder.differences()[0]);
    /// ```
    pub fn with_shadow(mut self, shadow: Shadow) -> Self {
        let new = || Watcher::new(Checker::new().with_replays_in(std::env::temp_dir()), self.relative_margin);
        let watcher = self.shadow.get_or_insert_with(|| Box::new(new()));
        watcher.checker.add(shadow);
        self
    }

    /// Compares in one of `every` updates that modify something. The events of all updates are followed.
    pub fn compared_every(mut self, every: usize) -> Self {
        if let Some(watcher) = &mut self.shadow {
            watcher.checker = std::mem::take(&mut watcher.checker).every(every);
        }
        self
    }

    /// Returns the checker, if there is one.
    pub fn shadow(&self) -> Option<&Checker> {
        self.shadow.as_ref().map(|watcher| &watcher.checker)
    }

    /// Returns what the checker found wrong so far, oldest first.
    pub fn differences(&self) -> &[Difference] {
        self.shadow().map_or(&[], |checker| &checker.differences)
    }
}

/// A checker, and stock beside it.
#[derive(Clone)]
pub(crate) struct Watcher {
    pub(crate) checker: Checker,
    relative_margin: f32,
    /// None after it has panicked.
    stock: Option<BroadPhaseBvh>,
    /// Something was moved by the step since the last update.
    has_moved: bool,
    /// Stock has seen all colliders.
    started: bool,
}

impl std::fmt::Debug for Watcher {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Watcher").field("differences", &self.checker.differences).finish_non_exhaustive()
    }
}

impl Watcher {
    fn new(checker: Checker, relative_margin: f32) -> Self {
        Self { checker, relative_margin, stock: Some(BroadPhaseBvh::new()), has_moved: false, started: false }
    }

    /// Goes on with a world whose narrow phase has these pairs.
    pub(crate) fn start_over(&mut self, pairs: &[HandlePair]) {
        self.checker.start_over(pairs.iter().copied());
        (self.stock, self.started) = (Some(BroadPhaseBvh::new()), false);
    }

    pub(crate) fn note_moved(&mut self, params: &IntegrationParameters, aabbs: &[(ColliderHandle, TreeAabb)]) {
        self.has_moved |= !aabbs.is_empty();
        if let Some(stock) = &mut self.stock {
            aabbs.iter().for_each(|(handle, aabb)| stock.set_aabb(params, *handle, *aabb));
        }
    }

    pub(crate) fn watch(&mut self, call: &Call<'_>, events: &[BroadPhasePairEvent]) {
        let stock = self.update_stock(call);
        let (events, removed) = (pair_events(events), removed(call));
        let is_modified = std::mem::take(&mut self.has_moved) || !call.modified.is_empty();
        let relative = if call.adaptive_margin { crate::MAX_ADAPTIVE_MARGIN } else { self.relative_margin };
        let (margin, stock) = (relative * call.params.length_unit, stock.as_deref());
        let (removed, events) = (&removed[..], &events[..]);
        self.checker.watch(&Watched { view: call, margin, removed, is_modified, events, stock });
    }

    /// Updates stock and catches its panics. Returns its events, if it is a reference.
    fn update_stock(&mut self, call: &Call<'_>) -> Option<Vec<PairEvent>> {
        let stock = self.stock.as_mut().filter(|_| self.checker.has_stock())?;
        stock.adaptive_change_detection_margin = call.adaptive_margin;
        let (Call { params, colliders, bodies, modified, removed, .. }, mut events) = (*call, Vec::new());
        let first = !std::mem::replace(&mut self.started, true);
        let update = || {
            if first {
                show_all(stock, call, &mut events);
            }
            stock.update(params, colliders, bodies, modified, removed, &mut events);
        };
        if catch_unwind(AssertUnwindSafe(update)).is_err() {
            tracing::warn!("pbig: rapier's own broad phase has panicked and is no longer compared with");
            self.stock = None;
            return None;
        }
        Some(pair_events(&events))
    }
}

/// Shows all colliders to stock, because the world may be older than the checker. Stock skips colliders that have not changed,
/// so a copy of them is marked as changed.
fn show_all(stock: &mut BroadPhaseBvh, call: &Call<'_>, events: &mut Vec<BroadPhasePairEvent>) {
    let mut colliders = call.colliders.clone();
    let all: Vec<ColliderHandle> = colliders.iter_enabled().map(|(handle, _)| handle).collect();
    for &handle in &all {
        let pose = *colliders[handle].position();
        colliders[handle].set_position(pose);
    }
    stock.update(call.params, &colliders, call.bodies, &all, &[], events);
}

fn pair_events(events: &[BroadPhasePairEvent]) -> Vec<PairEvent> {
    let pair = |pair: &ColliderPair| HandlePair(handle(pair.collider1), handle(pair.collider2));
    let convert = |event: &BroadPhasePairEvent| match event {
        BroadPhasePairEvent::AddPair(added) => PairEvent::Add(pair(added)),
        BroadPhasePairEvent::DeletePair(deleted) => PairEvent::Delete(pair(deleted)),
    };
    events.iter().map(convert).collect()
}

fn removed(call: &Call<'_>) -> Vec<Handle> {
    call.removed.iter().map(|&removed| handle(removed)).collect()
}

impl Call<'_> {
    fn find(&self, wanted: Handle) -> Option<&Collider> {
        self.colliders.get(ColliderHandle::from_raw_parts(wanted.index, wanted.generation))
    }

    fn find_enabled(&self, wanted: Handle) -> Option<&Collider> {
        self.find(wanted).filter(|collider| collider.is_enabled())
    }

    fn body_type(&self, collider: &Collider) -> RigidBodyType {
        let body = collider.parent().and_then(|handle| self.bodies.get(handle));
        body.map_or(RigidBodyType::Fixed, |body| body.body_type())
    }
}

impl View for Call<'_> {
    fn enabled(&self) -> Vec<Handle> {
        self.colliders.iter_enabled().map(|(each, _)| handle(each)).collect()
    }

    fn side(&self, wanted: Handle) -> Option<Side> {
        let collider = self.find(wanted)?;
        Some(Side {
            aabb: self.aabb(wanted),
            parent: collider.parent().map(|body| body.into_raw_parts().into()),
            body_type: self.kind(collider),
            active_collision_types: collider.active_collision_types().bits(),
            groups: groups_of(collider.collision_groups()),
        })
    }

    fn aabb(&self, wanted: Handle) -> Option<Aabb> {
        let collider = self.find_enabled(wanted)?;
        Some(from_tree(&collider.compute_collision_aabb(self.params.prediction_distance() / 2.0)))
    }

    fn allowed(&self, HandlePair(a, b): HandlePair) -> bool {
        let (Some(a), Some(b)) = (self.find_enabled(a), self.find_enabled(b)) else { return false };
        let same_body = a.parent().is_some() && a.parent() == b.parent();
        let kinds = a.active_collision_types().test(self.body_type(a), self.body_type(b))
            || b.active_collision_types().test(self.body_type(a), self.body_type(b));
        !same_body && kinds && a.collision_groups().test(b.collision_groups())
    }

    /// If parry cannot compare the shapes, their AABBs decide.
    fn in_contact(&self, HandlePair(a, b): HandlePair) -> bool {
        let (Some(x), Some(y)) = (self.find_enabled(a), self.find_enabled(b)) else { return false };
        let reach = self.params.prediction_distance() + x.contact_skin() + y.contact_skin();
        let apart = distance(x.position(), x.shape(), y.position(), y.shape());
        match contact(x.position(), x.shape(), y.position(), y.shape(), reach) {
            Ok(found) => found.is_some() && !apart.is_ok_and(|apart| apart.distance > reach),
            Err(_) => matches!((self.aabb(a), self.aabb(b)), (Some(a), Some(b)) if a.overlaps(&b)),
        }
    }

    /// A soft body's collider, too, has a larger AABB: it may deform during the step.
    fn reaches_further(&self, wanted: Handle) -> bool {
        let body = self.find_enabled(wanted).and_then(Collider::parent).and_then(|body| self.bodies.get(body));
        let collider = self.find_enabled(wanted);
        let (Some(body), Some(collider)) = (body, collider) else { return false };
        let usual = collider.compute_collision_aabb(self.params.prediction_distance() / 2.0);
        let own = collider.compute_broad_phase_aabb(self.params, self.bodies);
        body.soft_ccd_prediction() > 0.0 || own.mins != usual.mins || own.maxs != usual.maxs
    }
}
