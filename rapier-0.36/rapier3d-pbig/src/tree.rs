//! The tree for scene queries and CCD: parry's, as rapier's own broad phase keeps it.

use crate::scene::Bounds;
use pbig_adapter::Bounds as _;
use rapier::math::{DIM, Real, Vector};
use rapier::parry::bounding_volume::Aabb as TreeAabb;
use rapier::parry::partitioning::{Bvh, BvhBuildStrategy, BvhWorkspace};

/// Minimum share of changed leaves, in 16ths, for a pass over the tree. Below it each changed leaf is inserted anew, which keeps
/// the tree good and reads no other leaf. Rapier's own broad phase has the same rule.
const REINSERT_BELOW_SIXTEENTHS: usize = 1;

pbig_adapter::define_tree!(Vector, reinsert_few);

fn reinsert_few(bvh: &mut Bvh, leaves: &[(u32, TreeAabb)]) -> bool {
    let are_few = leaves.len() * 16 < REINSERT_BELOW_SIXTEENTHS * bvh.leaf_count() as usize;
    for &(id, aabb) in leaves.iter().filter(|_| are_few) {
        _ = bvh.reinsert_or_update_with_change_detection(aabb, id, 0.0);
    }
    are_few
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
