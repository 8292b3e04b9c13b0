//! A box as the search reads it: half a cache line.

use crate::Aabb;
use crate::aabb::one_box;

/// A box with its id and the key of its cell.
#[repr(C, align(32))]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Record {
    pub(crate) aabb: Aabb,
    pub(crate) id: u32,
    pub(crate) key: u32,
}

const _: () = assert!(size_of::<Record>() == 32);

impl Record {
    pub(crate) const EMPTY: Self = Self { aabb: Aabb::NOWHERE, id: 0, key: 0 };

    /// Makes a record by words of eight bytes. Otherwise a copy of the record would wait until eight separate writes are done.
    #[inline(always)]
    pub(crate) fn new(aabb: Aabb, id: u32, key: u32) -> Self {
        let [x, y, z]: [u64; 3] = bytemuck::cast(aabb);
        let tail = u64::from_ne_bytes(bytemuck::cast([id, key]));
        bytemuck::cast([x, y, z, tail])
    }

    /// The exact test of two valid boxes, see [`Aabb::overlaps`]. A record has two numbers behind its box, so that both
    /// corners can be loaded as four lanes.
    #[inline(always)]
    pub(crate) fn overlaps(&self, other: &Self) -> bool {
        one_box::records_overlap(bytemuck::cast_ref(self), bytemuck::cast_ref(other))
    }
}
