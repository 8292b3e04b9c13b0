//! The boxes of pbig: one for each proxy in avian's trees.

use avian::collider_tree::{
    ColliderTreeProxy, ColliderTreeProxyKey, ColliderTreeType, ColliderTrees, MovedProxies,
};
use avian::prelude::ColliderDisabled;
use bevy::prelude::*;
use pbig_core::{Aabb, BroadPhase, Error, Pair, ProxyFilter};
use std::collections::BTreeSet;

/// The keys of the proxies of colliders that take part in collisions.
pub(crate) type Keys<'w, 's> = Query<'w, 's, &'static ColliderTreeProxyKey, Without<ColliderDisabled>>;

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
    /// Overlapping pairs that a joint or a hook vetoes, or that nobody asked for since their contact was removed.
    pub(crate) without_contact: BTreeSet<Pair>,
}

/// A collider with a box.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Slot {
    pub(crate) key: ColliderTreeProxyKey,
    pub(crate) collider: Entity,
    /// The proxy moved in this update, by avian's list.
    pub(crate) has_moved: bool,
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
    /// begun, and those without a contact of which one proxy moved. The caller inserts the ones that stay without a contact again.
    pub(crate) fn update(&mut self, trees: &ColliderTrees, moved: &MovedProxies, keys: &Keys) -> Vec<Pair> {
        let followed = self.follow(trees, moved, keys);
        let found = self.broad_phase.update().map(drop);
        if let Err(error) = followed.and(found) {
            error!("pbig: {}; some pairs that began in this step are not found yet", in_words(&error));
        }
        let events = self.broad_phase.events();
        events.removed.iter().for_each(|pair| _ = self.without_contact.remove(pair));
        let mut pairs = events.added.clone();
        let has_moved = |id: u32| self.slots[id as usize].has_moved;
        pairs.extend(take_moved(&mut self.without_contact, &self.broad_phase, &self.moved, has_moved));
        pairs.sort_unstable();
        pairs
    }

    /// Sets the boxes of moved proxies. Colliders that have lost their contacts begin anew: their boxes are removed, and set again
    /// where they still have a proxy.
    fn follow(&mut self, trees: &ColliderTrees, moved: &MovedProxies, keys: &Keys) -> Result<(), Error> {
        self.moved.drain(..).for_each(|id| self.slots[id as usize].has_moved = false);
        let lost = std::mem::take(&mut self.lost);
        lost.iter().for_each(|&collider| self.remove(collider));
        let anew = |collider| Some(Slot { key: *keys.get(collider).ok()?, collider, has_moved: false });
        let at = |&key| Some(Slot { key, collider: trees.get_proxy(key)?.collider, has_moved: true });
        let slots = lost.into_iter().filter_map(anew).chain(moved.proxies().iter().filter_map(at));
        // Avian names each proxy once. So all are set, even if one of them fails.
        slots.map(|slot| self.set(trees, slot)).reduce(Result::and).unwrap_or(Ok(()))
    }

    /// Sets the box of a collider, unless its key is out of date.
    fn set(&mut self, trees: &ColliderTrees, slot: Slot) -> Result<(), Error> {
        let aabb = trees.tree_for_type(slot.key.tree_type()).get_proxy_aabb(slot.key.id());
        let Some((proxy, aabb)) = slot.proxy(trees).zip(aabb) else { return Ok(()) };
        let id = self.store(slot);
        if slot.has_moved {
            self.moved.push(id);
        }
        self.broad_phase.set(id, Aabb::new(aabb.min.into(), aabb.max.into()), filter(slot.key, proxy))
    }

    /// Stores a collider's slot. Returns its id; a new one if it has none.
    fn store(&mut self, slot: Slot) -> u32 {
        let index = slot.collider.index_u32() as usize;
        self.ids.resize(self.ids.len().max(index + 1), None);
        let id = *self.ids[index].get_or_insert_with(|| {
            self.free.pop().unwrap_or_else(|| {
                self.slots.push(slot);
                self.slots.len() as u32 - 1
            })
        });
        self.slots[id as usize] = slot;
        id
    }

    /// Removes the box of a collider, if it has one. Its id is free.
    fn remove(&mut self, collider: Entity) {
        let id = self.ids.get_mut(collider.index_u32() as usize).and_then(Option::take);
        let Some(id) = id else { return };
        // Pairs of a removed box end without an event.
        if !self.without_contact.is_empty() {
            self.broad_phase.pairs_of(id).for_each(|pair| _ = self.without_contact.remove(&pair));
        }
        self.broad_phase.remove(id);
        self.free.push(id);
    }
}

/// Takes the pairs with a moved id out of `waiting`, in no order. All of them are pairs of the broad phase. The work follows
/// the smaller number: all pairs of the moved ids, or the waiting pairs.
fn take_moved(
    waiting: &mut BTreeSet<Pair>,
    broad_phase: &BroadPhase,
    moved: &[u32],
    has_moved: impl Fn(u32) -> bool,
) -> Vec<Pair> {
    let pairs_of_moved = || moved.iter().map(|&id| broad_phase.degree(id) as usize).sum::<usize>();
    if moved.len() < waiting.len() && pairs_of_moved() < waiting.len() {
        let pairs = moved.iter().flat_map(|&id| broad_phase.pairs_of(id));
        pairs.filter(|pair| waiting.remove(pair)).collect()
    } else {
        waiting.extract_if(.., |pair| has_moved(pair.a) || has_moved(pair.b)).collect()
    }
}

/// Returns the filter of a proxy: layers, body, and the trees that avian searches for it. Static colliders pair with each other
/// only if one is a sensor, and standalone ones never do.
fn filter(key: ColliderTreeProxyKey, proxy: &ColliderTreeProxy) -> ProxyFilter {
    let (kind, accepted_kinds) = match key.tree_type() {
        ColliderTreeType::Static if !proxy.is_sensor() => (2, 0),
        ColliderTreeType::Standalone => (4, !4),
        _ => (1, u8::MAX),
    };
    ProxyFilter {
        body: proxy.body.map_or(ProxyFilter::NO_BODY, |body| body.index_u32()),
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
        let id = boxes.store(Slot { key, collider: collider(index), has_moved: false });
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
        boxes.without_contact = update(&mut boxes).into_iter().collect();
        boxes
    }

    /// Takes the waiting pairs of moved ids. Returns them, sorted, and how often a waiting pair was looked at.
    fn take(boxes: &mut ColliderBoxes, moved: &[u32]) -> (Vec<Pair>, usize) {
        let asked = Cell::new(0);
        let has_moved = |id| {
            asked.set(asked.get() + 1);
            moved.contains(&id)
        };
        let mut pairs = take_moved(&mut boxes.without_contact, &boxes.broad_phase, moved, has_moved);
        pairs.sort_unstable();
        (pairs, asked.get())
    }

    #[test]
    fn both_ways_to_take_pairs_give_those_of_the_moved_ids() {
        // Few moved ids are looked up, many are compared with every pair.
        for (moved, is_few) in
            [(vec![], true), (vec![3], true), (vec![0, 1, 14, 12], true), ((2..20).collect(), false)]
        {
            let mut boxes = waiting([0; 20]);
            boxes.without_contact.retain(|pair| pair.a < 9 && pair.b >= 9 && pair.a + pair.b != 15);
            let (wanted, others): (Vec<_>, Vec<_>) = (boxes.without_contact.iter())
                .partition(|pair| moved.contains(&pair.a) || moved.contains(&pair.b));
            let (pairs, asked) = take(&mut boxes, &moved);
            assert_eq!((pairs, asked == 0), (wanted, is_few), "{moved:?}");
            assert!(boxes.without_contact.iter().eq(&others), "{moved:?}");
        }
    }

    #[test]
    fn ten_thousand_waiting_pairs_cost_what_the_moved_ones_are() {
        let mut boxes = waiting((0..20_000).map(|id| id % 10_000));
        assert_eq!(boxes.without_contact.len(), 10_000);
        let wanted = [Pair { a: 7, b: 10_007 }, Pair { a: 9000, b: 19_000 }];
        assert_eq!(take(&mut boxes, &[7, 19_000]), (wanted.to_vec(), 0));
    }

    #[test]
    fn a_moved_box_with_many_pairs_costs_what_the_waiting_ones_are() {
        let mut boxes = waiting([0; 300]);
        let wanted = Pair { a: 0, b: 9 };
        boxes.without_contact = [wanted, Pair { a: 1, b: 2 }, Pair { a: 3, b: 4 }].into();
        let (pairs, asked) = take(&mut boxes, &[0]);
        assert!(pairs == [wanted] && (1..=6).contains(&asked), "{pairs:?}, asked {asked} times");
    }

    #[test]
    fn pairs_that_have_ended_wait_no_longer() {
        let mut boxes = waiting([0; 5]);
        set(&mut boxes, 2, 1);
        boxes.lost = [3, 4].map(collider).into();
        assert_eq!(update(&mut boxes), []);
        assert_eq!(boxes.without_contact, [Pair { a: 0, b: 1 }].into());
        // Another collider gets an id again, and its pairs begin.
        let id = set(&mut boxes, 99, 0);
        assert_eq!(update(&mut boxes), [Pair::new(0, id), Pair::new(1, id)]);
        assert!(id < 5 && boxes.without_contact.len() == 1);
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
