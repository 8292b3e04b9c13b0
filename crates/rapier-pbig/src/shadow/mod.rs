//! Compares every update of a broad phase with rapier's own broad phase ("stock") and with brute force (the "oracle").
//!
//! A [`Checker`] follows the events, so it knows the pairs that the narrow phase has. It compares them with the oracle, whose
//! AABBs and filters come from rapier's public functions, with the pairs that stock reports, and with the rule that every pair
//! has a reason. It shares only the definition of overlap with the broad phase that it checks.
//!
//! The checker does not see the order of events, nor a pair that only soft CCD needs beyond its prediction distance. It does
//! not compare after a call in which nothing is modified. It uses the present prediction distance, length unit and contact skin
//! for all colliders; a broad phase applies them to listed colliders only. An app that changes these should modify all
//! colliders, or the checker reports missing pairs that rapier's own broad phase misses, too.

mod difference;
mod followed;
mod replay;
mod scene;
mod stock;

pub use crate::call::Call;
pub use difference::{Difference, Fault, Side};
pub use replay::{ReplayError, write_frames};

use crate::{PbigBroadPhase, policy};
use followed::Followed;
use pbig_core::Aabb;
use rapier3d::prelude::*;
use scene::SceneView;
use std::collections::{HashSet, VecDeque};
use std::path::PathBuf;
use stock::Stock;

/// Two colliders, the lower handle first.
type HandlePair = (ColliderHandle, ColliderHandle);

fn ordered(a: ColliderHandle, b: ColliderHandle) -> HandlePair {
    if a.into_raw_parts() <= b.into_raw_parts() { (a, b) } else { (b, a) }
}

fn sorted(pair: &HandlePair) -> [(u32, u32); 2] {
    [pair.0.into_raw_parts(), pair.1.into_raw_parts()]
}

/// The reference that a broad phase is compared with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shadow {
    /// Rapier's own broad phase on the same world. A pair that only stock reports must not be in contact.
    Stock,
    /// Brute force over the AABBs: every overlapping pair that no filter excludes must be reported. Quadratic: 0.1 s a call
    /// with 10,000 colliders.
    Oracle,
}

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
        self.is_idle = false;
        let adopted = self.writer.adopted.iter().copied();
        let margin = self.relative_margin;
        let known: Vec<_> = self.pairs().chain(adopted).collect();
        let checker = self.shadow.get_or_insert_with(|| {
            let mut checker = Checker::new(margin).with_replays_in(std::env::temp_dir());
            checker.start_over(known);
            Box::new(checker)
        });
        checker.add(shadow);
        self
    }

    /// Returns the checker, if there is one.
    pub fn shadow(&self) -> Option<&Checker> {
        self.shadow.as_deref()
    }

    /// Returns what the checker found wrong so far, oldest first.
    pub fn differences(&self) -> &[Difference] {
        self.shadow.as_ref().map_or(&[], |checker| &checker.differences)
    }
}

/// Follows the calls and events of a broad phase, and compares its pairs with the references.
#[derive(Clone, Default)]
pub struct Checker {
    /// Everything wrong so far, each fault of a pair once, oldest first, at most a thousand.
    pub differences: Vec<Difference>,
    /// AABBs without margin by collider index, for the last few calls.
    pub frames: VecDeque<Vec<Aabb>>,
    /// Calls that were compared.
    pub compared: usize,
    /// Pairs that the oracle found, in all calls.
    pub oracle_pairs: u64,
    /// Pairs that only stock reported, in all calls: excluded by a filter, or not in contact.
    pub stock_only: u64,
    stock: Option<Stock>,
    oracle: bool,
    folder: Option<PathBuf>,
    known: Followed,
    margin: f32,
    /// One call in this many is compared; 0 means 1.
    every: usize,
    calls: usize,
    /// Calls in which something was modified.
    comparable: usize,
    /// True before the first call on another world.
    fresh: bool,
}

impl Checker {
    /// Creates a checker without a reference. `relative_margin` is the margin of the broad phase in units of `length_unit`: the
    /// AABBs of a pair may be four margins apart, two for each box.
    pub fn new(relative_margin: f32) -> Self {
        Self { margin: relative_margin, ..Self::default() }
    }

    /// Adds a reference.
    pub fn with(mut self, shadow: Shadow) -> Self {
        self.add(shadow);
        self
    }

    /// As [`Checker::with`].
    pub fn add(&mut self, shadow: Shadow) {
        match shadow {
            Shadow::Oracle => self.oracle = true,
            Shadow::Stock => _ = self.stock.get_or_insert_default(),
        }
    }

    /// Compares in one of `every` calls that modify something. The events of all calls are followed.
    pub fn every(self, every: usize) -> Self {
        Self { every, ..self }
    }

    /// Writes the AABBs of the calls up to the first difference into this folder.
    pub fn with_replays_in(self, folder: PathBuf) -> Self {
        Self { folder: Some(folder), ..self }
    }

    /// Prepares for another world, or one that is not new. `pairs` are those that the narrow phase has. Stock sees all colliders
    /// in the next call.
    pub fn start_over(&mut self, pairs: impl IntoIterator<Item = ColliderPair>) {
        self.known = Followed::of(pairs);
        self.fresh = true;
        if let Some(stock) = &mut self.stock {
            *stock = Stock::default();
        }
    }

    /// Returns true if stock is a reference and has not panicked.
    pub fn has_stock(&self) -> bool {
        self.stock.as_ref().is_some_and(|stock| !stock.panicked)
    }

    /// Checks a call that the broad phase has just answered with `events`.
    pub fn watch(&mut self, call: &Call<'_>, events: &[BroadPhasePairEvent]) {
        let scene = SceneView::new(call);
        let mut faults = Vec::new();
        self.known.purge(call.removed);
        self.known.follow(events, |fault, pair| faults.push((fault, pair)));
        if let Some(stock) = &mut self.stock {
            stock.update(call);
        }
        // If nothing was modified, only pairs of removed colliders can have changed.
        let fresh = std::mem::take(&mut self.fresh);
        if fresh || !call.modified.is_empty() || !events.is_empty() {
            self.keep_frame(&scene);
            if self.comparable.is_multiple_of(self.every.max(1)) {
                self.compare(&scene, &mut faults);
            }
            self.comparable += 1;
        }
        let first = self.differences.is_empty();
        faults.into_iter().for_each(|(fault, pair)| self.note(fault, pair, &scene));
        if first && !self.differences.is_empty() {
            self.report_first();
        }
        self.calls += 1;
    }

    fn keep_frame(&mut self, scene: &SceneView<'_>) {
        self.frames.push_back(scene.boxes());
        while self.frames.len() > policy::REPLAY_FRAMES {
            self.frames.pop_front();
        }
    }

    fn note(&mut self, fault: Fault, pair: HandlePair, scene: &SceneView<'_>) {
        let noted = |one: &Difference| (one.fault, one.pair) == (fault, pair);
        if self.differences.len() < policy::MAX_DIFFERENCES && !self.differences.iter().any(noted) {
            let sides = [pair.0, pair.1].map(|handle| scene.side(handle));
            self.differences.push(Difference { call: self.calls, fault, pair, sides, replay: None });
        }
    }

    fn compare(&mut self, scene: &SceneView<'_>, faults: &mut Vec<(Fault, HandlePair)>) {
        let from = faults.len();
        let wanted = if self.oracle { scene.oracle() } else { HashSet::new() };
        faults.extend(wanted.difference(&self.known.0).map(|&pair| (Fault::Missing, pair)));
        if let Some(stock) = self.stock.as_ref().filter(|stock| !stock.panicked) {
            for &pair in stock.known.0.difference(&self.known.0) {
                self.stock_only += 1;
                if !wanted.contains(&pair) && scene.allowed(pair) && scene.in_contact(pair) {
                    faults.push((Fault::MissingContact, pair));
                }
            }
        }
        let baseless = |pair: &&HandlePair| !scene.may_pair(**pair, self.margin);
        faults.extend(self.known.0.iter().filter(baseless).map(|&pair| (Fault::Spurious, pair)));
        self.compared += 1;
        self.oracle_pairs += wanted.len() as u64;
        faults[from..].sort_by_key(|(_, pair)| sorted(pair));
    }

    /// Writes the frames up to the first difference, and logs the difference.
    fn report_first(&mut self) {
        let Some(first) = self.differences.first_mut() else { return };
        if let Some(folder) = &self.folder {
            first.replay = Some(replay::write_into(folder, &self.frames).map_err(|error| error.to_string()));
        }
        tracing::error!("pbig: {first}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_pair_is_one_fault_although_stock_has_it_too() {
        let (colliders, pair) = scene::tests::balls(1.0);
        let (params, bodies) = (IntegrationParameters::default(), RigidBodySet::new());
        let mut checker = Checker::new(0.01).with(Shadow::Stock).with(Shadow::Oracle);
        let handles = [pair.0, pair.1];
        let call = Call {
            params: &params,
            colliders: &colliders,
            bodies: &bodies,
            modified: &handles,
            removed: &[],
        };
        checker.watch(&call, &[]);
        let faults: Vec<Fault> = checker.differences.iter().map(|d| d.fault).collect();
        assert_eq!(faults, [Fault::Missing]);
        assert_eq!((checker.compared, checker.oracle_pairs, checker.stock_only), (1, 1, 1));
    }

    /// Contract 7: numbers that no length is, for which rapier's own functions panic, end the pairs and not the program.
    #[test]
    fn contact_skins_and_predictions_that_are_no_lengths_are_checked_like_any_other() {
        for bad in [-3.0, f32::NAN, f32::NEG_INFINITY] {
            for is_skin in [true, false] {
                let (mut colliders, pair) = scene::tests::balls(0.9);
                let (mut params, bodies) = (IntegrationParameters::default(), RigidBodySet::new());
                if is_skin {
                    colliders[pair.0].set_contact_skin(bad);
                } else {
                    params.normalized_prediction_distance = bad;
                }
                let ours = PbigBroadPhase::new().with_shadow(Shadow::Stock);
                let (mut ours, mut events) = (ours.with_shadow(Shadow::Oracle), Vec::new());
                ours.update(&params, &colliders, &bodies, &[pair.0, pair.1], &[], &mut events);
                assert_eq!((events.len(), ours.differences().len()), (0, 0), "{bad}, {is_skin}");
            }
        }
    }

    #[test]
    fn without_the_oracle_stocks_pairs_are_demanded_where_there_is_a_contact() {
        // Along an axis the balls touch; along the diagonal of a face only their boxes do.
        for (y, faults) in [(0.0, &[Fault::MissingContact][..]), (0.9, &[])] {
            let (mut colliders, pair) = scene::tests::balls(0.9);
            colliders[pair.1].set_translation(vector![0.9, y, 0.0]);
            let (params, bodies) = (IntegrationParameters::default(), RigidBodySet::new());
            let mut checker = Checker::new(0.01).with(Shadow::Stock);
            let (colliders, modified) = (&colliders, &[pair.0, pair.1]);
            checker.watch(&Call { params: &params, colliders, bodies: &bodies, modified, removed: &[] }, &[]);
            let found: Vec<Fault> = checker.differences.iter().map(|d| d.fault).collect();
            assert_eq!((found.as_slice(), checker.stock_only), (faults, 1), "{y}");
        }
    }
}
