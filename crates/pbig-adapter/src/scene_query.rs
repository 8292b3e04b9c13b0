//! Scene queries, answered by the core's tree of boxes.

use crate::{Colliders, Tree};
use pbig_core::Aabb;

/// A scene query, by the boxes that it looks for.
#[derive(Clone, Copy, Debug)]
pub enum SceneQuery<A = Aabb, R = f32> {
    /// Boxes that a moving box (a point, for a ray) meets: its start, its velocity, and the last time.
    Sweep(A, [R; 3], R),
    /// Boxes within a distance of a point.
    Near([R; 3], R),
    /// Boxes that overlap a box.
    Overlap(A),
}

impl SceneQuery {
    /// Returns the largest time or distance.
    fn bound(&self) -> f32 {
        match *self {
            Self::Sweep(.., bound) | Self::Near(_, bound) => bound,
            Self::Overlap(_) => 0.0,
        }
    }
}

impl<T: Tree<Aabb = Aabb>> Colliders<T> {
    /// Returns the indices of colliders whose boxes a query meets, sorted, and perhaps some that it barely misses.
    pub fn met(&self, query: &SceneQuery) -> Vec<u32> {
        let mut met = Vec::new();
        self.visit(query, |index| {
            met.push(index);
            query.bound()
        });
        met.sort_unstable();
        met
    }

    /// Returns the collider with the least cost below the query's bound, the one with the lowest index of several. `cost` also
    /// gets the cost up to which it matters.
    #[inline(always)]
    pub fn best<R>(
        &self,
        query: &SceneQuery,
        cost: impl Fn(u32, f32) -> Option<(f32, R)>,
    ) -> Option<(u32, R)> {
        let (mut bound, mut best) = (query.bound(), None::<(u32, R)>);
        self.visit(query, |index| {
            // A little more than the best so far, so that the order of visits decides no ties.
            let reach = (bound * (1.0 + f32::EPSILON)).min(query.bound());
            if let Some((found, result)) = cost(index, reach) {
                let first = best.as_ref().map_or(0, |best| best.0);
                if found < bound || found == bound && index < first {
                    (bound, best) = (found, Some((index, result)));
                }
            }
            bound
        });
        best
    }
}
