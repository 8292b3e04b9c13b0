//! The tree of the world's boxes, which look-ups and queries share. It is fresh or stale; who needs it makes it fresh. Without
//! look-ups and queries it costs next to nothing.

use super::world::World;
use crate::BoxIndex;
use crate::parallel::alone;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError};

/// Maximum share of changed boxes, as one in this number, that a stale tree lists. Beyond it a refresh reads all boxes anyway.
const KNOWN_CHANGES_IN: usize = 8;

/// A tree that knows all boxes, or all that may have changed since it did.
#[derive(Debug, Default)]
pub(super) struct Tree {
    fresh: OnceLock<Fresh>,
    stale: Mutex<Stale>,
    /// A query has read the tree since the last update.
    is_read: AtomicBool,
}

/// A tree of the boxes as they are, which queries read at once.
#[derive(Debug)]
struct Fresh {
    // An update moves it a few times; without a box that takes longer than a look-up.
    index: Box<BoxIndex>,
    /// A tree of these boxes in a better order, made once queries have looked at as many nodes as a sort costs.
    sorted: OnceLock<Box<BoxIndex>>,
    /// Held by the query that sorts. The others go on with the tree as it is.
    sorting: Mutex<()>,
}

#[derive(Debug, Default)]
struct Stale {
    index: Option<Box<BoxIndex>>,
    /// Ids of boxes that may have changed since, repeated or not, beside those that have changed since the last update.
    changed: Vec<u32>,
    /// False if `changed` was given up because it grew too long.
    knows_changes: bool,
}

impl Tree {
    #[inline(always)]
    pub(super) fn expire(&mut self) {
        if self.fresh.get_mut().is_some() {
            self.make_stale();
        }
    }

    #[cold]
    fn make_stale(&mut self) {
        if let Some(Fresh { index, sorted, .. }) = self.fresh.take() {
            let stale = self.stale_mut();
            (stale.index, stale.knows_changes) = (Some(sorted.into_inner().unwrap_or(index)), true);
        }
    }

    fn stale_mut(&mut self) -> &mut Stale {
        self.stale.get_mut().unwrap_or_else(PoisonError::into_inner)
    }

    /// Notes what has changed, before an update forgets it. Makes the tree fresh if queries have read it since the last update: here
    /// threads share the work, which a query does alone.
    pub(super) fn end_update(&mut self, world: &World) {
        let is_read = std::mem::take(self.is_read.get_mut());
        if self.fresh.get_mut().is_some() || world.changed.is_empty() {
            return;
        }
        if is_read {
            self.fresh = self.stale_mut().refreshed(world, false).0.into();
            return;
        }
        let stale = self.stale_mut();
        let changed = stale.changed.len() + world.changed.len();
        stale.knows_changes &= changed <= world.present.len() / KNOWN_CHANGES_IN;
        if stale.knows_changes {
            stale.changed.extend_from_slice(&world.changed);
        } else {
            stale.changed.clear();
            stale.index.iter_mut().for_each(|index| index.drop_peak(world.present.len()));
        }
    }

    /// Returns the tree of the boxes as they are. The first query after a change brings it up to date, alone, because others may
    /// wait for it.
    #[inline(always)]
    pub(super) fn get(&self, world: &World) -> &BoxIndex {
        let fresh = self.fresh.get_or_init(|| alone(|| self.refreshed(world)));
        if !self.is_read.load(Ordering::Relaxed) {
            self.is_read.store(true, Ordering::Relaxed);
        }
        let index = fresh.sorted.get().unwrap_or(&fresh.index);
        if index.wants_sort() { fresh.sort(world) } else { index }
    }

    #[cold]
    fn refreshed(&self, world: &World) -> Fresh {
        self.stale.lock().unwrap_or_else(PoisonError::into_inner).refreshed(world, false).0
    }

    /// Returns how many of the changed boxes need new places in the tree as it is: those that came, and those that are no longer near others
    /// that were near them when it was brought up to date. After all have moved far away, all need one, and are searched until fewer
    /// arrive or a query asks. None do if there is no tree yet, so that there will be one.
    pub(super) fn arrivals(&mut self, world: &World) -> usize {
        let is_fresh = self.fresh.get_mut().is_some();
        let index = self.stale_mut().index.as_ref().filter(|_| !is_fresh);
        index.map_or(0, |index| index.arrivals(&world.boxes, &world.changed))
    }

    /// Makes the tree fresh, for look-ups of the changed boxes. Returns it, and how many boxes were read.
    pub(super) fn refresh_for_look_ups(&mut self, world: &World) -> (&BoxIndex, usize) {
        self.make_stale();
        let (fresh, read) = self.stale_mut().refreshed(world, true);
        (&self.fresh.get_or_init(|| fresh).index, read)
    }

    /// Notes how many nodes the look-ups have looked at, and whether they were given up.
    pub(super) fn note_look_ups(&mut self, nodes: u64, is_given_up: bool) {
        if let Some(fresh) = self.fresh.get_mut() {
            fresh.index.note_look_ups(nodes, is_given_up);
        }
    }

    /// Takes over a tree that was sorted just now from all boxes. The one so far is left in its place, for its memory.
    pub(super) fn adopt(&mut self, sorted: &mut BoxIndex) {
        self.make_stale();
        let mut index = self.stale_mut().take();
        std::mem::swap(&mut *index, sorted);
        self.fresh = Fresh::from(index).into();
    }
}

impl Stale {
    /// Takes the tree, and forgets what has changed since.
    fn take(&mut self) -> Box<BoxIndex> {
        self.changed.clear();
        self.knows_changes = false;
        self.index.take().unwrap_or_default()
    }

    /// Takes the tree, and brings it up to date. Returns how many boxes were read, too.
    fn refreshed(&mut self, world: &World, is_for_look_ups: bool) -> (Fresh, usize) {
        let mut changed = std::mem::take(&mut self.changed);
        changed.extend_from_slice(&world.changed);
        let known = self.knows_changes.then_some(&changed[..]);
        let (mut index, present) = (self.take(), world.present.iter());
        let read = index.refresh_present(&world.boxes, known, present, is_for_look_ups);
        changed.clear();
        self.changed = changed;
        (Fresh::from(index), read)
    }
}

impl From<Box<BoxIndex>> for Fresh {
    fn from(index: Box<BoxIndex>) -> Self {
        Self { index, sorted: OnceLock::new(), sorting: Mutex::new(()) }
    }
}

impl Fresh {
    /// Sorts the boxes for this and later queries, unless another query does it just now. Both orders are held until the boxes change.
    #[cold]
    fn sort(&self, world: &World) -> &BoxIndex {
        let sort = || {
            let mut index = Box::<BoxIndex>::default();
            index.refresh_present(&world.boxes, None, world.present.iter(), false);
            index
        };
        match self.sorting.try_lock() {
            Ok(_guard) => self.sorted.get_or_init(sort),
            Err(_) => &self.index,
        }
    }
}

#[cfg(all(test, feature = "parallel"))]
mod tests;
