//! The tree for scene queries. The first query builds it; it is updated only while queries use it.
//!
//! Rapier's queries walk a parry `Bvh` of collider indices. Rapier's own broad phase is such a tree; ours has grids, so it
//! builds the tree for queries. While there is a tree, each change of boxes is noted. The next query updates the tree, or
//! rebuilds it if too many boxes changed.

use crate::Bounds;
use crate::policy;
#[cfg(test)]
use pbig_core::Aabb;
use std::sync::{Mutex, OnceLock, PoisonError};

/// Parry's tree, in the version that rapier uses. The AABBs can be infinite. The default has no leaves.
pub trait Tree: Default {
    /// The AABBs of the world.
    type Aabb: Bounds;

    /// Builds the tree of at least three leaves.
    fn build(leaves: impl Iterator<Item = (u32, Self::Aabb)> + Clone) -> Self;

    /// Removes these leaves, and makes the tree ready for further changes.
    fn remove(&mut self, gone: &[u32]);

    /// Inserts leaves or moves them. Afterwards the tree is ready for queries.
    fn update(&mut self, leaves: impl Iterator<Item = (u32, Self::Aabb)>);
}

/// A tree for queries, if there are any.
#[derive(Debug)]
pub(crate) struct SceneTree<T> {
    /// The tree, if it is up to date.
    current: OnceLock<T>,
    /// The tree as of the last query, if boxes have changed since.
    stale: Mutex<Option<Stale<T>>>,
}

/// A tree, and the ids of boxes that have changed since. An id may occur several times.
#[derive(Debug)]
struct Stale<T> {
    tree: T,
    changed: Vec<u32>,
}

impl<T> Default for SceneTree<T> {
    fn default() -> Self {
        Self { current: OnceLock::new(), stale: Mutex::new(None) }
    }
}

impl<T> Clone for SceneTree<T> {
    /// Returns an empty tree: the clone builds its own for its first query.
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl<T: Tree> SceneTree<T> {
    /// Says that boxes have changed since the last query.
    pub(crate) fn expire(&mut self) {
        if let Some(tree) = self.current.take() {
            *self.stale.get_mut().unwrap_or_else(PoisonError::into_inner) =
                Some(Stale { tree, changed: Vec::new() });
        }
    }

    /// Notes the boxes that have changed before an update forgets them, and drops a tree that has missed too many changes.
    /// `colliders` is the number of known colliders. Does nothing while nobody has asked for the tree.
    pub(crate) fn note(&mut self, changed: impl Iterator<Item = u32>, colliders: usize) {
        let mut changed = changed.peekable();
        if changed.peek().is_none() {
            return;
        }
        self.expire();
        let stale = self.stale.get_mut().unwrap_or_else(PoisonError::into_inner);
        if let Some(kept) = stale {
            kept.changed.extend(changed);
            if kept.changed.len() > policy::TREE_CHANGES_PER_COLLIDER * colliders {
                *stale = None;
            }
        }
    }

    /// Returns the tree of the boxes with ids below `ids`. `pending` are the ids of boxes that changed since the last update.
    pub(crate) fn get(
        &self,
        ids: u32,
        pending: impl Iterator<Item = u32>,
        aabb: impl Fn(u32) -> Option<T::Aabb>,
    ) -> &T {
        let make = || match self.stale.lock().unwrap_or_else(PoisonError::into_inner).take() {
            Some(mut stale) => {
                stale.changed.extend(pending);
                stale.updated(ids, aabb)
            }
            None => build(ids, aabb),
        };
        self.current.get_or_init(make)
    }
}

fn build<T: Tree>(ids: u32, aabb: impl Fn(u32) -> Option<T::Aabb>) -> T {
    let aabb = &aabb;
    let leaves = (0..ids).filter_map(move |id| Some((id, aabb(id)?)));
    if leaves.clone().nth(2).is_some() {
        return T::build(leaves);
    }
    // Parry 0.22 takes the ids of one or two leaves for 0 and 1.
    let mut tree = T::default();
    tree.update(leaves);
    tree
}

impl<T: Tree> Stale<T> {
    /// Removes first, because a removal reads the boxes of a leaf's ancestors.
    fn updated(self, ids: u32, aabb: impl Fn(u32) -> Option<T::Aabb>) -> T {
        let Self { mut tree, mut changed } = self;
        changed.sort_unstable();
        changed.dedup();
        let gone: Vec<u32> = changed.iter().copied().filter(|&id| aabb(id).is_none()).collect();
        // Parry's trees of one or two leaves have a layout of their own, in which removals leave traces.
        if !gone.is_empty() && (0..ids).filter(|&id| aabb(id).is_some()).nth(2).is_none() {
            return build(ids, aabb);
        }
        if !gone.is_empty() {
            tree.remove(&gone);
        }
        tree.update(changed.into_iter().filter_map(|id| Some((id, aabb(id)?))));
        tree
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    /// A list of leaves, and how it came about.
    #[derive(Debug, Default, PartialEq)]
    struct List {
        leaves: Vec<(u32, Aabb)>,
        updates: usize,
    }

    impl Tree for List {
        type Aabb = Aabb;

        fn build(leaves: impl Iterator<Item = (u32, Aabb)> + Clone) -> Self {
            Self { leaves: leaves.collect(), updates: 0 }
        }

        fn remove(&mut self, gone: &[u32]) {
            self.leaves.retain(|(id, _)| !gone.contains(id));
        }

        fn update(&mut self, leaves: impl Iterator<Item = (u32, Aabb)>) {
            for leaf in leaves {
                self.leaves.retain(|(id, _)| *id != leaf.0);
                self.leaves.push(leaf);
            }
            self.leaves.sort_by_key(|leaf| leaf.0);
            self.updates += 1;
        }
    }

    fn cube(x: f32) -> Option<Aabb> {
        Some(Aabb::from_center([x, 0.0, 0.0], [0.4; 3]))
    }

    #[test]
    fn a_tree_follows_its_boxes_through_all_sizes() {
        for n in [1u32, 2, 3, 50] {
            let (mut tree, mut updates) = (SceneTree::<List>::default(), 0);
            let mut boxes: Vec<Option<Aabb>> = (0..n).map(|i| cube(i as f32)).collect();
            for round in 0..100u32 {
                // One box goes or comes back, and one moves; some of it after the update, as at the end of a step.
                let [first, second] = [round * 7 % n, round * 3 % n];
                boxes[first as usize] = if boxes[first as usize].is_some() { None } else { cube(0.5) };
                tree.note([first].into_iter(), 2 * n as usize);
                boxes[second as usize] = cube(round as f32);
                tree.expire();
                let found = tree.get(n, [second].into_iter(), |id| boxes[id as usize]);
                let wanted = boxes.iter().enumerate().filter_map(|(id, one)| Some((id as u32, (*one)?)));
                assert_eq!(found.leaves, wanted.collect::<Vec<_>>(), "{n} boxes, round {round}");
                updates = updates.max(found.updates);
            }
            assert!(updates > 10 || n < 4, "{n} boxes: rebuilt each time");
        }
    }

    #[test]
    fn unasked_trees_are_dropped_and_unchanged_ones_not_touched() {
        let (mut tree, asked) = (SceneTree::<List>::default(), Cell::new(0));
        let aabb = |id: u32| {
            asked.set(asked.get() + 1);
            cube(id as f32)
        };
        tree.note(0..100, 100);
        assert_eq!(tree.get(100, [].into_iter(), aabb).leaves.len(), 100);
        let before = asked.get();
        assert_eq!((tree.get(100, [].into_iter(), aabb).updates, asked.get()), (0, before));
        for _ in 0..10 {
            tree.note(0..10, 100);
        }
        assert_eq!(tree.get(100, [].into_iter(), aabb).updates, 1, "100 changes are few enough");
        (0..11).for_each(|_| tree.note(0..10, 100));
        assert_eq!(tree.get(100, [].into_iter(), aabb).updates, 0, "110 are too many: built anew");
    }
}
