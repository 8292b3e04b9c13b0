//! The boxes of pbig: one for each proxy in avian's trees.

use crate::lost::Lost;
use crate::waiting::Waiting;
use avian::collider_tree::{
    ColliderTreeProxy, ColliderTreeProxyKey, ColliderTreeType, ColliderTrees, MovedProxies,
};
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
    pub(crate) update: u32,
}

/// A collider with a box.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Slot {
    pub(crate) key: ColliderTreeProxyKey,
    pub(crate) collider: Entity,
    /// Last update in which the proxy moved, by avian's list.
    pub(crate) moved_in: u32,
}

/// The query for the proxies of colliders that take part in collisions.
pub(crate) type ProxyKeys<'w, 's> =
    Query<'w, 's, &'static ColliderTreeProxyKey, Without<avian::prelude::ColliderDisabled>>;

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
        let collider = |id: u32| self.slots[id as usize].collider;
        self.broad_phase.pairs().map(move |pair| (collider(pair.a), collider(pair.b)))
    }

    /// Brings the boxes up to date with avian's trees.
    pub(crate) fn follow(
        &mut self,
        trees: &ColliderTrees,
        moved: &MovedProxies,
        lost: &mut Lost,
        keys: &ProxyKeys<'_, '_>,
    ) -> Result<(), Error> {
        self.update = self.update.wrapping_add(1);
        self.moved.clear();
        // Avian names each proxy once. So all are set, even if one of them fails.
        let mut all = self.begin_anew(trees, lost, keys);
        for &key in moved.proxies() {
            all = all.and(self.set(trees, key).map(|id| id.into_iter().for_each(|id| self.note_moved(id))));
        }
        all
    }

    /// Removes the boxes of colliders that have lost their contacts, and sets those that still have a proxy.
    fn begin_anew(
        &mut self,
        trees: &ColliderTrees,
        lost: &mut Lost,
        keys: &ProxyKeys<'_, '_>,
    ) -> Result<(), Error> {
        if lost.0.is_empty() {
            return Ok(());
        }
        let lost = std::mem::take(&mut lost.0);
        lost.iter().for_each(|&collider| self.remove(collider));
        let mut all = Ok(());
        for collider in lost {
            let Ok(&key) = keys.get(collider) else { continue };
            if trees.get_proxy(key).is_some_and(|proxy| proxy.collider == collider) {
                all = all.and(self.set(trees, key).map(|_| ()));
            }
        }
        all
    }

    /// Sets the box of a proxy, and returns its id. Returns none if the key is out of date.
    fn set(&mut self, trees: &ColliderTrees, key: ColliderTreeProxyKey) -> Result<Option<u32>, Error> {
        let tree = trees.tree_for_type(key.tree_type());
        let (Some(proxy), Some(aabb)) = (tree.get_proxy(key.id()), tree.get_proxy_aabb(key.id())) else {
            return Ok(None);
        };
        let id = self.id_of(proxy.collider, key);
        let [min, max] = [aabb.min, aabb.max].map(|corner| [corner.x, corner.y, corner.z]);
        self.broad_phase.set(id, Aabb::new(min, max), filter(key, proxy))?;
        Ok(Some(id))
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
        let slot = Slot { key, collider, moved_in: self.update.wrapping_sub(1) };
        self.ids[index] = self.insert(slot);
        self.ids[index]
    }

    fn insert(&mut self, slot: Slot) -> u32 {
        if let Some(id) = self.free.pop() {
            self.slots[id as usize] = slot;
            return id;
        }
        self.slots.push(slot);
        self.slots.len() as u32 - 1
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

    /// Appends the pairs that have begun since the last update.
    pub(crate) fn find(&mut self, begun: &mut Vec<Pair>) -> Result<(), Error> {
        let events = self.broad_phase.update()?;
        events.removed.iter().for_each(|pair| self.without_contact.remove(pair));
        begun.extend_from_slice(&events.added);
        Ok(())
    }

    /// Adds the pairs without a contact of which one proxy moved, and sorts the pairs.
    pub(crate) fn add_waiting(&self, pairs: &mut Vec<Pair>) {
        self.without_contact.list(&self.moved, |id| self.has_moved(id), pairs);
        pairs.sort_unstable();
        pairs.dedup();
    }

    fn note_moved(&mut self, id: u32) {
        self.slots[id as usize].moved_in = self.update;
        self.moved.push(id);
    }

    /// Returns true if the proxy with this id moved in this update.
    pub(crate) fn has_moved(&self, id: u32) -> bool {
        self.slots[id as usize].moved_in == self.update
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
