//! The colliders that the broad phase knows, disabled ones included.
//!
//! Rapier lists each new and each removed collider once. As long as the world is the same one, the registry holds as many
//! colliders as rapier's set. If the numbers differ, the world is older than the broad phase or was replaced by another one
//! (a restored snapshot). A world with the same number of other colliders goes unnoticed.

use crate::Handle;

/// A generation that rapier cannot reach.
const ABSENT: u32 = u32::MAX;

/// Known colliders by index.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct ColliderRegistry {
    generations: Vec<u32>,
    count: usize,
}

impl ColliderRegistry {
    #[cfg(any(test, feature = "serde"))]
    pub(crate) fn from_generations(generations: Vec<u32>) -> Self {
        let count = generations.iter().filter(|generation| **generation != ABSENT).count();
        Self { generations, count }
    }

    #[cfg(any(test, feature = "serde"))]
    pub(crate) fn generations(&self) -> &[u32] {
        &self.generations
    }

    /// Returns the known collider with this index.
    #[inline(always)]
    pub(crate) fn handle(&self, index: u32) -> Option<Handle> {
        let generation = *self.generations.get(index as usize)?;
        (generation != ABSENT).then_some(Handle { index, generation })
    }

    #[inline(always)]
    pub(crate) fn contains(&self, handle: Handle) -> bool {
        self.handle(handle.index) == Some(handle)
    }

    /// Makes a collider known. Returns false if this ends an older collider that used its index.
    pub(crate) fn insert(&mut self, handle: Handle) -> bool {
        let i = handle.index as usize;
        if self.generations.len() <= i {
            self.generations.resize(i + 1, ABSENT);
        }
        let before = std::mem::replace(&mut self.generations[i], handle.generation);
        self.count += usize::from(before == ABSENT);
        before == ABSENT || before == handle.generation
    }

    /// Forgets a collider. Returns false if this very one is not known.
    pub(crate) fn remove(&mut self, handle: Handle) -> bool {
        let is_known = self.contains(handle);
        if is_known {
            self.generations[handle.index as usize] = ABSENT;
            self.count -= 1;
        }
        is_known
    }

    pub(crate) fn clear(&mut self) {
        self.generations.clear();
        self.count = 0;
    }

    /// Returns the number of known colliders.
    pub(crate) fn len(&self) -> usize {
        self.count
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_registry_counts_colliders_not_generations() {
        let handle = |index, generation| Handle { index, generation };
        let mut registry = ColliderRegistry::default();
        assert!(registry.insert(handle(3, 0)) && registry.insert(handle(3, 0)));
        assert!(!registry.insert(handle(3, 1)), "the index is reused");
        assert!(!registry.remove(handle(3, 0)) && !registry.remove(handle(9, 0)));
        assert_eq!((registry.len(), registry.handle(3)), (1, Some(handle(3, 1))));
        assert_eq!(ColliderRegistry::from_generations(registry.generations().to_vec()), registry);
        assert!(registry.remove(handle(3, 1)) && registry.len() == 0);
    }
}
