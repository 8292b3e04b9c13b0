//! Compares every update of a broad phase with rapier's own broad phase ("stock") and with brute force (the "oracle").
//!
//! See [`Checker`] for what is compared, and its limits.

mod scene;

pub use crate::call::Call;
pub use pbig_adapter::shadow::{Checker, Difference, Fault, ReplayError, Shadow, Side, View, write_frames};

use crate::PbigBroadPhase;
use pbig_adapter::HandlePair;
use pbig_adapter::shadow::{Stock, Watched};
use rapier3d::prelude::*;
use scene::{of_events, of_pair, update_stock};

impl PbigBroadPhase {
    /// Compares every update with this reference; a second call adds the other one. [`PbigBroadPhase::differences`] lists what
    /// is wrong. The first difference is also a `tracing` error, and the AABBs of the calls up to it are written into a file
    /// for `pbig replay` in the system's folder for temporary files. (The file has no filters and no margin.)
    ///
    /// For tests, and for an app that seems to miss a pair. See [`Shadow`] for the cost.
    ///
    /// ```
    /// use rapier3d::prelude::*;
    /// use rapier_pbig::{PbigBroadPhase, shadow::Shadow};
    ///
    /// let mut broad_phase = PbigBroadPhase::new().with_shadow(Shadow::Stock).with_shadow(Shadow::Oracle);
    /// let (bodies, mut colliders) = (RigidBodySet::new(), ColliderSet::new());
    /// let ball = colliders.insert(ColliderBuilder::ball(0.5));
    /// let params = IntegrationParameters::default();
    /// broad_phase.update(&params, &colliders, &bodies, &[ball], &[], &mut Vec::new());
    /// assert!(broad_phase.differences().is_empty(), "{}", broad_phase.differences()[0]);
    /// ```
    pub fn with_shadow(mut self, shadow: Shadow) -> Self {
        self.colliders.wake_up();
        let known: Vec<_> = self.colliders.pairs().chain(self.colliders.adopted().iter().copied()).collect();
        let margin = self.relative_margin;
        let watcher = self.shadow.get_or_insert_with(|| {
            let mut watcher = Watcher::new(margin, Checker::default().with_replays());
            watcher.start_over(known);
            Box::new(watcher)
        });
        watcher.checker.add(shadow);
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
pub struct Watcher {
    /// The comparisons and their result so far.
    pub checker: Checker,
    relative_margin: f32,
    stock: Stock<BroadPhaseBvh>,
}

impl Watcher {
    /// Creates a watcher. `relative_margin` is the margin of the broad phase in units of `length_unit`: the AABBs of a pair may be
    /// four margins apart, two for each box.
    pub fn new(relative_margin: f32, checker: Checker) -> Self {
        Self { checker, relative_margin, stock: Stock::default() }
    }

    /// Prepares for another world, or for one that already has pairs. `pairs` are the narrow phase's. Stock sees all colliders in
    /// the next call.
    pub fn start_over(&mut self, pairs: impl IntoIterator<Item = HandlePair>) {
        self.checker.start_over(pairs);
        self.stock = Stock::default();
    }

    /// Calls [`Watcher::start_over`] with the pairs of rapier's narrow phase.
    pub fn start_over_with(&mut self, pairs: impl IntoIterator<Item = ColliderPair>) {
        self.start_over(pairs.into_iter().map(|pair| of_pair(&pair)));
    }

    /// Returns true if stock is a reference and has not panicked.
    pub fn has_stock(&self) -> bool {
        self.checker.has_stock() && !self.stock.has_panicked()
    }

    /// Checks a call that the broad phase has just answered with `events`.
    pub fn watch(&mut self, call: &Call<'_>, events: &[BroadPhasePairEvent]) {
        let has_few = || call.colliders.iter_enabled().nth(1).is_none();
        // Where removals leave one collider, parry's tree keeps nodes that make a later update recurse without end (parry#409).
        if !call.removed.is_empty() && !self.stock.has_panicked() && has_few() {
            self.stock = Stock::default();
        }
        let stock = if self.checker.has_stock() { update_stock(&mut self.stock, call) } else { None };
        self.checker.watch(&Watched {
            view: call,
            margin: self.relative_margin * call.params.length_unit,
            has_moved: false,
            events: &of_events(events),
            stock: stock.as_deref(),
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns two balls of radius 0.5 with this distance between their centres.
    fn balls(apart: f32) -> (ColliderSet, [ColliderHandle; 2]) {
        let mut colliders = ColliderSet::new();
        let mut ball = |x: f32| {
            let ball = ColliderBuilder::ball(0.5).translation(vector![x, 0.0, 0.0]);
            colliders.insert(ball.active_collision_types(ActiveCollisionTypes::all()))
        };
        let pair = [ball(0.0), ball(apart)];
        (colliders, pair)
    }

    #[test]
    fn a_missing_pair_is_one_fault_although_stock_has_it_too() {
        let (colliders, pair) = balls(1.0);
        let (params, bodies) = (IntegrationParameters::default(), RigidBodySet::new());
        let mut watcher = Watcher::new(0.01, Checker::default().with(Shadow::Stock).with(Shadow::Oracle));
        let handles = pair;
        let call = Call {
            params: &params,
            colliders: &colliders,
            bodies: &bodies,
            modified: &handles,
            removed: &[],
        };
        watcher.watch(&call, &[]);
        let checker = &watcher.checker;
        let faults: Vec<Fault> = checker.differences.iter().map(|d| d.fault).collect();
        assert_eq!(faults, [Fault::Missing]);
        assert_eq!((checker.compared, checker.oracle_pairs, checker.stock_only), (1, 1, 1));
    }

    /// Contract 7: rapier's own functions panic on negative and NaN distances. Here such a distance ends pairs, not the program.
    #[test]
    fn bad_contact_skins_and_predictions_are_checked_too() {
        for bad in [-3.0, f32::NAN, f32::NEG_INFINITY] {
            for is_skin in [true, false] {
                let (mut colliders, pair) = balls(0.9);
                let (mut params, bodies) = (IntegrationParameters::default(), RigidBodySet::new());
                if is_skin {
                    colliders[pair[0]].set_contact_skin(bad);
                } else {
                    params.normalized_prediction_distance = bad;
                }
                let ours = PbigBroadPhase::new().with_shadow(Shadow::Stock);
                let (mut ours, mut events) = (ours.with_shadow(Shadow::Oracle), Vec::new());
                ours.update(&params, &colliders, &bodies, &pair, &[], &mut events);
                assert_eq!((events.len(), ours.differences().len()), (0, 0), "{bad}, {is_skin}");
            }
        }
    }

    #[test]
    fn without_the_oracle_stocks_contacts_are_demanded() {
        // Along an axis the balls touch, or nearly; along the diagonal of a face only their boxes do.
        for (x, y, faults) in [(0.9, 0.0, 1), (1.0015, 0.0, 1), (0.9, 0.9, 0)] {
            let (mut colliders, pair) = balls(0.9);
            colliders[pair[1]].set_translation(vector![x, y, 0.0]);
            let (params, bodies) = (IntegrationParameters::default(), RigidBodySet::new());
            let mut watcher = Watcher::new(0.01, Checker::default().with(Shadow::Stock));
            let (colliders, modified) = (&colliders, &pair);
            watcher.watch(&Call { params: &params, colliders, bodies: &bodies, modified, removed: &[] }, &[]);
            let checker = &watcher.checker;
            let found: Vec<Fault> = checker.differences.iter().map(|d| d.fault).collect();
            assert_eq!((found, checker.stock_only), (vec![Fault::MissingContact; faults], 1), "{x} {y}");
        }
    }
}
