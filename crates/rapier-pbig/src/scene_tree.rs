//! The tree for scene queries. The first query builds it; it is updated only while queries use it.
//!
//! Rapier's queries walk a parry `Bvh` of collider indices. Rapier's own broad phase is such a tree; ours has grids, so it
//! builds the tree for queries. While there is a tree, each update notes which boxes change. The next query updates the tree,
//! or rebuilds it if too many boxes changed.

use crate::policy;
use pbig_core::Aabb;
use rapier3d::parry::bounding_volume::Aabb as TreeAabb;
use rapier3d::parry::partitioning::{Bvh, BvhBuildStrategy, BvhWorkspace};
use rapier3d::prelude::{Point, Real};
use std::sync::{Mutex, OnceLock, PoisonError};

#[derive(Debug, Default)]
pub(crate) struct SceneTree {
    /// The tree, if it is up to date.
    current: OnceLock<Tree>,
    /// The tree as of the last query, if boxes have changed since.
    stale: Mutex<Option<Stale>>,
}

#[derive(Clone, Default)]
struct Tree {
    bvh: Bvh,
    workspace: BvhWorkspace,
}

impl std::fmt::Debug for Tree {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.bvh.fmt(f)
    }
}

/// A tree, and the ids of boxes that have changed since. An id may occur several times.
#[derive(Debug)]
struct Stale {
    tree: Tree,
    changed: Vec<u32>,
}

impl Clone for SceneTree {
    /// Returns an empty tree: the clone builds its own for its first query.
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl SceneTree {
    /// Notes the boxes that an update changes, and drops a tree that has missed too many changes. `colliders` is the number
    /// of known colliders.
    pub(crate) fn note(&mut self, changed: impl Iterator<Item = u32>, colliders: usize) {
        let mut changed = changed.peekable();
        if changed.peek().is_none() {
            return;
        }
        let stale = self.stale.get_mut().unwrap_or_else(PoisonError::into_inner);
        if let Some(tree) = self.current.take() {
            *stale = Some(Stale { tree, changed: Vec::new() });
        }
        if let Some(kept) = stale {
            kept.changed.extend(changed);
            if kept.changed.len() > policy::TREE_CHANGES_PER_COLLIDER * colliders {
                *stale = None;
            }
        }
    }

    /// Returns true if there is a tree to keep up to date.
    pub(crate) fn is_used(&mut self) -> bool {
        let stale = self.stale.get_mut().unwrap_or_else(PoisonError::into_inner);
        self.current.get().is_some() || stale.is_some()
    }

    /// Returns the tree of the boxes with ids below `ids`.
    pub(crate) fn get(&self, ids: u32, aabb: impl Fn(u32) -> Option<Aabb>) -> &Bvh {
        let make = || match self.stale.lock().unwrap_or_else(PoisonError::into_inner).take() {
            Some(stale) => stale.updated(ids, aabb),
            None => Tree::build(ids, aabb),
        };
        &self.current.get_or_init(make).bvh
    }
}

impl Stale {
    /// Removes first, because a removal reads the boxes of a leaf's ancestors. It leaves nodes behind that parry 0.22's optimiser
    /// may take for leaves. Refitting drops these nodes, except in a tree of one or two leaves.
    fn updated(self, ids: u32, aabb: impl Fn(u32) -> Option<Aabb>) -> Tree {
        let Self { mut tree, mut changed } = self;
        changed.sort_unstable();
        changed.dedup();
        let gone: Vec<u32> = changed.iter().copied().filter(|&id| aabb(id).is_none()).collect();
        gone.iter().for_each(|&id| tree.bvh.remove(id));
        if !gone.is_empty() && tree.bvh.leaf_count() <= 2 {
            return Tree::build(ids, aabb);
        }
        if !gone.is_empty() {
            tree.bvh.refit(&mut tree.workspace);
        }
        tree.update(changed.into_iter().filter_map(|id| Some((id, aabb(id)?))));
        tree
    }
}

impl Tree {
    /// Builds a tree of the boxes with ids below `ids`.
    fn build(ids: u32, aabb: impl Fn(u32) -> Option<Aabb>) -> Self {
        let boxes = || (0..ids).filter_map(|id| Some((id, aabb(id)?)));
        // Parry 0.22 takes the ids of one or two leaves for 0 and 1.
        if boxes().nth(2).is_none() {
            let mut tree = Self::default();
            tree.update(boxes());
            return tree;
        }
        let leaves = boxes().map(|(id, aabb)| (id as usize, tree_aabb(&aabb)));
        Self { bvh: Bvh::from_iter(BvhBuildStrategy::Binned, leaves), workspace: BvhWorkspace::default() }
    }

    fn update(&mut self, boxes: impl Iterator<Item = (u32, Aabb)>) {
        for (id, aabb) in boxes {
            self.bvh.insert_or_update_partially(tree_aabb(&aabb), id, 0.0);
        }
        self.bvh.optimize_incremental(&mut self.workspace);
        self.bvh.refit(&mut self.workspace);
    }
}

/// Clamps infinite boxes to the size of rapier's half-spaces, because the tree computes centres.
fn tree_aabb(aabb: &Aabb) -> TreeAabb {
    let corner = |corner: [f32; 3]| Point::from(corner.map(|x| x.clamp(Real::MIN / 2.0, Real::MAX / 2.0)));
    TreeAabb::new(corner(aabb.min), corner(aabb.max))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube(x: f32) -> Option<Aabb> {
        Some(Aabb::from_center([x, 0.0, 0.0], [0.4; 3]))
    }

    /// Returns the ids of the boxes at `x`, in ascending order.
    fn at(bvh: &Bvh, x: f32) -> Vec<u32> {
        let point = TreeAabb::new(Point::new(x, 0.0, 0.0), Point::new(x, 0.0, 0.0));
        let mut ids: Vec<u32> = bvh.intersect_aabb(&point).collect();
        ids.sort_unstable();
        ids
    }

    #[test]
    fn a_tree_follows_its_boxes_through_all_sizes() {
        for n in [0u32, 1, 2, 3, 4, 50] {
            let mut tree = SceneTree::default();
            assert!(!tree.is_used());
            let mut boxes: Vec<Option<Aabb>> = (0..n).map(|i| cube(i as f32)).collect();
            for round in 0..200u32 {
                let bvh = tree.get(n, |id| boxes[id as usize]);
                for (id, one) in boxes.iter().enumerate().filter_map(|(id, one)| Some((id as u32, (*one)?))) {
                    let center = (one.min[0] + one.max[0]) / 2.0;
                    assert!(at(bvh, center).contains(&id), "{n} boxes, round {round}: {id} at {center}");
                }
                assert_eq!(bvh.leaf_count() as usize, boxes.iter().flatten().count());
                // One box goes or comes back and one moves. In some rounds all move, or all but one or two go.
                let mut changed = vec![round * 7 % n.max(1), round * 3 % n.max(1)];
                if round % 10 == 9 {
                    changed.extend(0..n);
                }
                changed.retain(|&id| id < n);
                for (i, &id) in changed.iter().enumerate() {
                    let gone = i == 0 && boxes[id as usize].is_some();
                    boxes[id as usize] = if gone { None } else { cube((round + id) as f32) };
                }
                if round % 10 >= 7 {
                    let kept = |id: u32| id == round % n.max(1) || (round % 10 == 8 && id == 0);
                    let gone: Vec<u32> =
                        (0..n).filter(|&id| !kept(id) && boxes[id as usize].is_some()).collect();
                    gone.iter().for_each(|&id| boxes[id as usize] = None);
                    changed.extend(gone);
                }
                tree.note(changed.into_iter(), 2 * n as usize);
            }
        }
    }

    #[test]
    fn a_tree_that_nobody_asks_for_is_dropped() {
        let mut tree = SceneTree::default();
        tree.get(100, |id| cube(id as f32));
        for round in 0..30 {
            assert!(tree.is_used() == (round <= 10), "round {round}");
            tree.note(0..10, 100);
        }
    }

    #[test]
    fn identical_infinite_and_huge_boxes_make_a_tree() {
        let aabb = |id: u32| match id % 3 {
            0 => Some(Aabb::new([f32::NEG_INFINITY; 3], [f32::INFINITY; 3])),
            1 => Some(Aabb::new([-f32::MAX; 3], [f32::MAX; 3])),
            _ => cube(1.0),
        };
        let tree = SceneTree::default();
        assert_eq!(at(tree.get(600, aabb), 1.0).len(), 600);
    }
}
