//! Ranges of work items: those after the first chunk, cut into chunks.

use crate::layout::{Chunk, Counters};

/// Returns the work items that are left after the first chunk.
pub(super) fn rest(all: &Counters, done: &Chunk) -> Chunk {
    let [first_small, first_large] =
        [all.small_items.min(done.small_items), all.large_items.min(done.large_items)];
    let (small_items, large_items) = (all.small_items - first_small, all.large_items - first_large);
    Chunk { first_small, small_items, first_large, large_items, ..Chunk::default() }
}

/// Cuts a range of work items into chunks.
pub(super) fn cut(all: Chunk, [small, large]: [u32; 2]) -> Vec<Chunk> {
    let (small, large) = (small.max(1), large.max(1));
    let count = all.small_items.div_ceil(small).max(all.large_items.div_ceil(large));
    let part = |i: u32| {
        let (s, l) = ((i * small).min(all.small_items), (i * large).min(all.large_items));
        Chunk {
            first_small: all.first_small + s,
            small_items: small.min(all.small_items - s),
            first_large: all.first_large + l,
            large_items: large.min(all.large_items - l),
            ..Chunk::default()
        }
    };
    (0..count).map(part).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chunks_cover_every_item_once() {
        for (small, large) in [(0, 0), (1, 0), (0, 7), (10, 3), (9, 9)] {
            let all = Chunk {
                first_small: 5,
                small_items: small,
                first_large: 2,
                large_items: large,
                ..Chunk::default()
            };
            let chunks = cut(all, [3, 2]);
            let items = |of: fn(&Chunk) -> (u32, u32)| -> Vec<u32> {
                chunks.iter().map(of).flat_map(|(first, n)| first..first + n).collect()
            };
            assert_eq!(items(|c| (c.first_small, c.small_items)), (5..5 + small).collect::<Vec<_>>());
            assert_eq!(items(|c| (c.first_large, c.large_items)), (2..2 + large).collect::<Vec<_>>());
            assert!(chunks.iter().all(|c| c.small_items + c.large_items > 0));
        }
    }
}
