//! Boxes as the search reads them: all that is tested of one lies in one cache line.

use crate::Aabb;

/// A box: half a cache line.
#[repr(C, align(32))]
#[derive(Clone, Copy, Debug)]
pub(crate) struct Item {
    pub(crate) aabb: Aabb,
    pub(crate) id: u32,
    /// Of its cell, when it was sorted.
    pub(super) key: u32,
}

impl Item {
    pub(super) const fn new(aabb: Aabb, id: u32, key: u32) -> Self {
        Self { aabb, id, key }
    }
}

/// A box, and what it was before. (In arrays of their own the two were in two or three cache lines.)
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tracked {
    item: Item,
    /// As long as `update` is the present one; later, the box has not changed since.
    before: Aabb,
    /// In which the box changed.
    update: u64,
}

const _: () = assert!(size_of::<Tracked>() == 64);

impl Tracked {
    /// A box that changed in an update.
    pub(crate) const fn changed(aabb: Aabb, id: u32, before: Aabb, update: u64) -> Self {
        Self { item: Item::new(aabb, id, 0), before, update }
    }

    /// What the box was before the update that began.
    #[inline(always)]
    fn before(&self, update: u64) -> &Aabb {
        if self.update == update { &self.before } else { &self.item.aabb }
    }
}

/// What the sort moves and the search tests.
pub(crate) trait Record: Copy + Send + Sync {
    const EMPTY: Self;

    /// `before` has by id what boxes were before; those that it does not have were nowhere.
    fn new(item: Item, before: &[Aabb]) -> Self;

    fn item(&self) -> &Item;

    /// Whether the two are known to have overlapped before.
    #[inline(always)]
    fn overlapped(&self, _other: &Self) -> bool {
        false
    }

    /// As [`Record::overlapped`], where the other one need not have changed in this update.
    #[inline(always)]
    fn overlapped_still(&self, _other: &Self, _update: u64) -> bool {
        false
    }
}

impl Record for Item {
    const EMPTY: Self = Self::new(Aabb::NOWHERE, 0, 0);

    #[inline(always)]
    fn new(item: Item, _: &[Aabb]) -> Self {
        item
    }

    #[inline(always)]
    fn item(&self) -> &Item {
        self
    }
}

impl Record for Tracked {
    const EMPTY: Self = Self { item: Item::EMPTY, before: Aabb::NOWHERE, update: 0 };

    #[inline(always)]
    fn new(item: Item, before: &[Aabb]) -> Self {
        Self { item, before: before.get(item.id as usize).copied().unwrap_or(Aabb::NOWHERE), update: 0 }
    }

    #[inline(always)]
    fn item(&self) -> &Item {
        &self.item
    }

    #[inline(always)]
    fn overlapped(&self, other: &Self) -> bool {
        self.before.overlaps(&other.before)
    }

    #[inline(always)]
    fn overlapped_still(&self, other: &Self, update: u64) -> bool {
        self.before.overlaps(other.before(update))
    }
}
