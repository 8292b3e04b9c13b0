//! Handles of colliders and bodies, without rapier's types.

use std::fmt;

/// The raw parts of one of rapier's handles. Rapier reuses the index of a removed object, with another generation.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Handle {
    /// The place in rapier's set.
    pub index: u32,
    /// A number that tells apart the objects that had the place, one after the other.
    pub generation: u32,
}

impl From<(u32, u32)> for Handle {
    #[inline(always)]
    fn from((index, generation): (u32, u32)) -> Self {
        Self { index, generation }
    }
}

impl From<Handle> for (u32, u32) {
    fn from(handle: Handle) -> Self {
        (handle.index, handle.generation)
    }
}

impl fmt::Debug for Handle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        (self.index, self.generation).fmt(f)
    }
}

/// Two colliders.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct HandlePair(pub Handle, pub Handle);

impl HandlePair {
    /// Returns the pair with the lower handle first.
    pub fn sorted(a: impl Into<Handle>, b: impl Into<Handle>) -> Self {
        let (a, b) = (a.into(), b.into());
        Self(a.min(b), a.max(b))
    }
}
