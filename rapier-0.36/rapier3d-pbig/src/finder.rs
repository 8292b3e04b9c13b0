//! `PbigFinder`: translates rapier's calls into calls of the core.

use crate::scene::{Bounds, Call, handle, margins, to_event, to_handle, to_pair};
use crate::tree::{ParryTree, from_tree, spatial, to_tree};
use crate::{PairFinder, PbigConfig, SceneQuery};
use pbig_adapter::{Bounds as _, Colliders, HandlePair, Why};
use rapier::math::Real;
use rapier::parry::bounding_volume::Aabb as TreeAabb;
use rapier::parry::partitioning::Bvh;
use rapier::prelude::{
    BroadPhasePairEvent, ColliderHandle, ColliderPair, ColliderSet, IntegrationParameters, RigidBodySet,
};

/// Finds the pairs of a `BroadPhaseBvh` instead of its tree, and answers scene queries and CCD from an index
/// of boxes, which is brought up to date when something asks.
#[derive(Clone, Debug)]
pub struct PbigFinder {
    pub(crate) colliders: Colliders<ParryTree>,
    /// In units of `IntegrationParameters::length_unit`.
    pub(crate) relative_margin: f32,
}

impl PbigFinder {
    fn around(core: pbig_core::BroadPhase) -> Self {
        Self { relative_margin: core.config().margin, colliders: Colliders::new(core) }
    }

    /// Returns why these two colliders are a pair since the last update, or the first test that they fail.
    pub fn why(&self, one: ColliderHandle, other: ColliderHandle) -> Why {
        self.colliders.why(handle(one), handle(other))
    }
}

pbig_adapter::define_methods!(PbigFinder);

impl PairFinder for PbigFinder {
    fn update(
        &mut self,
        params: &IntegrationParameters,
        adaptive_margin: bool,
        colliders: &ColliderSet,
        bodies: &RigidBodySet,
        modified_colliders: &[ColliderHandle],
        removed_colliders: &[ColliderHandle],
        events: &mut Vec<BroadPhasePairEvent>,
    ) {
        let (modified, removed) = (modified_colliders, removed_colliders);
        let margins = margins(self.relative_margin, params, adaptive_margin);
        let call = Call { params, margins, colliders, bodies, modified, removed };
        if !self.colliders.skips(&call) {
            self.colliders.update(&call, &call.margins, |event| events.push(to_event(event)));
        }
    }

    fn set_aabbs(
        &mut self,
        params: &IntegrationParameters,
        adaptive_margin: bool,
        aabbs: &[(ColliderHandle, TreeAabb)],
    ) {
        let moved = aabbs.iter().map(|(moved, aabb)| (handle(*moved), from_tree(aabb)));
        self.colliders.set_aabbs(&margins(self.relative_margin, params, adaptive_margin), moved);
    }

    fn tree(&self) -> &Bvh {
        &self.colliders.tree().bvh
    }

    fn visit(&self, query: &SceneQuery, visit: &mut dyn FnMut(u32) -> Real) {
        use pbig_adapter::SceneQuery as Query;
        // A call for each kind, because one for all would first copy the query into memory, which takes as long as a ray that misses.
        match *query {
            SceneQuery::Ray(ray, time) => {
                let origin = spatial(ray.origin);
                let start = Bounds::from_corners(origin, origin);
                self.colliders.visit(&Query::Sweep(start, spatial(ray.dir), time), visit);
            }
            SceneQuery::Sweep(aabb, velocity, time) => {
                self.colliders.visit(&Query::Sweep(from_tree(aabb), spatial(*velocity), time), visit);
            }
            SceneQuery::Near(point, distance) => {
                self.colliders.visit(&Query::Near(spatial(*point), distance), visit);
            }
            SceneQuery::Overlap(aabb) => self.colliders.visit(&Query::Overlap(from_tree(aabb)), visit),
        }
    }

    fn state(&self) -> (Vec<(ColliderHandle, TreeAabb)>, Vec<(ColliderHandle, ColliderHandle)>) {
        let boxes = self.colliders.boxes().map(|(handle, aabb)| (to_handle(handle), to_tree(&aabb)));
        let pairs = self.colliders.pairs().chain(self.colliders.adopted().iter().copied());
        let sorted = pairs.map(|pair| HandlePair::sorted(pair.0, pair.1));
        let mut pairs: Vec<_> = sorted.map(|pair| (to_handle(pair.0), to_handle(pair.1))).collect();
        pairs.sort_unstable_by_key(|(a, b)| (a.into_raw_parts(), b.into_raw_parts()));
        (boxes.collect(), pairs)
    }

    fn start_from(&mut self, aabbs: Vec<(u32, TreeAabb)>, pairs: Vec<(ColliderHandle, ColliderHandle)>) {
        let pairs: Vec<_> = pairs.into_iter().map(|(a, b)| HandlePair(handle(a), handle(b))).collect();
        let boxes = aabbs.iter().map(|(id, aabb)| (*id, from_tree(aabb))).collect();
        // Sorted by index. Rapier's narrow phase reports ends in the order of the beginnings, so this order does not matter.
        self.colliders.adopt(pairs, boxes, false);
    }

    fn clone_box(&self) -> Box<dyn PairFinder> {
        Box::new(self.clone())
    }
}
