//! Compares every update with rapier's own broad phase ("stock") and with brute force (the "oracle").
//!
//! See [`Checker`] for what is compared. Stock is a second `BroadPhaseBvh`, which sees the same calls.

pub use pbig_adapter::shadow::{Checker, Difference, Fault, ReplayError, Shadow, Side, View, write_frames};

use crate::scene::{Bounds, Call, groups_of, handle, kind_of, margins, parent_of, to_handle};
use crate::tree::from_tree;
use crate::{PairFinder, PbigFinder, SceneQuery};
use pbig_adapter::HandlePair;
use pbig_adapter::shadow::{Stock, Watched};
use rapier::math::Real;
use rapier::parry::bounding_volume::Aabb as TreeAabb;
use rapier::parry::partitioning::Bvh;
use rapier::parry::query::{contact, distance};
use rapier::prelude::*;
use std::any::Any;

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
    stock: Stock<BroadPhaseBvh>,
    /// Something was moved by the step since the last update.
    has_moved: bool,
}

impl<F> Shadowed<F> {
    /// Creates a checker without references. `relative_margin` is the finder's margin in units of `length_unit`.
    pub fn new(inner: F, relative_margin: f32) -> Self {
        let checker = Checker::default().with_replays();
        Self { inner, checker, relative_margin, stock: Stock::default(), has_moved: false }
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
        self.stock.guard(|stock| stock.adaptive_change_detection_margin = call.margins.adaptive.is_some());
        let stock = if self.checker.has_stock() { update_stock(&mut self.stock, call) } else { None };
        let (margin, has_moved) = (call.margins.largest(), std::mem::take(&mut self.has_moved));
        let (events, stock) = (&of_events(events), stock.as_deref());
        self.checker.watch(&Watched { view: call, margin, has_moved, events, stock });
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
            self.stock.guard(|stock| stock.set_aabbs(params, aabbs));
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
        self.stock = Stock::default();
        self.inner.start_from(aabbs, pairs);
    }

    fn clone_box(&self) -> Box<dyn PairFinder> {
        Box::new(self.clone())
    }
}

impl Call<'_> {
    fn aabb_of_stock(&self, _: ColliderHandle, collider: &Collider) -> Bounds {
        from_tree(&collider.compute_collision_aabb(self.params.prediction_distance() / 2.0))
    }

    /// A soft body's collider, too, has a larger AABB: it may deform during the step.
    fn reaches_further_with(&self, collider: &Collider, body: &RigidBody) -> bool {
        let usual = collider.compute_collision_aabb(self.params.prediction_distance() / 2.0);
        let own = collider.compute_broad_phase_aabb(self.params, self.bodies);
        body.soft_ccd_prediction() > 0.0 || own.mins != usual.mins || own.maxs != usual.maxs
    }
}

fn apart(a: &Collider, b: &Collider) -> Option<Real> {
    distance(a.position(), a.shape(), b.position(), b.shape()).ok().map(|apart| apart.distance)
}

pbig_adapter::define_view!(apart);
