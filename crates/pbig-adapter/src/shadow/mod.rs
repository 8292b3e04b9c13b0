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
mod stock;

pub use difference::{Difference, Fault, Side};
pub use replay::{ReplayError, write_frames};
pub use stock::Stock;

use crate::{Bounds, Handle, HandlePair, PairEvent, Scene, policy};
use followed::Followed;
use pbig_core::{Aabb, oracle as brute_force};
use std::collections::{HashSet, VecDeque};
use std::path::PathBuf;

/// The reference that a broad phase is compared with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shadow {
    /// Rapier's own broad phase on the same world. A pair that only stock reports must not be in contact.
    Stock,
    /// Brute force over the AABBs: every overlapping pair that no filter excludes must be reported. Quadratic: 0.1 s a call
    /// with 10,000 colliders.
    Oracle,
}

/// A world as a [`Checker`] sees it, through rapier's own functions.
pub trait View: Scene {
    /// Returns the enabled colliders.
    fn enabled(&self) -> Vec<Handle>;
    /// Returns a collider.
    fn side(&self, handle: Handle) -> Option<Side>;
    /// Returns the AABB of an enabled collider, without margin.
    fn aabb(&self, handle: Handle) -> Option<Self::Aabb>;
    /// Applies the filters that the narrow phase applies before it computes contacts. False if a collider is not enabled.
    fn allowed(&self, pair: HandlePair) -> bool;
    /// Returns true if parry finds a contact within rapier's prediction distance.
    fn in_contact(&self, pair: HandlePair) -> bool;
    /// Returns true if the AABB is larger than [`View::aabb`] tells: soft CCD reaches further.
    fn reaches_further(&self, handle: Handle) -> bool;
}

/// The call of a broad phase.
pub struct Watched<'a, V> {
    /// The world.
    pub view: &'a V,
    /// The largest margin of a box. The AABBs of a pair may be four margins apart, two for each box.
    pub margin: f32,
    /// True if the step has moved something since the last call.
    pub has_moved: bool,
    /// The events of the broad phase.
    pub events: &'a [PairEvent],
    /// The events of rapier's own broad phase, if it is a reference; none once it has panicked.
    pub stock: Option<&'a [PairEvent]>,
}

/// Follows the calls and events of a broad phase, and compares its pairs with the references; the default has none.
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
    stock: Option<Followed>,
    oracle: bool,
    folder: Option<PathBuf>,
    known: Followed,
    /// One call in this many is compared; 0 means 1.
    every: usize,
    calls: usize,
    /// Calls in which something was modified.
    comparable: usize,
    /// True before the first call on another world.
    fresh: bool,
}

impl Checker {
    /// Adds a reference.
    pub fn with(mut self, shadow: Shadow) -> Self {
        self.add(shadow);
        self
    }

    /// Like [`Checker::with`], in place.
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

    /// Writes the AABBs of the calls up to the first difference into the system's folder for temporary files, which
    /// wasm32-unknown-unknown lacks.
    pub fn with_replays(self) -> Self {
        let has_folder = !cfg!(all(target_family = "wasm", target_os = "unknown"));
        Self { folder: has_folder.then(std::env::temp_dir), ..self }
    }

    /// Prepares for another world, or for one that already has pairs. `pairs` are the narrow phase's. Stock must see all colliders
    /// in the next call.
    pub fn start_over(&mut self, pairs: impl IntoIterator<Item = HandlePair>) {
        self.known = Followed::of(pairs);
        self.fresh = true;
        if let Some(stock) = &mut self.stock {
            *stock = Followed::default();
        }
    }

    /// Returns true if stock is a reference.
    pub fn has_stock(&self) -> bool {
        self.stock.is_some()
    }

    /// Checks a call that the broad phase has just answered.
    pub fn watch(&mut self, call: &Watched<'_, impl View>) {
        let mut faults = Vec::new();
        let removed: Vec<Handle> = call.view.removed().map(|(handle, _)| handle).collect();
        self.known.purge(&removed);
        self.known.follow(call.events, |fault, pair| faults.push((fault, pair)));
        if let (Some(stock), Some(events)) = (&mut self.stock, call.stock) {
            stock.purge(&removed);
            stock.follow(events, |_, _| ());
        }
        // If nothing was modified, only pairs of removed colliders can have changed.
        let fresh = std::mem::take(&mut self.fresh);
        let is_modified = call.has_moved || call.view.listed_count() > 0;
        if fresh || is_modified || !call.events.is_empty() {
            self.keep_frame(call.view);
            if self.comparable.is_multiple_of(self.every.max(1)) {
                self.compare(call, &mut faults);
            }
            self.comparable += 1;
        }
        let first = self.differences.is_empty();
        faults.into_iter().for_each(|(fault, pair)| self.note(fault, pair, call.view));
        if first && !self.differences.is_empty() {
            self.report_first();
        }
        self.calls += 1;
    }

    fn keep_frame(&mut self, view: &impl View) {
        self.frames.push_back(boxes(view));
        while self.frames.len() > policy::REPLAY_FRAMES {
            self.frames.pop_front();
        }
    }

    fn note(&mut self, fault: Fault, pair: HandlePair, view: &impl View) {
        let noted = |one: &Difference| (one.fault, one.pair) == (fault, pair);
        if self.differences.len() < policy::MAX_DIFFERENCES && !self.differences.iter().any(noted) {
            let sides = [pair.0, pair.1].map(|handle| view.side(handle));
            self.differences.push(Difference { call: self.calls, fault, pair, sides, replay: None });
        }
    }

    fn compare(&mut self, call: &Watched<'_, impl View>, faults: &mut Vec<(Fault, HandlePair)>) {
        let (from, view) = (faults.len(), call.view);
        let wanted = if self.oracle { oracle(view) } else { HashSet::new() };
        faults.extend(wanted.difference(&self.known.0).map(|&pair| (Fault::Missing, pair)));
        if let (Some(stock), Some(_)) = (&self.stock, call.stock) {
            for &pair in stock.0.difference(&self.known.0) {
                self.stock_only += 1;
                if !wanted.contains(&pair) && view.allowed(pair) && view.in_contact(pair) {
                    faults.push((Fault::MissingContact, pair));
                }
            }
        }
        let baseless = |pair: &&HandlePair| !may_pair(view, **pair, call.margin);
        faults.extend(self.known.0.iter().filter(baseless).map(|&pair| (Fault::Spurious, pair)));
        self.compared += 1;
        self.oracle_pairs += wanted.len() as u64;
        faults[from..].sort_by_key(|(_, pair)| *pair);
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

/// Returns the AABBs by collider index, and [`Aabb::NOWHERE`] for an unused index.
fn boxes(view: &impl View) -> Vec<Aabb> {
    let mut boxes = Vec::new();
    for handle in view.enabled() {
        let i = handle.index as usize;
        boxes.resize(boxes.len().max(i + 1), Aabb::NOWHERE);
        boxes[i] = view.aabb(handle).map_or(Aabb::NOWHERE, |aabb| aabb.to_f32());
    }
    boxes
}

fn oracle(view: &impl View) -> HashSet<HandlePair> {
    let handles = view.enabled();
    let wide: Vec<_> = handles.iter().map(|&handle| view.aabb(handle)).collect();
    let boxes: Vec<_> = wide.iter().map(|aabb| aabb.map_or(Aabb::NOWHERE, |aabb| aabb.to_f32())).collect();
    let meet =
        |a: u32, b: u32| matches!((wide[a as usize], wide[b as usize]), (Some(a), Some(b)) if a.overlaps(&b));
    let pair = |a: u32, b: u32| HandlePair::sorted(handles[a as usize], handles[b as usize]);
    let found = brute_force::pairs_where(&boxes, |a, b| meet(a, b) && view.allowed(pair(a, b)));
    found.into_iter().map(|p| pair(p.a, p.b)).collect()
}

/// Returns true if a pair has a reason: both colliders exist, the filters allow it, and the AABBs are near enough. AABBs with
/// soft CCD reach further, so such pairs always pass.
fn may_pair(view: &impl View, pair: HandlePair, margin: f32) -> bool {
    let (Some(a), Some(b)) = (view.aabb(pair.0), view.aabb(pair.1)) else { return false };
    // A thousandth more than two margins for the rounding of each inflation.
    let reach = 2.001 * margin;
    let near = a.grown(reach).overlaps(&b.grown(reach));
    view.allowed(pair) && (near || view.reaches_further(pair.0) || view.reaches_further(pair.1))
}
