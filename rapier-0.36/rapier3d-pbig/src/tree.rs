//! The tree for scene queries and CCD: parry's, as rapier's own broad phase keeps it.

use crate::Bounds;
use pbig_adapter::{Bounds as _, Tree};
use rapier::math::{DIM, Real, Vector};
use rapier::parry::bounding_volume::Aabb as TreeAabb;
use rapier::parry::partitioning::{Bvh, BvhBuildStrategy, BvhWorkspace};

/// Minimum share of changed leaves, in 16ths, for a pass over the tree. Below it each changed leaf is inserted anew, which keeps
/// the tree good and reads no other leaf. Rapier's own broad phase has the same rule.
const REINSERT_BELOW_SIXTEENTHS: usize = 1;

#[derive(Clone, Default)]
pub(crate) struct ParryTree {
    pub(crate) bvh: Bvh,
    workspace: BvhWorkspace,
}

impl std::fmt::Debug for ParryTree {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.bvh.fmt(f)
    }
}

impl Tree for ParryTree {
    type Aabb = Bounds;

    fn build(leaves: impl Iterator<Item = (u32, Bounds)> + Clone) -> Self {
        if leaves.clone().nth(2).is_none() {
            let mut tree = Self::default();
            leaves.for_each(|(id, aabb)| tree.bvh.insert(to_tree(&aabb), id));
            return tree;
        }
        let leaves = leaves.map(|(id, aabb)| (id as usize, to_tree(&aabb)));
        Self { bvh: Bvh::from_iter(BvhBuildStrategy::Binned, leaves), workspace: BvhWorkspace::default() }
    }

    fn remove(&mut self, gone: &[u32]) {
        gone.iter().for_each(|&id| self.bvh.remove(id));
        self.bvh.refit(&mut self.workspace);
    }

    fn update(&mut self, leaves: impl Iterator<Item = (u32, Bounds)>) {
        let leaves: Vec<_> = leaves.collect();
        let all = self.bvh.leaf_count() as usize;
        if leaves.len() * 16 < REINSERT_BELOW_SIXTEENTHS * all {
            for (id, aabb) in leaves {
                _ = self.bvh.reinsert_or_update_with_change_detection(to_tree(&aabb), id, 0.0);
            }
            return;
        }
        for (id, aabb) in leaves {
            _ = self.bvh.insert_or_update_partially(to_tree(&aabb), id, 0.0);
        }
        self.bvh.optimize_incremental(&mut self.workspace);
        self.bvh.refit(&mut self.workspace);
    }
}

/// Clamps infinite boxes to the size of rapier's half-spaces, because the tree computes centres.
pub(crate) fn to_tree(aabb: &Bounds) -> TreeAabb {
    let corner = |corner: [Real; 3]| {
        let clamped: [Real; DIM] = std::array::from_fn(|k| corner[k].clamp(Real::MIN / 2.0, Real::MAX / 2.0));
        Vector::from(clamped)
    };
    let [min, max] = aabb.corners();
    TreeAabb::new(corner(min), corner(max))
}

#[inline(always)]
pub(crate) fn from_tree(aabb: &TreeAabb) -> Bounds {
    Bounds::from_corners(spatial(aabb.mins), spatial(aabb.maxs))
}

/// Returns a vector with the z coordinate 0 in two dimensions.
#[inline(always)]
pub(crate) fn spatial(vector: Vector) -> [Real; 3] {
    let known: [Real; DIM] = vector.into();
    std::array::from_fn(|k| if k < DIM { known[k] } else { 0.0 })
}
