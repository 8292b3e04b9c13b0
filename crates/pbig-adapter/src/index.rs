//! Scene queries. They search an index of boxes. The first query builds the index, and the first query after a change brings it
//! up to date. Without queries it costs next to nothing.

use crate::policy;
use crate::{Colliders, Tree};
use pbig_core::{Aabb, BoxIndex, BroadPhase};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Mutex, PoisonError, RwLock, TryLockError};

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
        self.visit(query, &mut |index| {
            met.push(index);
            query.bound()
        });
        met.sort_unstable();
        met
    }

    /// Returns the collider with the least cost below the query's bound, the one with the lowest index of several. `cost` also
    /// gets the cost up to which it matters.
    pub fn best<R>(
        &self,
        query: &SceneQuery,
        cost: impl Fn(u32, f32) -> Option<(f32, R)>,
    ) -> Option<(u32, R)> {
        let (mut bound, mut best) = (query.bound(), None::<(u32, R)>);
        self.visit(query, &mut |index| {
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

/// The index, and the changes that it does not know.
#[derive(Debug, Default)]
pub(crate) struct SceneIndex {
    state: RwLock<State>,
    is_fresh: AtomicBool,
    /// Questions that a grid has answered since the index was fresh.
    asked_of_grid: AtomicU32,
    /// Held while the index is brought up to date. A writer never waits for readers of `state`: a sort gives up while there is
    /// one, and a refresh runs while there is none. Otherwise a query inside a query could wait for a writer that waits for the
    /// outer query.
    refreshing: Mutex<()>,
}

#[derive(Debug, Default)]
struct State {
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
        *self.is_fresh.get_mut() = false;
        *self.asked_of_grid.get_mut() = 0;
    }

    /// Returns true if a grid should answer a question about a box: the index is stale, and few have asked since.
    pub(crate) fn prefers_grid(&self) -> bool {
        let is_fresh = self.is_fresh.load(Ordering::Acquire);
        !is_fresh && self.asked_of_grid.fetch_add(1, Ordering::Relaxed) < policy::QUESTIONS_TO_GRID
    }

    /// Notes changed boxes before an update forgets them.
    pub(crate) fn note(&mut self, changed: &[u32], ids: u32) {
        if changed.is_empty() {
            return;
        }
        self.expire();
        let state = self.state.get_mut().unwrap_or_else(PoisonError::into_inner);
        // A longer list saves nothing, because a refresh with many changes reads all boxes.
        state.knows_changes &= state.changed.len() + changed.len() <= ids as usize / 8;
        if state.knows_changes {
            state.changed.extend_from_slice(changed);
        } else {
            state.changed.clear();
        }
    }

    /// Visits the ids of the boxes that a query meets: first those at the start of the motion or around the point, sorted.
    /// `visit` returns the bound up to which more are wanted.
    pub(crate) fn visit(&self, core: &BroadPhase, query: &SceneQuery, visit: &mut dyn FnMut(u32) -> f32) {
        if !self.is_fresh.load(Ordering::Acquire) {
            self.refresh(core);
        }
        let wants_sort = {
            let index = &self.state.read().unwrap_or_else(PoisonError::into_inner).index;
            match *query {
                SceneQuery::Sweep(start, velocity, time) => index.sweep(&start, velocity, time, visit),
                SceneQuery::Near(point, distance) => index.near(point, distance, visit),
                SceneQuery::Overlap(aabb) => index.sweep(&aabb, [0.0; 3], 0.0, visit),
            };
            index.wants_sort()
        };
        if wants_sort {
            self.sort(core);
        }
    }

    /// Sorts the index, unless another thread reads it; a later query tries again.
    fn sort(&self, core: &BroadPhase) {
        let mut state = match self.state.try_write() {
            Ok(state) => state,
            Err(TryLockError::Poisoned(state)) => state.into_inner(),
            Err(TryLockError::WouldBlock) => return,
        };
        // Another thread may have sorted it meanwhile.
        if state.index.wants_sort() {
            state.index.sort(core.fat_aabbs());
        }
    }

    fn refresh(&self, core: &BroadPhase) {
        let _guard = self.refreshing.lock().unwrap_or_else(PoisonError::into_inner);
        if self.is_fresh.load(Ordering::Acquire) {
            return;
        }
        // Readers have seen a fresh index, so there are none.
        let mut state = self.state.write().unwrap_or_else(PoisonError::into_inner);
        let State { index, changed, knows_changes } = &mut *state;
        changed.extend_from_slice(core.changes());
        index.refresh(core.fat_aabbs(), knows_changes.then_some(&changed[..]));
        changed.clear();
        *knows_changes = true;
        self.is_fresh.store(true, Ordering::Release);
    }
}
