//! Constants, and boxes in ordered integers, as kernels and their twins use them and no host code does.

use super::*;

/// [`Located::shape`] of an invalid box.
pub(super) const NO_LEVEL: u32 = u32::MAX;
/// Bits of [`Located::shape`] for the level. Above them are the numbers of cells less one, two bits an axis.
pub(super) const SPAN_BITS: u32 = 4;
/// The first of three bits of an entry, one for each axis. A bit is set if this is the box's lowest cell on the axis.
pub(super) const AXIS_BITS: u32 = 29;
/// Number of pairs of a long row that a workgroup moves.
pub(super) const PIECE: u32 = 4096;
/// Index of the number of pieces among the words of [`Buffer::LongRows`].
pub(super) const PIECES: u32 = 3;

/// An [`Aabb`] in ordered integers, see [`ordered`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct DeviceBox {
    pub(super) low: [i32; 3],
    pub(super) high: [i32; 3],
}

impl DeviceBox {
    /// A box that overlaps nothing: all of `low` lies above all of `high`, beyond the infinities.
    pub(super) const INVALID: Self = Self { low: [i32::MAX; 3], high: [i32::MIN; 3] };

    /// Returns the box in ordered integers.
    pub(super) fn new(aabb: &Aabb) -> Self {
        let valid = Self { low: aabb.min.map(ordered), high: aabb.max.map(ordered) };
        if aabb.is_valid() { valid } else { Self::INVALID }
    }
}

/// Returns an integer for a float, in the same order; both zeros become one. Devices may flush denormals and may assume
/// that there are no infinities, but they compare integers exactly.
pub(super) fn ordered(x: f32) -> i32 {
    let bits = (x + 0.0).to_bits() as i32;
    bits ^ (((bits >> 31) as u32) >> 1) as i32
}
