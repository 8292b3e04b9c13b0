//! Some of all boxes.

/// By id: whether a box is marked. (A byte each is as fast while all fit the cache; walks for the sake of 1% of a million boxes
/// took a fifth longer.)
#[derive(Clone, Debug, Default)]
pub(crate) struct Marks(Vec<u32>);

impl Marks {
    /// Makes ids below `ids` known.
    pub(crate) fn reserve_ids(&mut self, ids: usize) {
        self.0.resize(ids.div_ceil(32).max(self.0.len()), 0);
    }

    pub(crate) fn set(&mut self, id: u32) {
        self.0[id as usize / 32] |= 1 << (id % 32);
    }

    pub(crate) fn unset(&mut self, id: u32) {
        self.0[id as usize / 32] &= !(1 << (id % 32));
    }

    #[inline(always)]
    pub(crate) fn has(&self, id: u32) -> bool {
        self.0[id as usize / 32] >> (id % 32) & 1 != 0
    }
}
