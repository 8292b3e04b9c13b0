//! Faults planted on purpose: the checks must notice each one.

use pbig_core::Pair;

/// The list of pairs that a run falsifies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Fault {
    /// No list.
    None,
    /// A list from `Finder` that loses a pair.
    FinderLoses,
    /// A list from `Finder` that gets a pair twice.
    FinderRepeats,
    /// Events without one of the added pairs.
    AddedLost,
    /// Events without one of the removed pairs.
    RemovedLost,
    /// Events of a rapier world without one of the added pairs.
    WorldLoses,
}

impl Fault {
    /// The faults that a run must notice.
    pub(crate) const PLANTED: [Self; 5] =
        [Self::FinderLoses, Self::FinderRepeats, Self::AddedLost, Self::RemovedLost, Self::WorldLoses];

    /// Removes the middle one of a list of pairs or events if `at` is this fault.
    pub(crate) fn lose<T>(self, at: Self, pairs: &mut Vec<T>) {
        if self == at && !pairs.is_empty() {
            pairs.remove(pairs.len() / 2);
        }
    }

    /// Repeats the first pair of a list if `at` is this fault.
    pub(crate) fn repeat(self, at: Self, pairs: &mut Vec<Pair>) {
        if self == at
            && let Some(&first) = pairs.first()
        {
            pairs.insert(0, first);
        }
    }
}
