//! The boxes of pbig: one for each proxy in avian's trees.

use crate::collect::StepInput;
use crate::waiting::Waiting;
use avian::collider_tree::{ColliderTreeProxy, ColliderTreeProxyKey, ColliderTreeType, ColliderTrees};
use bevy::prelude::*;
use pbig_core::{Aabb, BroadPhase, Error, Pair, ProxyFilter, Report};

/// The id of a collider that has no box.
const NO_ID: u32 = u32::MAX;

/// The boxes of all colliders, and the pairs between them.
#[derive(Resource, Default)]
pub struct ColliderBoxes {
    broad_phase: BroadPhase,
    /// By id.
    pub(crate) slots: Vec<Slot>,
    free: Vec<u32>,
    /// By index of the collider's entity: its id.
    ids: Vec<u32>,
    pub(crate) without_contact: Waiting,
    /// Ids of the proxies that moved in this update.
    moved: Vec<u32>,
}

/// A collider with a box.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Slot {
    pub(crate) key: ColliderTreeProxyKey,
    pub(crate) collider: Entity,
    /// The proxy moved in this update, by avian's list.
    pub(crate) has_moved: bool,
}

impl ColliderBoxes {
    /// Returns a report of the last update.
    pub fn report(&self) -> &Report {
        self.broad_phase.report()
    }

    /// Returns the number of boxes.
    pub fn len(&self) -> usize {
        self.broad_phase.len()
    }

    /// Returns true if there is no box.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Iterates over the colliders of all pairs whose boxes overlap and whose filters allow it, in the order of their ids. Joints
    /// and hooks may forbid some of them.
    pub fn pairs(&self) -> impl Iterator<Item = (Entity, Entity)> + '_ {
        self.broad_phase.pairs().map(|pair| self.colliders(pair))
    }

    /// Returns the colliders of a pair.
    pub(crate) fn colliders(&self, pair: Pair) -> (Entity, Entity) {
        let [a, b] = [pair.a, pair.b].map(|id| self.slots[id as usize].collider);
        (a, b)
    }

    /// Brings the boxes up to date with avian's trees. Colliders that have lost their contacts begin anew: their boxes are removed, and
    /// set again where they still have a proxy.
    pub(crate) fn follow(&mut self, input: &mut StepInput) -> Result<(), Error> {
        self.moved.drain(..).for_each(|id| self.slots[id as usize].has_moved = false);
        let lost = std::mem::take(&mut input.lost.0);
        lost.iter().for_each(|&collider| self.remove(collider));
        let trees = &input.trees;
        let key = |collider| {
            let key = *input.keys.get(collider).ok()?;
            trees.get_proxy(key).is_some_and(|proxy| proxy.collider == collider).then_some((key, false))
        };
        let moved = input.moved.proxies().iter().map(|&key| (key, true));
        // Avian names each proxy once. So all are set, even if one of them fails.
        let set = |all: Result<(), Error>, (key, has_moved)| all.and(self.set(trees, key, has_moved));
        lost.into_iter().filter_map(key).chain(moved).fold(Ok(()), set)
    }

    /// Sets the box of a proxy, unless the key is out of date.
    fn set(
        &mut self,
        trees: &ColliderTrees,
        key: ColliderTreeProxyKey,
        has_moved: bool,
    ) -> Result<(), Error> {
        let tree = trees.tree_for_type(key.tree_type());
        let (Some(proxy), Some(aabb)) = (tree.get_proxy(key.id()), tree.get_proxy_aabb(key.id())) else {
            return Ok(());
        };
        let id = self.id_of(proxy.collider, key);
        let [min, max] = [aabb.min, aabb.max].map(|corner| [corner.x, corner.y, corner.z]);
        self.broad_phase.set(id, Aabb::new(min, max), filter(key, proxy))?;
        if has_moved {
            self.slots[id as usize].has_moved = true;
            self.moved.push(id);
        }
        Ok(())
    }

    /// Returns the id of a collider; a new one if it has none.
    fn id_of(&mut self, collider: Entity, key: ColliderTreeProxyKey) -> u32 {
        let index = collider.index_u32() as usize;
        if self.ids.len() <= index {
            self.ids.resize(index + 1, NO_ID);
        }
        let id = self.ids[index];
        if let Some(slot) = self.slots.get_mut(id as usize) {
            slot.key = key;
            return id;
        }
        let (slot, id) = (Slot { key, collider, has_moved: false }, self.free.pop());
        let id = id.unwrap_or(self.slots.len() as u32);
        self.slots.resize(self.slots.len().max(id as usize + 1), slot);
        (self.slots[id as usize], self.ids[index]) = (slot, id);
        id
    }

    /// Removes the box of a collider, if it has one. Its id is free.
    fn remove(&mut self, collider: Entity) {
        let Some(id) = self.ids.get_mut(collider.index_u32() as usize) else { return };
        let id = std::mem::replace(id, NO_ID);
        if id != NO_ID {
            self.free.push(id);
            self.broad_phase.remove(id);
            self.without_contact.forget(id);
        }
    }

    /// Returns the pairs that have begun since the last update, and those without a contact of which one proxy moved, sorted.
    pub(crate) fn find(&mut self) -> (Vec<Pair>, Result<(), Error>) {
        let mut pairs = Vec::new();
        let found = self.broad_phase.update().map(|events| {
            events.removed.iter().for_each(|pair| self.without_contact.set(*pair, false));
            pairs.extend_from_slice(&events.added);
        });
        self.without_contact.list(&self.moved, |id| self.slots[id as usize].has_moved, &mut pairs);
        pairs.sort_unstable();
        pairs.dedup();
        (pairs, found)
    }
}

/// Returns the filter of a proxy: layers, body, and the trees that avian searches for it.
fn filter(key: ColliderTreeProxyKey, proxy: &ColliderTreeProxy) -> ProxyFilter {
    let (kind, accepted_kinds) = kinds(key.tree_type(), proxy.is_sensor());
    ProxyFilter {
        body: proxy.body.map_or(ProxyFilter::NO_BODY, |body| body.index_u32()),
        kind,
        accepted_kinds,
        memberships: proxy.layers.memberships.0,
        mask: proxy.layers.filters.0,
        ..ProxyFilter::ALL
    }
}

/// Returns the kind of a proxy, and the kinds that it accepts. Static colliders pair with each other only if one is a sensor,
/// and standalone ones never do.
fn kinds(tree: ColliderTreeType, is_sensor: bool) -> (u8, u8) {
    const STATIC: u8 = 1 << ColliderTreeType::Static as u8;
    const STANDALONE: u8 = 1 << ColliderTreeType::Standalone as u8;
    const STATIC_SENSOR: u8 = 1 << 4;
    match tree {
        ColliderTreeType::Static if is_sensor => (STATIC_SENSOR, u8::MAX),
        ColliderTreeType::Static => (STATIC, 0),
        ColliderTreeType::Standalone => (STANDALONE, !STANDALONE),
        moving => (1 << moving as u8, u8::MAX),
    }
}
