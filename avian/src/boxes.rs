//! The boxes of pbig: one for each proxy in avian's trees.

use avian::collider_tree::{
    ColliderTreeProxy, ColliderTreeProxyKey, ColliderTreeType, ColliderTrees, MovedProxies,
};
use bevy::ecs::change_detection::Tick;
use bevy::ecs::entity_disabling::Disabled;
use bevy::prelude::*;
use pbig_core::{Aabb, BroadPhase, Error, Pair, ProxyFilter};
use std::collections::BTreeSet;

/// The keys of the proxies of all colliders. One without a proxy has a key that no tree knows.
pub(crate) type Keys<'w, 's> = Query<'w, 's, &'static ColliderTreeProxyKey, Allow<Disabled>>;

/// Pairs, each as it is and turned, so that those of an id are a range.
type Waiting = BTreeSet<[u32; 2]>;

/// The boxes of all colliders, and the pairs between them.
#[derive(Resource, Default)]
pub struct ColliderBoxes {
    broad_phase: BroadPhase,
    /// By id.
    slots: Vec<Slot>,
    free: Vec<u32>,
    /// By index of the collider's entity: its id.
    ids: Vec<Option<u32>>,
    /// Ids of the proxies that moved in this update.
    moved: Vec<u32>,
    /// Colliders that begin anew in the next update.
    pub(crate) lost: BTreeSet<Entity>,
    /// When avian had last written to its list of moved proxies, at the last update.
    pub(crate) moved_at: Tick,
    /// Overlapping pairs that a joint or a hook vetoes, or that nobody asked for since their contact was removed.
    pub(crate) waiting: Waiting,
}

/// A collider with a box.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Slot {
    pub(crate) key: ColliderTreeProxyKey,
    pub(crate) collider: Entity,
    /// Where the proxy is in avian's list of those that moved in this update.
    pub(crate) moved: Option<u32>,
}

impl Slot {
    /// Returns the collider's proxy, unless the key is out of date.
    pub(crate) fn proxy<'t>(&self, trees: &'t ColliderTrees) -> Option<&'t ColliderTreeProxy> {
        trees.get_proxy(self.key).filter(|proxy| proxy.collider == self.collider)
    }
}

impl ColliderBoxes {
    /// Returns the boxes by id, and the report of the last update.
    pub fn broad_phase(&self) -> &BroadPhase {
        &self.broad_phase
    }

    /// Iterates over the colliders of all pairs whose boxes overlap and whose filters allow it, in the order of their ids. Joints
    /// and hooks may forbid some of them.
    pub fn pairs(&self) -> impl Iterator<Item = (Entity, Entity)> + '_ {
        self.broad_phase.pairs().map(|pair| self.slots(pair).map(|slot| slot.collider).into())
    }

    /// Returns both sides of a pair.
    pub(crate) fn slots(&self, pair: Pair) -> [Slot; 2] {
        [pair.a, pair.b].map(|id| self.slots[id as usize])
    }

    /// Brings the boxes up to date with avian's trees. Returns the pairs to ask about, in the order of their ids: those that have
    /// begun, and waiting ones of which a proxy moved. Those that stay without a contact must wait again.
    pub(crate) fn update(&mut self, trees: &ColliderTrees, moved: &MovedProxies, keys: &Keys) -> Vec<Pair> {
        let followed = self.follow(trees, moved, keys);
        let found = self.broad_phase.update().map(drop);
        if let Err(error) = followed.and(found) {
            error!("pbig: {}; some pairs that began in this step are not found yet", in_words(&error));
        }
        let events = self.broad_phase.events();
        let has_moved = |id: u32| self.slots[id as usize].moved.is_some();
        events.removed.iter().flat_map(ends).for_each(|end| _ = self.waiting.remove(&end));
        let again = waiting_of_moved(&self.waiting, &self.moved, has_moved);
        again.iter().flat_map(ends).for_each(|end| _ = self.waiting.remove(&end));
        let mut pairs: Vec<_> = again.into_iter().chain(events.added.iter().copied()).collect();
        pairs.sort_unstable();
        pairs.dedup();
        pairs
    }

    /// Sets the boxes of moved proxies. Colliders that have lost their contacts begin anew: their boxes are removed, and set again
    /// where they still have a proxy.
    fn follow(&mut self, trees: &ColliderTrees, moved: &MovedProxies, keys: &Keys) -> Result<(), Error> {
        self.moved.drain(..).for_each(|id| self.slots[id as usize].moved = None);
        let lost = std::mem::take(&mut self.lost);
        lost.iter().for_each(|&collider| self.remove(collider));
        let anew = |collider| Some(Slot { key: *keys.get(collider).ok()?, collider, moved: None });
        let at = |(at, &key)| Some(Slot { key, collider: trees.get_proxy(key)?.collider, moved: Some(at) });
        let slots = lost.into_iter().filter_map(anew).chain((0..).zip(moved.proxies()).filter_map(at));
        // Avian names each proxy once. So the others are set even if one of them fails.
        slots.map(|slot| self.set(trees, slot)).reduce(Result::and).unwrap_or(Ok(()))
    }

    /// Sets the box of a collider, unless its key is out of date.
    fn set(&mut self, trees: &ColliderTrees, slot: Slot) -> Result<(), Error> {
        let aabb = trees.tree_for_type(slot.key.tree_type()).get_proxy_aabb(slot.key.id());
        let Some((proxy, aabb)) = slot.proxy(trees).zip(aabb) else { return Ok(()) };
        let id = self.store(slot);
        if slot.moved.is_some() {
            self.moved.push(id);
        }
        self.broad_phase.set(id, Aabb::new(aabb.min.into(), aabb.max.into()), filter(slot.key, proxy))
    }

    /// Stores a collider's slot. Returns its id; a new one if it has none.
    fn store(&mut self, slot: Slot) -> u32 {
        let index = slot.collider.index_u32() as usize;
        self.ids.resize(self.ids.len().max(index + 1), None);
        let new_id = || self.free.pop().unwrap_or(self.slots.len() as u32);
        let id = *self.ids[index].get_or_insert_with(new_id);
        self.slots.resize(self.slots.len().max(id as usize + 1), slot);
        self.slots[id as usize] = slot;
        id
    }

    /// Removes the box of a collider, if it has one. Its id is free.
    fn remove(&mut self, collider: Entity) {
        let id = self.ids.get_mut(collider.index_u32() as usize).and_then(Option::take);
        let Some(id) = id else { return };
        // Pairs of a removed box end without an event.
        let pairs: Vec<_> = waiting_of(&self.waiting, id).collect();
        pairs.iter().flat_map(ends).for_each(|end| _ = self.waiting.remove(&end));
        self.broad_phase.remove(id);
        self.free.push(id);
    }
}

/// Returns a pair as it is, and turned.
pub(crate) fn ends(pair: &Pair) -> [[u32; 2]; 2] {
    [[pair.a, pair.b], [pair.b, pair.a]]
}

/// Returns the waiting pairs of an id.
fn waiting_of(waiting: &Waiting, id: u32) -> impl Iterator<Item = Pair> + '_ {
    waiting.range([id, 0]..=[id, u32::MAX]).map(|&[one, other]| Pair::new(one, other))
}

/// Returns the waiting pairs with a moved id, in no order, perhaps twice. The work follows the smaller number: moved ids and their
/// waiting pairs, or all waiting pairs.
fn waiting_of_moved(waiting: &Waiting, moved: &[u32], has_moved: impl Fn(u32) -> bool) -> Vec<Pair> {
    if 2 * moved.len() < waiting.len() {
        moved.iter().flat_map(|&id| waiting_of(waiting, id)).collect()
    } else {
        let of_moved = waiting.iter().filter(|[id, _]| has_moved(*id));
        of_moved.map(|&[one, other]| Pair::new(one, other)).collect()
    }
}

/// Returns the filter of a proxy: layers, body, and the trees that avian searches for it. Static colliders pair with each other
/// only if one is a sensor, and colliders without a body never do. `ColliderOf` may name an entity that is no body: then the
/// filter leaves the owner out, because a later entity may have its index.
fn filter(key: ColliderTreeProxyKey, proxy: &ColliderTreeProxy) -> ProxyFilter {
    // Kinds: 1 moves, or is a static sensor; 2 is static; 4 has no body.
    let (kind, accepted_kinds) = match key.tree_type() {
        ColliderTreeType::Static if !proxy.is_sensor() => (2, 0),
        ColliderTreeType::Standalone if proxy.body.is_none() => (4, !4),
        _ => (1, u8::MAX),
    };
    let body = proxy.body.filter(|_| !key.is_standalone());
    ProxyFilter {
        body: body.map_or(ProxyFilter::NO_BODY, |body| body.index_u32()),
        kind,
        accepted_kinds,
        memberships: proxy.layers.memberships.0,
        mask: proxy.layers.filters.0,
        ..ProxyFilter::ALL
    }
}

/// Returns an error in words. The core's own words ask for larger limits, which the plug-in has no setting for.
fn in_words(error: &Error) -> String {
    match error {
        Error::TooManyBoxes { limit, .. } => format!("the plug-in takes at most {limit} colliders"),
        Error::TooManyPairs { limit } => format!("the plug-in keeps at most {limit} overlapping pairs"),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    fn collider(index: u32) -> Entity {
        Entity::from_raw_u32(index).expect("an index")
    }

    fn set(boxes: &mut ColliderBoxes, index: u32, place: u32) -> u32 {
        let key = ColliderTreeProxyKey::PLACEHOLDER;
        let id = boxes.store(Slot { key, collider: collider(index), moved: None });
        let aabb = Aabb::from_center([2.0 * place as f32, 0.0, 0.0], [0.5; 3]);
        boxes.broad_phase.set(id, aabb, ProxyFilter::ALL).expect("a box");
        id
    }

    fn update(boxes: &mut ColliderBoxes) -> Vec<Pair> {
        let mut world = World::new();
        let mut keys = world.query_filtered::<&ColliderTreeProxyKey, _>();
        boxes.update(&ColliderTrees::default(), &MovedProxies::default(), &keys.query(&world))
    }

    /// Makes boxes in places on a line, by id. Those in one place are pairs, and all pairs wait.
    fn waiting(places: impl IntoIterator<Item = u32>) -> ColliderBoxes {
        let mut boxes = ColliderBoxes::default();
        (0..).zip(places).for_each(|(index, place)| assert_eq!(set(&mut boxes, index, place), index));
        boxes.waiting = update(&mut boxes).iter().flat_map(ends).collect();
        boxes
    }

    /// Returns the waiting pairs of moved ids, sorted, and how often a waiting pair was looked at.
    fn of_moved(waiting: &Waiting, moved: &[u32]) -> (Vec<Pair>, usize) {
        let asked = Cell::new(0);
        let has_moved = |id| {
            asked.set(asked.get() + 1);
            moved.contains(&id)
        };
        let mut pairs = waiting_of_moved(waiting, moved, has_moved);
        pairs.sort_unstable();
        pairs.dedup();
        (pairs, asked.get())
    }

    #[test]
    fn both_ways_to_list_pairs_give_those_of_the_moved_ids() {
        let pairs: Vec<_> = (0..20).flat_map(|a| (a + 1..20).map(move |b| Pair { a, b })).collect();
        let pairs: Vec<_> =
            pairs.into_iter().filter(|pair| pair.a < 9 && pair.b >= 9 && pair.a + pair.b != 15).collect();
        let waiting = pairs.iter().flat_map(ends).collect();
        // Few moved ids are looked up, many are compared with every pair.
        for (moved, is_few) in
            [(vec![], true), (vec![3], true), (vec![0, 1, 14, 12], true), ((2..200).collect(), false)]
        {
            let wanted = pairs.iter().filter(|pair| moved.contains(&pair.a) || moved.contains(&pair.b));
            let (found, asked) = of_moved(&waiting, &moved);
            assert_eq!((found, asked == 0), (wanted.copied().collect(), is_few), "{moved:?}");
        }
    }

    #[test]
    fn ten_thousand_waiting_pairs_cost_what_the_moved_ones_are() {
        let boxes = waiting((0..20_000).map(|id| id % 10_000));
        assert_eq!(boxes.waiting.len(), 20_000);
        let wanted = [Pair { a: 7, b: 10_007 }, Pair { a: 9000, b: 19_000 }];
        assert_eq!(of_moved(&boxes.waiting, &[7, 19_000]), (wanted.to_vec(), 0));
    }

    #[test]
    fn many_moved_boxes_cost_what_the_waiting_pairs_are() {
        let waiting =
            [Pair { a: 0, b: 9 }, Pair { a: 1, b: 2 }, Pair { a: 3, b: 4 }].iter().flat_map(ends).collect();
        let moved: Vec<_> = (5..300).collect();
        assert_eq!(of_moved(&waiting, &moved), (vec![Pair { a: 0, b: 9 }], 6));
    }

    #[test]
    fn pairs_that_have_ended_wait_no_longer() {
        let mut boxes = waiting([0; 5]);
        set(&mut boxes, 2, 1);
        boxes.lost = [3, 4].map(collider).into();
        assert_eq!(update(&mut boxes), []);
        assert_eq!(boxes.waiting, [[0, 1], [1, 0]].into());
        // Another collider gets an id again, and its pairs begin.
        let id = set(&mut boxes, 99, 0);
        assert_eq!(update(&mut boxes), [Pair::new(0, id), Pair::new(1, id)]);
        assert!(id < 5 && boxes.waiting.len() == 2);
    }

    #[test]
    fn errors_name_no_setting_that_a_user_lacks() {
        let limits = [Error::TooManyBoxes { boxes: 9, limit: 8 }, Error::TooManyPairs { limit: 8 }];
        for text in limits.map(|error| in_words(&error)) {
            assert!(text.contains("at most 8 ") && !text.contains("max_"), "{text}");
        }
        assert!(in_words(&Error::SparseId { id: 9, known: 1 }).contains("id 9"));
    }
}
