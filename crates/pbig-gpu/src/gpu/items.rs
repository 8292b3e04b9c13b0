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
        let from = |size: u32, items: u32| i.saturating_mul(size).min(items);
        let (s, l) = (from(small, all.small_items), from(large, all.large_items));
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
        // In the last one the 1024th chunk would begin at large item 2^32.
        let long = 1024 * 1026;
        for ([small, large], chunk) in [
            ([0, 0], [3, 2]),
            ([1, 0], [3, 2]),
            ([0, 7], [3, 2]),
            ([10, 3], [3, 2]),
            ([9, 9], [3, 2]),
            ([long, 5], [1024, 1 << 22]),
            ([5, long], [1 << 22, 1024]),
        ] {
            let all = Chunk {
                first_small: 5,
                small_items: small,
                first_large: 2,
                large_items: large,
                ..Chunk::default()
            };
            let chunks = cut(all, chunk);
            let items = |of: fn(&Chunk) -> (u32, u32)| -> Vec<u32> {
                chunks.iter().map(of).flat_map(|(first, n)| first..first + n).collect()
            };
            assert_eq!(items(|c| (c.first_small, c.small_items)), (5..5 + small).collect::<Vec<_>>());
            assert_eq!(items(|c| (c.first_large, c.large_items)), (2..2 + large).collect::<Vec<_>>());
            assert!(chunks.iter().all(|c| c.small_items + c.large_items > 0));
        }
    }
}
