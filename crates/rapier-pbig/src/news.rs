//! Which of many listed colliders need a second look.

use rapier3d::prelude::ColliderHandle;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

/// Of how many listed colliders one may be news for their indices to be kept: with more, all are looked at again.
const SHARE: usize = 256;

/// Indices of colliders that are new, disabled, gone or heirs, noted on several threads. Of 100,000 that move and one that
/// comes in, a second look at all took 2.6 of 10.0 ms.
pub(crate) struct News {
    noted: Mutex<Vec<u32>>,
    limit: usize,
    are_many: AtomicBool,
}

impl News {
    pub(crate) fn new(listed: usize) -> Self {
        Self { noted: Mutex::default(), limit: listed / SHARE, are_many: AtomicBool::new(false) }
    }

    #[cold]
    pub(crate) fn note(&self, index: u32) {
        if self.are_many.load(Ordering::Relaxed) {
            return;
        }
        let mut noted = self.noted.lock().unwrap_or_else(PoisonError::into_inner);
        noted.push(index);
        if noted.len() > self.limit {
            self.are_many.store(true, Ordering::Relaxed);
        }
    }

    pub(crate) fn into_second_look(self) -> SecondLook {
        let mut noted = self.noted.into_inner().unwrap_or_else(PoisonError::into_inner);
        noted.sort_unstable();
        if self.are_many.into_inner() { SecondLook::All } else { SecondLook::These(noted) }
    }
}

/// Who gets one.
pub(crate) enum SecondLook {
    All,
    /// Those with these indices, in ascending order.
    These(Vec<u32>),
}

impl SecondLook {
    /// Of listed colliders, in their order.
    pub(crate) fn of(&self, listed: &[ColliderHandle]) -> impl Iterator<Item = ColliderHandle> {
        let listed = if self.is_empty() { &[][..] } else { listed };
        listed.iter().copied().filter(|handle| self.has(handle.into_raw_parts().0))
    }

    fn is_empty(&self) -> bool {
        matches!(self, Self::These(indices) if indices.is_empty())
    }

    fn has(&self, index: u32) -> bool {
        match self {
            Self::All => true,
            Self::These(indices) => indices.binary_search(&index).is_ok(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn those_noted_get_a_second_look_and_all_where_they_are_many() {
        let listed: Vec<_> = (0..1024).rev().map(|index| ColliderHandle::from_raw_parts(index, 7)).collect();
        let looked = |noted: &[u32]| {
            let news = News::new(listed.len());
            noted.iter().for_each(|&index| news.note(index));
            let second = news.into_second_look();
            second.of(&listed).map(|handle| handle.into_raw_parts().0).collect::<Vec<_>>()
        };
        assert_eq!(looked(&[]), [], "none");
        assert_eq!(looked(&[3, 60, 3]), [60, 3], "in the order of the list, each once");
        assert_eq!(looked(&[1, 2, 3, 2000]), [3, 2, 1], "a 256th of the list, one of them not in it");
        assert_eq!(looked(&[1, 2, 3, 4, 5]).len(), 1024, "more");
    }
}
