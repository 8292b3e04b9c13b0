//! A set of ids that is listed in time that follows its members, not the ids.

/// Maximum distance of ids, plus one, that are sorted by bits: these fit the nearest cache. Beyond, comparisons take less time.
const SORTED_BELOW: u32 = 1 << 18;

/// A bit for each id, and above them a bit for each word of 64 ids: a million ids without a member are 250 words to read.
#[derive(Clone, Debug, Default)]
pub(crate) struct IdSet {
    /// By id.
    bits: Vec<u64>,
    /// By word of `bits`: whether it has a member.
    words: Vec<u64>,
    len: usize,
}

impl IdSet {
    pub(crate) fn len(&self) -> usize {
        self.len
    }

    pub(crate) fn contains(&self, id: u32) -> bool {
        self.bits[id as usize / 64] & 1 << (id % 64) != 0
    }

    /// Makes room for ids below `ids`; no member is beyond.
    pub(crate) fn reserve(&mut self, ids: usize) {
        self.bits.resize(ids.div_ceil(64), 0);
        self.words.resize(self.bits.len().div_ceil(64), 0);
    }

    pub(crate) fn insert(&mut self, id: u32) {
        let (word, bit) = (id as usize / 64, 1 << (id % 64));
        self.len += usize::from(self.bits[word] & bit == 0);
        self.bits[word] |= bit;
        self.words[word / 64] |= 1 << (word % 64);
    }

    /// Sorts ids of which no two are equal, into `to`. The set is empty before and after, and knows each id by its distance from the
    /// lowest one.
    #[inline(always)]
    pub(crate) fn sort(&mut self, ids: &[u32], to: &mut [u32]) {
        let (first, last) = ids.iter().fold((u32::MAX, 0), |(low, high), id| (low.min(*id), high.max(*id)));
        // If two ids are equal, the last place keeps one of them.
        to.copy_from_slice(ids);
        if last.saturating_sub(first) >= SORTED_BELOW {
            return to.sort_unstable();
        }
        self.reserve(SORTED_BELOW as usize);
        for id in ids {
            let at = (id - first) as usize;
            self.bits[at / 64] |= 1 << (at % 64);
            self.words[at / 4096] |= 1 << (at / 64 % 64);
        }
        let mut to = to.iter_mut();
        for at in 0..=last.saturating_sub(first) as usize / 4096 {
            for word in ones(at, std::mem::take(&mut self.words[at])) {
                let members = ones(word as usize, std::mem::take(&mut self.bits[word as usize]));
                members.zip(&mut to).for_each(|(id, to)| *to = first + id);
            }
        }
    }

    pub(crate) fn remove(&mut self, id: u32) {
        let word = id as usize / 64;
        self.len -= 1;
        self.bits[word] &= !(1 << (id % 64));
        if self.bits[word] == 0 {
            self.words[word / 64] &= !(1 << (word % 64));
        }
    }

    /// Yields the members in order.
    pub(crate) fn iter(&self) -> impl Iterator<Item = u32> + Clone {
        let words = self.words.iter().enumerate().flat_map(|(at, word)| ones(at, *word));
        words.flat_map(|word| ones(word as usize, self.bits[word as usize]))
    }

    pub(crate) fn shrink(&mut self) {
        self.bits.shrink_to_fit();
        self.words.shrink_to_fit();
    }
}

/// Yields the numbers of the bits of the word `at` of many.
#[inline(always)]
fn ones(at: usize, mut word: u64) -> impl Iterator<Item = u32> + Clone {
    std::iter::from_fn(move || {
        let bit = word.trailing_zeros();
        let is_any = word != 0;
        word &= word.wrapping_sub(1);
        is_any.then_some(at as u32 * 64 + bit)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn members_are_listed_in_order_after_insertions_and_removals() {
        let mut set = IdSet::default();
        set.reserve(10_000);
        let all = [0, 63, 64, 65, 4095, 4096, 8191, 9999];
        all.iter().rev().chain(&all).for_each(|id| set.insert(*id));
        assert!(set.iter().eq(all) && set.len() == 8);
        [64, 4096, 9999].iter().for_each(|id| set.remove(*id));
        assert!(set.iter().eq([0, 63, 65, 4095, 8191]) && set.len() == 5);
        assert!([64, 4097].iter().all(|id| !set.contains(*id)) && set.iter().all(|id| set.contains(id)));
        set.reserve(8192);
        assert!(set.iter().eq([0, 63, 65, 4095, 8191]));
    }

    #[test]
    fn ids_are_sorted_anywhere_and_leave_the_set_empty() {
        let mut set = IdSet::default();
        for (len, step) in
            [(0, 1), (1, 1), (300, 1), (300, 63), (300, 64), (300, 800), (300, 4097), (5000, 7)]
        {
            for first in [0, 5, 100_000, u32::MAX - 2_000_000] {
                let sorted: Vec<u32> = (0..len).map(|i| first + i * step).collect();
                let ids: Vec<u32> = (0..len).map(|i| first + (i * 7919 % len) * step).collect();
                let mut to = vec![0; len as usize];
                set.sort(&ids, &mut to);
                assert!(to == sorted, "{len} ids, {step} apart, from {first}");
                assert!(set.iter().next().is_none());
            }
        }
    }
}
