//! Compares every update with rapier's own broad phase ("stock") and with brute force (the "oracle").
//!
//! See [`Checker`] for what is compared. Stock is a second `BroadPhaseBvh`, which sees the same calls.

pub use pbig_adapter::shadow::{Checker, Difference, Fault, ReplayError, Shadow, Side, View, write_frames};

use crate::scene::{Bounds, Call, groups_of, handle, kind_of, margins, of_events, parent_of, to_handle};
use crate::tree::from_tree;
use crate::{PairFinder, PbigFinder, SceneQuery};
use pbig_adapter::shadow::Watched;
use pbig_adapter::{Bounds as _, Handle, HandlePair, PairEvent};
use rapier::math::Real;
use rapier::parry::bounding_volume::Aabb as TreeAabb;
use rapier::parry::partitioning::Bvh;
use rapier::parry::query::{contact, distance};
use rapier::prelude::*;
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

impl PbigFinder {
    /// Compares every update with this reference; [`Shadowed::with_shadow`] adds the other one. The first difference is also a
    /// `tracing` error, and the AABBs of the calls up to it are written into a file for `pbig replay` in the system's folder
    /// for temporary files. (The file has no filters and no margin.)
    ///
    /// For tests, and for an app that seems to miss a pair. See [`Shadow`] for the cost.
    ///
    /// ```
    /// # use rapier as rapier3d;
    /// use rapier_pbig::{PbigFinder, Shadow, differences};
    /// use rapier3d::prelude::BroadPhaseBvh;
    ///
    /// let mut broad_phase = BroadPhaseBvh::new();
    /// let finder = PbigFinder::default().with_shadow(Shadow::Stock).with_shadow(Shadow::Oracle);
    /// rapier_pbig::install_finder(&mut broad_phase, finder);
    /// // The app's steps.
    /// assert!(differences(&broad_phase).is_empty(), "{}", differences(&broad_phase)[0]);
    /// ```
    pub fn with_shadow(self, shadow: Shadow) -> Shadowed<Self> {
        let margin = self.relative_margin;
        Shadowed::new(self, margin).with_shadow(shadow)
    }
}

/// Returns the checker of a finder that was installed with a shadow.
pub fn checker(broad_phase: &BroadPhaseBvh) -> Option<&Checker> {
    let finder = broad_phase.pair_finder()? as &dyn Any;
    finder.downcast_ref::<Shadowed<PbigFinder>>().map(|shadowed| &shadowed.checker)
}

/// Returns what the checker found wrong so far, oldest first; nothing if no shadow is installed.
pub fn differences(broad_phase: &BroadPhaseBvh) -> &[Difference] {
    checker(broad_phase).map_or(&[], |checker| &checker.differences)
}

/// A finder, and a checker of what it answers.
#[derive(Clone)]
pub struct Shadowed<F> {
    /// The finder.
    pub inner: F,
    /// The comparisons and their result so far.
    pub checker: Checker,
    relative_margin: f32,
    /// None after it has panicked.
    stock: Option<BroadPhaseBvh>,
    /// Something was moved by the step since the last update.
    has_moved: bool,
    /// Stock has seen all colliders.
    has_started: bool,
}

impl<F> Shadowed<F> {
    /// Creates a checker without references. `relative_margin` is the finder's margin in units of `length_unit`.
    pub fn new(inner: F, relative_margin: f32) -> Self {
        let checker = Checker::default().with_replays();
        let stock = Some(BroadPhaseBvh::new());
        Self { inner, checker, relative_margin, stock, has_moved: false, has_started: false }
    }

    /// Adds a reference.
    pub fn with_shadow(mut self, shadow: Shadow) -> Self {
        self.checker.add(shadow);
        self
    }

    /// Compares in one of `every` updates that modify something. The events of all updates are followed.
    pub fn every(self, every: usize) -> Self {
        Self { checker: self.checker.every(every), ..self }
    }

    fn watch(&mut self, call: &Call<'_>, events: &[BroadPhasePairEvent]) {
        let stock = self.update_stock(call);
        let (events, removed) = (of_events(events), removed(call));
        let is_modified = std::mem::take(&mut self.has_moved) || !call.modified.is_empty();
        let (margin, stock) = (call.margins.largest(), stock.as_deref());
        let (removed, events) = (&removed[..], &events[..]);
        self.checker.watch(&Watched { view: call, margin, removed, is_modified, events, stock });
    }

    /// Updates stock. Returns its events, if it is a reference.
    fn update_stock(&mut self, call: &Call<'_>) -> Option<Vec<PairEvent>> {
        if !self.checker.has_stock() {
            return None;
        }
        let (Call { params, colliders, bodies, modified, removed, .. }, mut events) = (*call, Vec::new());
        let first = !std::mem::replace(&mut self.has_started, true);
        self.guard(|stock| {
            stock.adaptive_change_detection_margin = call.margins.adaptive.is_some();
            if first {
                show_all(stock, call, &mut events);
            }
            stock.update(params, colliders, bodies, modified, removed, &mut events);
        })?;
        Some(of_events(&events))
    }

    /// Calls a function of stock. After a panic stock is dropped.
    fn guard(&mut self, work: impl FnOnce(&mut BroadPhaseBvh)) -> Option<()> {
        let stock = self.stock.as_mut()?;
        if catch_unwind(AssertUnwindSafe(|| work(stock))).is_err() {
            tracing::warn!("pbig: rapier's own broad phase has panicked and is no longer compared with");
            self.stock = None;
        }
        self.stock.as_ref().map(|_| ())
    }
}

impl<F: PairFinder + Clone> PairFinder for Shadowed<F> {
    fn update(
        &mut self,
        params: &IntegrationParameters,
        adaptive_margin: bool,
        colliders: &ColliderSet,
        bodies: &RigidBodySet,
        modified: &[ColliderHandle],
        removed: &[ColliderHandle],
        events: &mut Vec<BroadPhasePairEvent>,
    ) {
        let start = events.len();
        self.inner.update(params, adaptive_margin, colliders, bodies, modified, removed, events);
        let margins = margins(self.relative_margin, params, adaptive_margin);
        let call = Call { params, margins, colliders, bodies, modified, removed };
        self.watch(&call, &events[start..]);
    }

    fn set_aabbs(
        &mut self,
        params: &IntegrationParameters,
        adaptive: bool,
        aabbs: &[(ColliderHandle, TreeAabb)],
    ) {
        self.inner.set_aabbs(params, adaptive, aabbs);
        self.has_moved |= !aabbs.is_empty();
        if self.checker.has_stock() {
            self.guard(|stock| stock.set_aabbs(params, aabbs));
        }
    }

    fn tree(&self) -> &Bvh {
        self.inner.tree()
    }

    fn visit(&self, query: &SceneQuery, visit: &mut dyn FnMut(u32) -> Real) {
        self.inner.visit(query, visit);
    }

    fn state(&self) -> (Vec<(ColliderHandle, TreeAabb)>, Vec<(ColliderHandle, ColliderHandle)>) {
        self.inner.state()
    }

    fn start_from(&mut self, aabbs: Vec<(u32, TreeAabb)>, pairs: Vec<(ColliderHandle, ColliderHandle)>) {
        self.checker.start_over(pairs.iter().map(|&(a, b)| HandlePair(handle(a), handle(b))));
        (self.stock, self.has_started) = (Some(BroadPhaseBvh::new()), false);
        self.inner.start_from(aabbs, pairs);
    }

    fn clone_box(&self) -> Box<dyn PairFinder> {
        Box::new(self.clone())
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

fn removed(call: &Call<'_>) -> Vec<Handle> {
    call.removed.iter().map(|&removed| handle(removed)).collect()
}

impl Call<'_> {
    fn find(&self, wanted: Handle) -> Option<&Collider> {
        self.colliders.get(to_handle(wanted))
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
    type Aabb = Bounds;

    fn enabled(&self) -> Vec<Handle> {
        self.colliders.iter_enabled().map(|(each, _)| handle(each)).collect()
    }

    fn side(&self, wanted: Handle) -> Option<Side> {
        let collider = self.find(wanted)?;
        Some(Side {
            aabb: self.aabb(wanted).map(|aabb| aabb.to_f32()),
            parent: collider.parent().map(|body| body.into_raw_parts().into()),
            body_type: kind_of(parent_of(self.bodies, collider)),
            active_collision_types: collider.active_collision_types().bits(),
            groups: groups_of(collider.collision_groups()),
        })
    }

    fn aabb(&self, wanted: Handle) -> Option<Bounds> {
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

    /// Returns true if parry finds a contact. If parry cannot compare the shapes, their AABBs decide.
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
        let body =
            self.find_enabled(wanted).and_then(Collider::parent).and_then(|body| self.bodies.get(body));
        let collider = self.find_enabled(wanted);
        let (Some(body), Some(collider)) = (body, collider) else { return false };
        let usual = collider.compute_collision_aabb(self.params.prediction_distance() / 2.0);
        let own = collider.compute_broad_phase_aabb(self.params, self.bodies);
        body.soft_ccd_prediction() > 0.0 || own.mins != usual.mins || own.maxs != usual.maxs
    }
}
