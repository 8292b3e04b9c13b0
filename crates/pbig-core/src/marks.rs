//! Some of all boxes.

/// By id: whether a box is marked. (A bit each is no faster: shifts cost as much as the cache misses that they save, for
/// a million boxes, too.)
#[derive(Clone, Debug, Default)]
pub(crate) struct Marks(Vec<bool>);

impl Marks {
    /// Makes ids below `ids` known.
    pub(crate) fn reserve_ids(&mut self, ids: usize) {
        self.0.resize(ids.max(self.0.len()), false);
    }

    pub(crate) fn set(&mut self, id: u32) {
        self.0[id as usize] = true;
    }

    pub(crate) fn unset(&mut self, id: u32) {
        self.0[id as usize] = false;
    }

    #[inline(always)]
    pub(crate) fn has(&self, id: u32) -> bool {
        self.0[id as usize]
    }
}
