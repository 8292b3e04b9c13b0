//! Memory that a peak has left: it is given back, a piece an update, once it was not needed for a while. Scratch is not copied.

use std::ops::{Deref, DerefMut};

/// Number of updates whose needs are remembered. The oldest part of them is forgotten at once, so that at least 64 are.
const WINDOW: usize = 72;

/// Parts of the window.
const PARTS: usize = 9;

/// Maximum ratio of a list's capacity to what the window needed.
const MAX_SPARE: usize = 4;

/// Number of pieces in which memory is given back. Giving back a page takes time, so all at once could take longer than an update.
const PIECES: usize = 80;

/// Maximum alignment, in bytes, of elements whose memory the allocator gives back in place. It copies a list of others, so these are given
/// back at once.
const MAX_ALIGN: usize = 16;

/// Part of the need, as one in this number, that is left beside it.
const SPARE: usize = 4;

/// Capacity that is never given back, and the least part of it that is given back at once, in elements.
const SMALL: usize = 4096;

/// A list whose length differs from update to update, and what it needed in the last ones.
#[derive(Clone, Debug)]
pub(crate) struct ShrinkingVec<T> {
    list: Vec<T>,
    /// By part of the window: the largest number of elements needed.
    needs: [usize; PARTS],
    updates: usize,
    /// Elements to give back in each update, until the capacity is little more than the need. 0 if it was not too large since the need
    /// grew.
    piece: usize,
}

impl<T> Default for ShrinkingVec<T> {
    fn default() -> Self {
        Self { list: Vec::new(), needs: [0; PARTS], updates: 0, piece: 0 }
    }
}

impl<T> ShrinkingVec<T> {
    /// Notes how many elements an update needed. Gives a piece of the memory back if the window needed much less than there is: only
    /// elements behind those needed may be lost.
    pub(crate) fn settle(&mut self, needed: usize) {
        if self.list.capacity() <= SMALL {
            return;
        }
        if self.piece > 0 && self.needs.iter().all(|earlier| *earlier < needed) {
            self.piece = 0;
        }
        let part = self.updates / (WINDOW / PARTS) % PARTS;
        let is_new = self.updates.is_multiple_of(WINDOW / PARTS);
        self.needs[part] = if is_new { needed } else { self.needs[part].max(needed) };
        self.updates += 1;
        // Until the first window has passed, the largest need is not known.
        if self.updates > WINDOW {
            self.shrink(self.needs.into_iter().max().unwrap_or(0));
        }
    }

    fn shrink(&mut self, most: usize) {
        let (capacity, wanted) = (self.list.capacity(), most + most / SPARE + SMALL);
        if capacity > MAX_SPARE * most + SMALL {
            let pieces = if align_of::<T>() > MAX_ALIGN { 1 } else { PIECES };
            self.piece = self.piece.max((capacity - wanted).div_ceil(pieces)).max(SMALL);
        }
        if self.piece > 0 && capacity > wanted {
            let left = wanted.max(capacity.saturating_sub(self.piece));
            self.list.truncate(left);
            self.list.shrink_to(left);
        }
    }

    /// As [`ShrinkingVec::settle`], for at least as many elements as there are. Removes them.
    pub(crate) fn settle_and_clear(&mut self, needed: usize) {
        let needed = needed.max(self.list.len());
        self.list.clear();
        self.settle(needed);
    }
}

impl<T> Deref for ShrinkingVec<T> {
    type Target = Vec<T>;

    #[inline(always)]
    fn deref(&self) -> &Vec<T> {
        &self.list
    }
}

impl<T> DerefMut for ShrinkingVec<T> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut Vec<T> {
        &mut self.list
    }
}

/// Buffers that keep nothing from one call to the next but memory. A clone has none.
#[derive(Debug, Default)]
pub(crate) struct Scratch<T>(T);

impl<T: Default> Clone for Scratch<T> {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl<T> Deref for Scratch<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.0
    }
}

impl<T> DerefMut for Scratch<T> {
    fn deref_mut(&mut self) -> &mut T {
        &mut self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pool(capacity: usize) -> ShrinkingVec<u8> {
        ShrinkingVec { list: vec![0; capacity], ..ShrinkingVec::default() }
    }

    /// The last piece is less than one of the pieces of the peak.
    #[test]
    fn a_list_shrinks_by_less_than_a_piece_of_a_higher_peak() {
        let mut pool = pool(2_000_000);
        (0..160).for_each(|_| pool.settle(20_000));
        let before = pool.capacity();
        (0..200).for_each(|_| pool.settle(1000));
        assert!(before >= 25_000 && pool.capacity() <= 1250 + SMALL, "{before}, {}", pool.capacity());
    }

    #[derive(Clone, Copy)]
    #[repr(align(32))]
    struct Aligned([u8; 32]);

    #[test]
    fn a_list_that_would_be_copied_shrinks_once() {
        let mut pool = ShrinkingVec { list: vec![Aligned([7; 32]); 1_000_000], ..Default::default() };
        let capacities: Vec<usize> = (0..200).map(|_| (pool.settle(10_000), pool.capacity()).1).collect();
        assert_eq!(pool[9999].0, [7; 32]);
        let changes = capacities.windows(2).filter(|two| two[0] != two[1]).count();
        assert!(
            changes == 1 && capacities[199] <= 12_500 + SMALL,
            "{changes} changes to {}",
            capacities[199]
        );
    }

    #[test]
    fn a_need_that_comes_back_within_the_window_keeps_its_room() {
        let mut pool = pool(100_000);
        for update in 0..1000 {
            pool.settle(if update % 50 == 0 { 90_000 } else { 10 });
            assert_eq!(pool.capacity(), 100_000, "update {update}");
        }
    }
}
