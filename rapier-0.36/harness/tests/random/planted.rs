//! A finder with a fault planted in it.

use rapier::geometry::{PairFinder, SceneQuery};
use rapier::parry::bounding_volume::Aabb;
use rapier::parry::partitioning::Bvh;
use rapier::prelude::*;
use rapier_pbig::PbigFinder;
use std::cell::Cell;
use std::collections::HashSet;

thread_local! {
    /// In the middle of a call of the finder, where a panic is ours and not rapier's.
    pub(crate) static BUSY: Cell<bool> = const { Cell::new(false) };
}

/// The fault of the finder under test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Plant {
    Nothing,
    /// The AABBs that a step has moved do not arrive.
    Unmoved,
    /// The third event of a call and those after it are lost.
    RoomForTwo,
    /// Nothing is listed as modified but what is new.
    OnlyNew,
}

/// A finder with a fault planted in front of it or behind.
#[derive(Clone)]
pub(crate) struct Planted {
    pub(crate) finder: PbigFinder,
    pub(crate) plant: Plant,
    pub(crate) known: HashSet<ColliderHandle>,
}

impl PairFinder for Planted {
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
        let is_new = |handle: &&ColliderHandle| self.plant != Plant::OnlyNew || self.known.insert(**handle);
        let shown: Vec<_> = modified.iter().filter(is_new).copied().collect();
        BUSY.set(true);
        self.finder.update(params, adaptive_margin, colliders, bodies, &shown, removed, events);
        BUSY.set(false);
        if self.plant == Plant::RoomForTwo {
            events.truncate(2);
        }
    }

    fn set_aabbs(
        &mut self,
        params: &IntegrationParameters,
        adaptive: bool,
        aabbs: &[(ColliderHandle, Aabb)],
    ) {
        if self.plant != Plant::Unmoved {
            BUSY.set(true);
            self.finder.set_aabbs(params, adaptive, aabbs);
            BUSY.set(false);
        }
    }

    fn tree(&self) -> &Bvh {
        self.finder.tree()
    }

    fn visit(&self, query: &SceneQuery, visit: &mut dyn FnMut(u32) -> Real) {
        self.finder.visit(query, visit);
    }

    fn state(&self) -> (Vec<(ColliderHandle, Aabb)>, Vec<(ColliderHandle, ColliderHandle)>) {
        self.finder.state()
    }

    fn start_from(&mut self, aabbs: Vec<(u32, Aabb)>, pairs: Vec<(ColliderHandle, ColliderHandle)>) {
        self.finder.start_from(aabbs, pairs);
    }

    fn clone_box(&self) -> Box<dyn PairFinder> {
        Box::new(self.clone())
    }
}
