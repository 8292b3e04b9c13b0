//! The shadow checker: a broad phase under test, with rapier's own and the oracle beside it on the
//! same world, compared after every call.
//!
//! What it cannot see: a pair that only soft CCD would need (its boxes are those of the present pose),
//! and the order of events. Calls in which nothing is modified are followed but not compared.
//!
//! It keeps what the narrow phase believes, by following the events, and holds three things
//! against it: the oracle over boxes and filters taken straight from rapier's public functions, the
//! pairs that stock reports, and the rule that every pair has a reason. It shares no code with the
//! broad phase it checks.

use pbig_core::{Aabb, oracle};
use rapier3d::parry::query::{contact, distance};
use rapier3d::prelude::*;
use std::collections::{HashSet, VecDeque};
use std::fmt;

/// What is wrong with a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// Boxes overlap and filters allow the pair, but it was not reported.
    Missing,
    /// Only stock reports it, and parry finds a contact within the prediction distance.
    MissingContact,
    /// Reported, although the boxes are further apart than the margins, or a filter excludes it, or
    /// a collider is gone or disabled.
    Spurious,
    /// `AddPair` for a pair that is there.
    AddedTwice,
    /// `DeletePair` for a pair that is not there.
    DeletedUnknown,
    /// Deleted and added in one call: the narrow phase would lose the pair's contacts.
    Flickered,
    /// A pair of a collider with itself, at which rapier panics.
    WithItself,
}

impl Fault {
    /// Whether a pair should have been there and was not.
    pub fn is_missing(self) -> bool {
        matches!(self, Self::Missing | Self::MissingContact)
    }
}

/// A pair about which the broad phase is wrong.
#[derive(Clone, Debug)]
pub struct Difference {
    /// The call in which it was noticed, from 0.
    pub call: usize,
    /// What is wrong.
    pub fault: Fault,
    /// The pair.
    pub pair: (ColliderHandle, ColliderHandle),
    /// The boxes of both, without any margin.
    pub boxes: [Option<Aabb>; 2],
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let what = match self.fault {
            Fault::Missing => "missing: the boxes overlap and no filter excludes the pair",
            Fault::MissingContact => "missing: parry finds a contact within the prediction distance",
            Fault::Spurious => "spurious: the pair has no reason to be there",
            Fault::AddedTwice => "added twice",
            Fault::DeletedUnknown => "deleted without having been added",
            Fault::Flickered => "deleted and added again in one call",
            Fault::WithItself => "a collider paired with itself",
        };
        let index = |h: ColliderHandle| h.into_raw_parts();
        let ((a, b), [box_a, box_b]) = (self.pair, self.boxes);
        write!(
            f,
            "call {}: colliders {:?} and {:?}: {what}; boxes {box_a:?} and {box_b:?}",
            self.call,
            index(a),
            index(b)
        )
    }
}

type HandlePair = (ColliderHandle, ColliderHandle);

fn ordered(a: ColliderHandle, b: ColliderHandle) -> HandlePair {
    if a.into_raw_parts() <= b.into_raw_parts() { (a, b) } else { (b, a) }
}

/// The pairs that a narrow phase has after following some events.
#[derive(Default)]
struct Followed(HashSet<HandlePair>);

impl Followed {
    fn purge(&mut self, removed: &[ColliderHandle]) {
        if !removed.is_empty() {
            let gone: HashSet<_> = removed.iter().collect();
            self.0.retain(|(a, b)| !gone.contains(a) && !gone.contains(b));
        }
    }

    fn follow(&mut self, events: &[BroadPhasePairEvent], mut fault: impl FnMut(Fault, HandlePair)) {
        let mut deleted = HashSet::new();
        for event in events {
            let (pair, added) = match event {
                BroadPhasePairEvent::AddPair(pair) => (pair, true),
                BroadPhasePairEvent::DeletePair(pair) => (pair, false),
            };
            let pair = ordered(pair.collider1, pair.collider2);
            if pair.0 == pair.1 {
                fault(Fault::WithItself, pair);
            } else if added && !self.0.insert(pair) {
                fault(Fault::AddedTwice, pair);
            } else if !added && !self.0.remove(&pair) {
                fault(Fault::DeletedUnknown, pair);
            }
            if !added {
                deleted.insert(pair);
            } else if deleted.contains(&pair) {
                fault(Fault::Flickered, pair);
            }
        }
    }
}

/// How many frames before a fault are kept for a replay.
const FRAMES_KEPT: usize = 8;

/// A tee: passes on what the broad phase under test says, and checks it.
pub struct Shadow<B> {
    /// The broad phase under test.
    pub inner: B,
    /// Everything wrong so far, oldest first, at most a thousand.
    pub differences: Vec<Difference>,
    /// Boxes without margin by collider index, the last few calls.
    pub frames: VecDeque<Vec<Aabb>>,
    /// Calls that were checked.
    pub checked: usize,
    /// Pairs that the oracle found, in all calls.
    pub oracle_pairs: u64,
    /// Pairs that only stock reported, in all calls: excluded by a filter, or not in contact.
    pub stock_only: u64,
    stock: DefaultBroadPhase,
    known: Followed,
    stock_known: Followed,
    margin: f32,
    every: usize,
    calls: usize,
    /// Calls in which something was modified.
    comparable: usize,
}

impl<B: BroadPhase> Shadow<B> {
    /// Checks every call. `relative_margin` is the margin of the broad phase under test in units of
    /// `length_unit`: its pairs may be four of them apart, two for each box.
    pub fn new(inner: B, relative_margin: f32) -> Self {
        Self {
            inner,
            differences: Vec::new(),
            frames: VecDeque::new(),
            checked: 0,
            oracle_pairs: 0,
            stock_only: 0,
            stock: DefaultBroadPhase::new(),
            known: Followed::default(),
            stock_known: Followed::default(),
            margin: relative_margin,
            every: 1,
            calls: 0,
            comparable: 0,
        }
    }

    /// Compares in one of `every` calls that modify something; events are followed in all of them.
    pub fn every(self, every: usize) -> Self {
        Self { every: every.max(1), ..self }
    }

    fn note(&mut self, fault: Fault, pair: HandlePair, scene: &SceneView<'_>) {
        if self.differences.len() < 1000 {
            let boxes = [pair.0, pair.1].map(|handle| scene.aabb(handle));
            self.differences.push(Difference { call: self.calls, fault, pair, boxes });
        }
    }

    fn compare(&mut self, scene: &SceneView<'_>) {
        let mut faults = Vec::new();
        let wanted = scene.oracle();
        faults
            .extend(wanted.iter().filter(|pair| !self.known.0.contains(pair)).map(|&p| (Fault::Missing, p)));
        for &pair in self.stock_known.0.difference(&self.known.0) {
            self.stock_only += 1;
            if !wanted.contains(&pair) && scene.allowed(pair) && scene.in_contact(pair) {
                faults.push((Fault::MissingContact, pair));
            }
        }
        let baseless = |pair: &&HandlePair| !scene.may_pair(**pair, self.margin);
        faults.extend(self.known.0.iter().filter(baseless).map(|&pair| (Fault::Spurious, pair)));
        self.checked += 1;
        self.oracle_pairs += wanted.len() as u64;
        faults.sort_by_key(|(_, pair)| (pair.0.into_raw_parts(), pair.1.into_raw_parts()));
        faults.into_iter().for_each(|(fault, pair)| self.note(fault, pair, scene));
    }
}

impl<B: BroadPhase> BroadPhase for Shadow<B> {
    fn update(
        &mut self,
        params: &IntegrationParameters,
        colliders: &ColliderSet,
        bodies: &RigidBodySet,
        modified: &[ColliderHandle],
        removed: &[ColliderHandle],
        events: &mut Vec<BroadPhasePairEvent>,
    ) {
        let scene = SceneView { params, colliders, bodies };
        let start = events.len();
        self.inner.update(params, colliders, bodies, modified, removed, events);
        self.known.purge(removed);
        let mut faults = Vec::new();
        self.known.follow(&events[start..], |fault, pair| faults.push((fault, pair)));
        faults.into_iter().for_each(|(fault, pair)| self.note(fault, pair, &scene));

        let mut of_stock = Vec::new();
        self.stock.update(params, colliders, bodies, modified, removed, &mut of_stock);
        self.stock_known.purge(removed);
        self.stock_known.follow(&of_stock, |_, _| ());
        // Where nothing was modified, nothing but pairs of removed colliders may have changed.
        if !modified.is_empty() {
            self.frames.push_back(scene.boxes());
            while self.frames.len() > FRAMES_KEPT {
                self.frames.pop_front();
            }
            if self.comparable.is_multiple_of(self.every) {
                self.compare(&scene);
            }
            self.comparable += 1;
        }
        self.calls += 1;
    }
}

/// The world as a broad phase sees it, through rapier's own functions.
struct SceneView<'a> {
    params: &'a IntegrationParameters,
    colliders: &'a ColliderSet,
    bodies: &'a RigidBodySet,
}

impl SceneView<'_> {
    fn enabled(&self, handle: ColliderHandle) -> Option<&Collider> {
        self.colliders.get(handle).filter(|collider| collider.is_enabled())
    }

    fn aabb(&self, handle: ColliderHandle) -> Option<Aabb> {
        let collider = self.enabled(handle)?;
        let aabb = collider.compute_collision_aabb(self.params.prediction_distance() / 2.0);
        Some(Aabb::new(aabb.mins.coords.into(), aabb.maxs.coords.into()))
    }

    /// By collider index; nowhere where there is none.
    fn boxes(&self) -> Vec<Aabb> {
        let mut boxes = Vec::new();
        for (handle, _) in self.colliders.iter_enabled() {
            let index = handle.into_raw_parts().0 as usize;
            boxes.resize(boxes.len().max(index + 1), Aabb::NOWHERE);
            boxes[index] = self.aabb(handle).unwrap_or(Aabb::NOWHERE);
        }
        boxes
    }

    fn oracle(&self) -> HashSet<HandlePair> {
        let handles: Vec<ColliderHandle> = self.colliders.iter_enabled().map(|(handle, _)| handle).collect();
        let boxes: Vec<Aabb> = handles.iter().map(|&h| self.aabb(h).unwrap_or(Aabb::NOWHERE)).collect();
        let pair = |a: u32, b: u32| ordered(handles[a as usize], handles[b as usize]);
        let found = oracle::pairs_where(&boxes, |a, b| self.allowed(pair(a, b)));
        found.into_iter().map(|p| pair(p.a, p.b)).collect()
    }

    /// The narrow phase's own early filters, in its words.
    fn allowed(&self, (a, b): HandlePair) -> bool {
        let (Some(a), Some(b)) = (self.enabled(a), self.enabled(b)) else { return false };
        let kind = |c: &Collider| {
            let body = c.parent().and_then(|handle| self.bodies.get(handle));
            body.map_or(RigidBodyType::Fixed, |body| body.body_type())
        };
        let same_body = a.parent().is_some() && a.parent() == b.parent();
        let kinds = a.active_collision_types().test(kind(a), kind(b))
            || b.active_collision_types().test(kind(a), kind(b));
        !same_body && kinds && a.collision_groups().test(b.collision_groups())
    }

    /// Whether parry finds a contact at which rapier would look. Parry 0.22's contact query between
    /// a cuboid and a compound can report a penetration where they are 0.08 apart (seen in the scene
    /// `compounds`), so its distance query has a say too. Shapes that parry cannot compare count by
    /// their boxes.
    fn in_contact(&self, (a, b): HandlePair) -> bool {
        let (Some(x), Some(y)) = (self.enabled(a), self.enabled(b)) else { return false };
        let reach = self.params.prediction_distance() + x.contact_skin() + y.contact_skin();
        let apart = distance(x.position(), x.shape(), y.position(), y.shape());
        match contact(x.position(), x.shape(), y.position(), y.shape(), reach) {
            Ok(found) => found.is_some() && !apart.is_ok_and(|length| length > reach),
            Err(_) => matches!((self.aabb(a), self.aabb(b)), (Some(a), Some(b)) if a.overlaps(&b)),
        }
    }

    /// Whether a pair has a reason: both there, allowed, and near enough for a margin on each box.
    /// With soft CCD boxes reach further; such pairs are not judged.
    fn may_pair(&self, (a, b): HandlePair, relative_margin: f32) -> bool {
        let soft_ccd = |handle: ColliderHandle| {
            let body = self.enabled(handle).and_then(Collider::parent).and_then(|body| self.bodies.get(body));
            body.is_some_and(|body| body.soft_ccd_prediction() > 0.0)
        };
        let (Some(box_a), Some(box_b)) = (self.aabb(a), self.aabb(b)) else { return false };
        // A thousandth more than two margins for the rounding of each inflation.
        let reach = 2.001 * relative_margin * self.params.length_unit;
        let near = inflated_by_more(&box_a, reach).overlaps(&inflated_by_more(&box_b, reach));
        self.allowed((a, b)) && (near || soft_ccd(a) || soft_ccd(b))
    }
}

/// Inflated, and by an ulp at least.
fn inflated_by_more(aabb: &Aabb, reach: f32) -> Aabb {
    let grown = aabb.inflated(reach);
    Aabb::new(grown.min.map(f32::next_down), grown.max.map(f32::next_up))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two balls of radius 0.5 with this distance between their centres.
    fn balls(apart: f32) -> (ColliderSet, HandlePair) {
        let mut colliders = ColliderSet::new();
        let mut ball = |x: f32| {
            let types = ActiveCollisionTypes::all();
            colliders.insert(
                ColliderBuilder::ball(0.5).translation(vector![x, 0.0, 0.0]).active_collision_types(types),
            )
        };
        let pair = ordered(ball(0.0), ball(apart));
        (colliders, pair)
    }

    fn with_scene<T>(apart: f32, look: impl Fn(&SceneView<'_>, HandlePair) -> T) -> T {
        let (colliders, pair) = balls(apart);
        let (params, bodies) = (IntegrationParameters::default(), RigidBodySet::new());
        look(&SceneView { params: &params, colliders: &colliders, bodies: &bodies }, pair)
    }

    #[test]
    fn contact_is_touch_or_less_than_a_prediction_distance_apart() {
        for (apart, contact) in [(0.9, true), (1.0, true), (1.0015, true), (1.01, false), (5.0, false)] {
            assert_eq!(with_scene(apart, |scene, pair| scene.in_contact(pair)), contact, "{apart}");
        }
    }

    #[test]
    fn a_pair_may_be_two_margins_a_box_apart_and_no_more() {
        for (apart, may) in [(1.0, true), (1.04, true), (1.05, false)] {
            assert_eq!(with_scene(apart, |scene, pair| scene.may_pair(pair, 0.01)), may, "{apart}");
        }
    }

    #[test]
    fn a_missing_pair_is_one_fault_although_stock_has_it_too() {
        let (colliders, pair) = balls(1.0);
        let (params, bodies) = (IntegrationParameters::default(), RigidBodySet::new());
        let mut shadow = Shadow::new(DefaultBroadPhase::new(), 0.01);
        shadow.stock_known.0.insert(pair);
        let scene = SceneView { params: &params, colliders: &colliders, bodies: &bodies };
        shadow.compare(&scene);
        assert_eq!(shadow.differences.first().map(|d| d.fault), Some(Fault::Missing));
        assert_eq!(shadow.differences.len(), 1);
    }
}
