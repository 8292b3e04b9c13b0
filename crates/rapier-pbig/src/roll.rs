//! The roll: which colliders have been heard of, disabled ones included.
//!
//! Rapier lists each new and each removed collider once. So as long as it is the same world all along, the
//! roll has as many colliders as the set; when it has not, the world was there before the broad phase was, or
//! was replaced by another one (a snapshot was restored). One replaced by as many other colliders goes unnoticed.

use rapier3d::prelude::{ColliderHandle, ColliderSet};

/// A generation that rapier cannot reach.
const ABSENT: u32 = u32::MAX;

/// Colliders by index.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Roll {
    generations: Vec<u32>,
    count: usize,
}

impl Roll {
    #[cfg(any(test, feature = "serde"))]
    pub(crate) fn of_generations(generations: Vec<u32>) -> Self {
        let count = generations.iter().filter(|generation| **generation != ABSENT).count();
        Self { generations, count }
    }

    pub(crate) fn generations(&self) -> &[u32] {
        &self.generations
    }

    /// The collider with this index.
    pub(crate) fn handle(&self, index: u32) -> Option<ColliderHandle> {
        let generation = *self.generations.get(index as usize)?;
        (generation != ABSENT).then(|| ColliderHandle::from_raw_parts(index, generation))
    }

    /// Asks for the memory that [`Roll::has`] reads.
    #[inline(always)]
    pub(crate) fn ask_for(&self, index: u32) {
        if let Some(generation) = self.generations.get(index as usize) {
            pbig_core::prefetch(generation);
        }
    }

    pub(crate) fn has(&self, handle: ColliderHandle) -> bool {
        self.handle(handle.into_raw_parts().0) == Some(handle)
    }

    /// Enters a collider; false if another one with this index was there, which leaves the roll.
    pub(crate) fn enter(&mut self, handle: ColliderHandle) -> bool {
        let (index, generation) = handle.into_raw_parts();
        let i = index as usize;
        if i >= self.generations.len() {
            self.generations.resize(i + 1, ABSENT);
        }
        let before = std::mem::replace(&mut self.generations[i], generation);
        self.count += usize::from(before == ABSENT);
        before == ABSENT || before == generation
    }

    /// False when this very collider was not on the roll.
    pub(crate) fn strike(&mut self, handle: ColliderHandle) -> bool {
        let has = self.has(handle);
        if has {
            self.generations[handle.into_raw_parts().0 as usize] = ABSENT;
            self.count -= 1;
        }
        has
    }

    pub(crate) fn handles(&self) -> impl Iterator<Item = ColliderHandle> {
        (0..self.generations.len() as u32).filter_map(|index| self.handle(index))
    }

    pub(crate) fn len(&self) -> usize {
        self.count
    }

    /// Whether there may be colliders in the set that it does not know, or the other way round.
    pub(crate) fn is_behind(&self, colliders: &ColliderSet) -> bool {
        self.count != colliders.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_roll_counts_colliders_not_generations() {
        let handle = ColliderHandle::from_raw_parts;
        let mut roll = Roll::default();
        assert!(roll.enter(handle(3, 0)) && roll.enter(handle(3, 0)));
        assert!(!roll.enter(handle(3, 1)), "an heir");
        assert!(!roll.strike(handle(3, 0)) && !roll.strike(handle(9, 0)));
        assert_eq!((roll.count, roll.handles().collect::<Vec<_>>()), (1, vec![handle(3, 1)]));
        assert_eq!(Roll::of_generations(roll.generations().to_vec()), roll);
        assert!(roll.strike(handle(3, 1)) && !roll.is_behind(&ColliderSet::new()));
    }
}
