//! The tree for scene queries: parry's, in the version of rapier 0.27.

use pbig_adapter::{Aabb, Tree};
use rapier3d::parry::bounding_volume::Aabb as TreeAabb;
use rapier3d::parry::partitioning::{Bvh, BvhBuildStrategy, BvhWorkspace};
use rapier3d::prelude::{Point, Real};

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
    type Aabb = Aabb;

    fn build(leaves: impl Iterator<Item = (u32, Aabb)> + Clone) -> Self {
        // Parry 0.22 takes the ids of one or two leaves for 0 and 1.
        if leaves.clone().nth(2).is_none() {
            let mut tree = Self::default();
            tree.update(leaves);
            return tree;
        }
        let leaves = leaves.map(|(id, aabb)| (id as usize, to_tree(&aabb)));
        Self { bvh: Bvh::from_iter(BvhBuildStrategy::Binned, leaves), workspace: BvhWorkspace::default() }
    }

    /// Removals leave nodes behind that parry 0.22's optimiser may take for leaves. Refitting drops these nodes.
    fn remove(&mut self, gone: &[u32]) {
        gone.iter().for_each(|&id| self.bvh.remove(id));
        self.bvh.refit(&mut self.workspace);
    }

    fn update(&mut self, leaves: impl Iterator<Item = (u32, Aabb)>) {
        for (id, aabb) in leaves {
            self.bvh.insert_or_update_partially(to_tree(&aabb), id, 0.0);
        }
        self.bvh.optimize_incremental(&mut self.workspace);
        self.bvh.refit(&mut self.workspace);
    }
}

/// Clamps infinite boxes to the size of rapier's half-spaces, because the tree computes centres.
pub(crate) fn to_tree(aabb: &Aabb) -> TreeAabb {
    let corner = |corner: [f32; 3]| Point::from(corner.map(|x| x.clamp(Real::MIN / 2.0, Real::MAX / 2.0)));
    TreeAabb::new(corner(aabb.min), corner(aabb.max))
}
