//! A set of ids that is listed in time that follows its members, not the ids.

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
    /// Returns the number of members.
    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// Makes room for ids below `ids`; no member is beyond.
    pub(super) fn reserve(&mut self, ids: usize) {
        self.bits.resize(ids.div_ceil(64), 0);
        self.words.resize(self.bits.len().div_ceil(64), 0);
    }

    pub(super) fn insert(&mut self, id: u32) {
        let (word, bit) = (id as usize / 64, 1 << (id % 64));
        self.len += usize::from(self.bits[word] & bit == 0);
        self.bits[word] |= bit;
        self.words[word / 64] |= 1 << (word % 64);
    }

    /// Takes out a member.
    pub(super) fn remove(&mut self, id: u32) {
        let word = id as usize / 64;
        self.len -= 1;
        self.bits[word] &= !(1 << (id % 64));
        if self.bits[word] == 0 {
            self.words[word / 64] &= !(1 << (word % 64));
        }
    }

    /// Yields the members in order.
    pub(crate) fn iter(&self) -> impl Iterator<Item = u32> {
        let words = self.words.iter().enumerate().flat_map(|(at, word)| ones(at, *word));
        words.flat_map(|word| ones(word as usize, self.bits[word as usize]))
    }

    /// Gives back memory.
    pub(super) fn shrink(&mut self) {
        self.bits.shrink_to_fit();
        self.words.shrink_to_fit();
    }
}

/// Yields the numbers of the bits of the word `at` of many.
fn ones(at: usize, mut word: u64) -> impl Iterator<Item = u32> {
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
        set.reserve(8192);
        assert!(set.iter().eq([0, 63, 65, 4095, 8191]));
    }
}
