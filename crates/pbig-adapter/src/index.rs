//! Scene queries. They search an index of boxes. The first query builds the index, and the first query after a change brings it
//! up to date. Without queries it costs next to nothing.

use crate::policy;
use crate::{Colliders, Tree};
use pbig_core::{Aabb, BoxIndex, BroadPhase};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError};

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

/// The index of boxes. It is fresh or stale; a query makes it fresh.
#[derive(Debug, Default)]
pub(crate) struct SceneIndex {
    fresh: OnceLock<Fresh>,
    stale: Mutex<Stale>,
    /// A query has read the index since an update made it fresh.
    is_read: AtomicBool,
    /// Overlap queries that a grid has answered since the index was fresh.
    asked_of_grid: AtomicU32,
}

/// An index of the boxes as they are, which queries read at once.
#[derive(Debug)]
struct Fresh {
    index: BoxIndex,
    /// An index of these boxes in a better order, made once queries have looked at as many nodes as a sort costs.
    sorted: OnceLock<BoxIndex>,
    /// Held by the query that sorts. The others go on with the index as it is.
    sorting: Mutex<()>,
}

/// An index of boxes as they were, and what has changed since.
#[derive(Debug, Default)]
struct Stale {
    index: BoxIndex,
    /// Ids whose boxes have changed since the index was fresh, repeated or not.
    changed: Vec<u32>,
    /// False if `changed` was given up because it grew too long.
    knows_changes: bool,
}

impl Clone for SceneIndex {
    /// Returns an empty index: the clone builds its own for its first query.
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl SceneIndex {
    /// Marks the index as stale. The changed boxes are those noted, and the core's pending changes.
    pub(crate) fn expire(&mut self) {
        if let Some(Fresh { index, sorted, .. }) = self.fresh.take() {
            let index = sorted.into_inner().unwrap_or(index);
            *self.stale_mut() = Stale { index, changed: Vec::new(), knows_changes: true };
        }
        *self.asked_of_grid.get_mut() = 0;
    }

    fn stale_mut(&mut self) -> &mut Stale {
        self.stale.get_mut().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns true if a grid should answer an overlap query: the index is stale, and few have asked since.
    pub(crate) fn prefers_grid(&self) -> bool {
        let is_fresh = self.fresh.get().is_some();
        !is_fresh && self.asked_of_grid.fetch_add(1, Ordering::Relaxed) < policy::QUERIES_TO_GRID
    }

    /// Notes changed boxes before an update forgets them.
    pub(crate) fn note(&mut self, changed: &[u32], ids: u32) {
        if changed.is_empty() {
            return;
        }
        self.expire();
        let stale = self.stale_mut();
        // A longer list saves nothing, because a refresh with many changes reads all boxes.
        stale.knows_changes &= stale.changed.len() + changed.len() <= ids as usize / 8;
        if stale.knows_changes {
            stale.changed.extend_from_slice(changed);
        } else {
            stale.changed.clear();
        }
    }

    /// Makes the index fresh within an update, where threads may share the work, if queries have read it since the last one.
    pub(crate) fn prepare(&mut self, core: &BroadPhase) {
        if std::mem::take(self.is_read.get_mut()) && self.fresh.get().is_none() {
            self.fresh = self.refreshed(core, BoxIndex::refresh).into();
        }
    }

    /// Asks the index of the boxes as they are. The first query after a change brings it up to date, alone, because others may wait
    /// for it.
    #[inline(always)]
    pub(crate) fn ask(&self, core: &BroadPhase, ask: impl FnOnce(&BoxIndex) -> u64) {
        let fresh = self.fresh.get_or_init(|| self.refreshed(core, BoxIndex::refresh_alone));
        if !self.is_read.load(Ordering::Relaxed) {
            self.is_read.store(true, Ordering::Relaxed);
        }
        let index = fresh.sorted.get().unwrap_or(&fresh.index);
        ask(index);
        if index.wants_sort() {
            fresh.sort(core);
        }
    }

    /// Takes the stale index, and brings it up to date.
    #[cold]
    fn refreshed(&self, core: &BroadPhase, refresh: fn(&mut BoxIndex, &[Aabb], Option<&[u32]>)) -> Fresh {
        let stale = std::mem::take(&mut *self.stale.lock().unwrap_or_else(PoisonError::into_inner));
        let Stale { mut index, mut changed, knows_changes } = stale;
        changed.extend_from_slice(core.changes());
        refresh(&mut index, core.fat_aabbs(), knows_changes.then_some(&changed[..]));
        Fresh { index, sorted: OnceLock::new(), sorting: Mutex::new(()) }
    }
}

impl Fresh {
    /// Sorts the boxes for later queries, unless another query does it just now. Both orders are held until the boxes change.
    #[cold]
    fn sort(&self, core: &BroadPhase) {
        let sort = || {
            let mut index = BoxIndex::default();
            index.sort(core.fat_aabbs());
            index
        };
        if let Ok(_guard) = self.sorting.try_lock() {
            self.sorted.get_or_init(sort);
        }
    }
}

#[cfg(all(test, feature = "parallel"))]
mod tests;
